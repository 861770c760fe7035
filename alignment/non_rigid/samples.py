"""Samples of the surface, each for the same area: where the field is judged."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from alignment.non_rigid.field import Field
from alignment.non_rigid.support import Support
from planner.frames import Array
from planner.path.sampling import sample_equal_area
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

SAMPLES = 1200
# Of the field's own size, the posterior deviation may be this much.
PRIOR_SHARE = 0.5
# Of the tilt that the procedure accepts, one standard deviation of the slope may be this much.
TILT_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Surroundings:
    """m samples: points, normals (m, 3), shape operators (m, 3, 3), `part`; face (m,), bary (m, 3)."""

    face: NDArray[np.int32]
    bary: Array
    points: Array
    normals: Array
    shape: Array

    def __len__(self) -> int:
        return len(self.points)


def samples_of(curved: CurvedSurface) -> Surroundings:
    """Return samples all over the surface."""
    s = sample_equal_area(curved.surface.face_areas_mm2, SAMPLES)
    points, normals = curved.evaluate(s.face, s.bary)
    return Surroundings(s.face, s.bary, points, normals, curved.shape_operator(s.face, s.bary))


def supported(found: Field, around: Surroundings, setup: Setup) -> Field:
    """Return the field that knows where it holds.

    It holds where its standard deviation is at most half of what was believed of it before, and at most
    `tolerances.position_mm`; where that of its slope is at most half of `tolerances.tilt_deg`; and no farther from data
    than its own length.
    """
    sd, slope = found.deviation(around.points, around.normals, around.shape)
    limit = min(PRIOR_SHARE * found.sigma_mm, setup.tolerances.position_mm)
    steep = TILT_SHARE * float(np.radians(setup.tolerances.tilt_deg))
    away = cKDTree(found.nodes_part @ found.scaling).query(around.points @ found.scaling)[0]
    excess = np.maximum(np.maximum(sd / limit, slope / steep), away)
    return replace(found, support=Support(around.points, excess <= 1.0, sd, slope))
