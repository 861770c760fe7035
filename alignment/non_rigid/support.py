"""Where the data determine the field."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planner.frames import Array


@dataclass(frozen=True, eq=False)
class Support:
    """Samples of the surface, of equal area each: points_part (m, 3), mm; inside (m,): the data determine the field there.

    sigma_mm, slope_rad (m,): posterior standard deviations of the displacement and of its slope.
    """

    points_part: Array
    inside: NDArray[np.bool_]
    sigma_mm: Array
    slope_rad: Array

    @property
    def share(self) -> float:
        """Share of the area, 0..1."""
        return float(self.inside.mean())

    def nearest(self, points: Array) -> NDArray[np.intp]:
        """Return the row of the sample nearest to each point (n,)."""
        return np.asarray(cKDTree(self.points_part).query(points)[1])

    def covers(self, points: Array) -> NDArray[np.bool_]:
        """Return whether the nearest sample of each point (n, 3) is inside (n,)."""
        return np.asarray(self.inside[self.nearest(points)])
