"""First guesses of vertex normals, before the local fit."""

import numpy as np

from planner.frames import Array
from planner.surface.topology import Index


def unit(vectors: Array) -> Array:
    """Return vectors (n, 3) at unit length; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def angle_weighted_normals(vertices: Array, faces: Index) -> Array:
    """Return vertex normals (v, 3): face normals weighted by the corner angle (Thuermer and Wuethrich 1998).

    Unlike area or plain averages it does not depend on how a region is cut into triangles.
    """
    corners = vertices[faces]
    face_normal = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    total = np.zeros((len(vertices), 3))
    for k in range(3):
        a = unit(corners[:, (k + 1) % 3] - corners[:, k])
        b = unit(corners[:, (k + 2) % 3] - corners[:, k])
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
        for axis in range(3):
            total[:, axis] += np.bincount(faces[:, k], angle * face_normal[:, axis], len(vertices))
    return unit(total)


def tangent_frames(normals: Array) -> tuple[Array, Array]:
    """Return two unit tangents (n, 3) each that complete unit normals (n, 3) to right-handed frames.

    Branch-free construction of Duff et al. 2017, "Building an Orthonormal Basis, Revisited", JCGT 6(1).
    """
    x, y, z = normals.T
    sign = np.where(z >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    second = np.stack([b, sign + y * y * a, -y], axis=1)
    return first, second
