"""Evenly spread points on a surface: what areas, curvatures and coverage are measured with."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.surface.inspection import InspectionSurface

# Additive recurrence of the plastic number: evenly spread in two dimensions at any count (Roberts 2018, "The
# unreasonable effectiveness of quasirandom sequences"); no grid that could line up with the passes.
_PLASTIC = 1.3247179572447460
_STEP = np.array([1.0 / _PLASTIC, 1.0 / _PLASTIC**2])


@dataclass(frozen=True, eq=False)
class Samples:
    """n points on the triangles: face (n,) rows of the surface's faces, bary (n, 3), area_mm2 (n,) each stands for."""

    face: NDArray[np.int32]
    bary: Array
    area_mm2: Array


def sample_equal_area(areas_mm2: Array, count: int) -> Samples:
    """Return `count` points of equal area each, spread over triangles of these areas whatever their sizes."""
    cumulative = np.cumsum(areas_mm2)
    total = float(cumulative[-1])
    at = (np.arange(count) + 0.5) / count * total
    face = np.minimum(np.searchsorted(cumulative, at, side="right"), len(cumulative) - 1).astype(np.int32)
    return Samples(face, _spread(np.arange(count)), np.full(count, total / count))


def sample_every_face(surface: InspectionSurface, count: int) -> Samples:
    """Return about `count` points, at least one in every triangle, with the area each of them stands for."""
    area = surface.face_areas_mm2
    cell = float(area.sum()) / max(count, 1)
    each = np.maximum(np.round(area / cell), 1.0).astype(np.int64)
    face = np.repeat(np.arange(len(area), dtype=np.int32), each)
    return Samples(face, _spread(np.arange(len(face))), (area / each)[face])


def _spread(k: NDArray[np.int64]) -> Array:
    """Return barycentric coordinates (n, 3) of the k-th points of the sequence, folded into the triangle."""
    uv = np.mod(0.5 + k[:, None] * _STEP, 1.0)
    fold = uv.sum(axis=1) > 1.0
    uv[fold] = 1.0 - uv[fold]
    return np.stack([1.0 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
