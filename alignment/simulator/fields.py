"""Smooth ways in which a part springs back: displacement along the outward normal, in mm, over the inspected face."""

from typing import Literal

import numpy as np

from alignment.simulator.truth import Field
from planner.frames import Array
from planner.surface.inspection import InspectionSurface

LEAST_SAMPLES = 40_000
FieldName = Literal["bend", "twist", "dent", "step", "bend-twist"]


def spring_back_field(surface: InspectionSurface, name: FieldName, largest_mm: float) -> Field:
    """Return a field of one shape whose largest absolute displacement over the vertices of the surface is `largest_mm`.

    bend: a parabola along the longest extent, zero at mid-length. twist: opposite corners up and down. dent: one round
    hollow of a sixth of the length. step: a smooth change of thickness half way. bend-twist: both, the default.
    """
    centre = surface.centroid_part
    corners = surface.vertices[surface.faces]
    # Second moments of the area: of a triangle, a twelfth of it times (9 m m^T + the sum of v v^T over its corners).
    v, m = corners - centre, corners.mean(axis=1) - centre
    area = surface.face_areas_mm2
    scatter = 9.0 * np.einsum("f,fi,fj->ij", area, m, m) + np.einsum("f,fki,fkj->ij", area, v, v)
    axes = np.linalg.eigh(scatter)[1]
    long, wide = axes[:, 2], axes[:, 1]
    half_long = float(np.abs((surface.vertices - centre) @ long).max())
    half_wide = float(np.abs((surface.vertices - centre) @ wide).max()) or 1.0

    def raw(points: Array) -> Array:
        u, v = (points - centre) @ long / half_long, (points - centre) @ wide / half_wide
        if name == "bend":
            return u * u
        if name == "twist":
            return u * v
        if name == "dent":
            r2 = ((u - 0.25) * half_long) ** 2 + (v * half_wide) ** 2
            return -np.exp(-r2 / (2.0 * (half_long / 6.0) ** 2))
        if name == "step":
            return 0.5 * (1.0 + np.tanh(u * half_long / (0.1 * half_long)))
        return u * u + 0.5 * u * v

    if name not in ("bend", "twist", "dent", "step", "bend-twist"):
        raise ValueError(f"unknown spring-back field '{name}'")
    samples = _samples(corners)
    scale = largest_mm / float(np.abs(raw(samples)).max())
    return lambda points: scale * raw(np.asarray(points, dtype=np.float64))


def _samples(corners: Array) -> Array:
    """Points all over triangles (f, 3, 3), some tens of thousands, corners included: the largest of a field is among them."""
    n = max(2, int(np.ceil(np.sqrt(2.0 * LEAST_SAMPLES / len(corners)))))
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    inside = i + j <= n
    bary = np.stack([i[inside], j[inside], n - i[inside] - j[inside]], axis=1) / n
    return np.einsum("sk,fkj->fsj", bary, corners).reshape(-1, 3)
