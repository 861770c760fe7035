"""`Foot`: closest points on the inspection surface. Built by `planner.surface.curved.CurvedSurface.closest`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array


@dataclass(frozen=True, eq=False)
class Foot:
    """Closest points of n queries, in `part`, mm.

    points (n, 3): on the smooth surface. normals (n, 3): outward, unit. distance_mm (n,): signed, + outside.
    face (n,) int32: row of `InspectionSurface.faces`. bary (n, 3). interior (n,): False where the closest point lies on
    the boundary of the surface, so that the distance is not along the normal. principal curvatures are not here: ask
    `CurvedSurface.shape_operator`.
    """

    points: Array
    normals: Array
    distance_mm: Array
    face: NDArray[np.int32]
    bary: Array
    interior: NDArray[np.bool_]
