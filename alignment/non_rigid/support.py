"""Where the data determine the field: a weight on the surface, 1 inside, fading to 0 beyond."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from planner.frames import Array

NEAREST = 40
# The weight falls from 1 to 0 as deviation or distance goes from its limit to this many times it.
FADE = 2.0
# Radius of the interpolation in distances of samples.
REACH = 3.0


@dataclass(frozen=True, eq=False)
class Support:
    """Samples of the surface, of equal area each: points_part (m, 3), mm; value (m,), 0..1; share: of the area that is 1.

    sigma_mm, slope_rad (m,): posterior standard deviations there.
    """

    points_part: Array
    value: Array
    share: float
    spacing_mm: float
    sigma_mm: Array
    slope_rad: Array

    @property
    def complete(self) -> bool:
        """True if the data determine the field all over the surface."""
        return bool((self.value >= 1.0).all())

    def weight(self, points: Array) -> tuple[Array, Array]:
        """Return the weight (n,) and its gradient in space (n, 3): a smooth mean of the samples around.

        Shepard's interpolation with Wendland's compact C2 function (H. Wendland, Adv. Comput. Math. 4 (1995) 389,
        doi:10.1007/BF02123482).
        """
        count = min(NEAREST, len(self.points_part))
        d, at = cKDTree(self.points_part).query(points, count)
        d, at = d.reshape(len(points), count), at.reshape(len(points), count)
        radius = np.maximum(REACH * self.spacing_mm, 1.5 * d[:, :1])
        t = np.minimum(d / radius, 1.0)
        phi = (1.0 - t) ** 4 * (4.0 * t + 1.0)
        # d phi / d p = (p - x) * -20 (1 - t)^3 / radius^2
        fall = -20.0 * (1.0 - t) ** 3 / radius**2
        total = phi.sum(axis=1)
        value = self.value[at]
        w = (phi * value).sum(axis=1) / total
        c = fall * (value - w[:, None])
        gradient = c.sum(axis=1)[:, None] * points - np.einsum("nk,nkj->nj", c, self.points_part[at])
        return w, gradient / total[:, None]


EVERYWHERE = Support(np.zeros((1, 3)), np.ones(1), 1.0, 1.0, np.zeros(1), np.zeros(1))


def fading(excess: Array) -> Array:
    """Return 1 up to an excess of 1, 0 from `FADE` on, and a smooth step between."""
    t = np.clip((excess - 1.0) / (FADE - 1.0), 0.0, 1.0)
    return np.asarray(1.0 - t * t * (3.0 - 2.0 * t))
