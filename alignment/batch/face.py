"""Axes of the inspected face, along which a flat part that stands askew shows what it shows."""

import numpy as np

from alignment.estimate.motion import area_moments
from planner.frames import Array, Transform
from planner.surface.inspection import InspectionSurface

# A surface whose normals point all over has no face: length of the mean of its normals.
LEAST_FLAT = 0.5


def face_axes(surface: InspectionSurface, T_base_part: Transform) -> Array | None:
    """Return columns (3, 3) in base: x along the longest extent of the face, z its mean normal; None for a closed surface."""
    areas = surface.face_areas_mm2
    mean = areas @ surface.face_normals / areas.sum()
    length = float(np.linalg.norm(mean))
    if length < LEAST_FLAT:
        return None
    z = mean / length
    flat = np.eye(3) - np.outer(z, z)
    _, vector = np.linalg.eigh(flat @ area_moments(surface.vertices, surface.faces, areas) @ flat)
    x = flat @ vector[:, -1]
    x = x / np.linalg.norm(x)
    x = x * np.sign(x[np.argmax(np.abs(x))])
    return np.asarray(T_base_part.directions(np.array([x, np.cross(z, x), z])).T)
