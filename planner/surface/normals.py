"""First guesses of vertex normals, before the local fit."""

import numpy as np

from planner.frames import Array
from planner.surface.topology import Index


def unit(vectors: Array) -> Array:
    """Return vectors (n, 3) at unit length; zero stays zero."""
    length = lengths(vectors)[..., None]
    if (length > 0).all():
        return np.asarray(vectors / length)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def lengths(vectors: Array) -> Array:
    """Return the lengths (...,) of vectors (..., 3): numpy's norm over a short axis takes several times as long."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", vectors, vectors)))


def angle_weighted_normals(vertices: Array, faces: Index) -> Array:
    """Return vertex normals (v, 3): face normals weighted by the corner angle (Thuermer and Wuethrich 1998).

    Unlike area or plain averages it does not depend on how a region is cut into triangles.
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    edges = (c - b, a - c, b - a)  # opposite corners 0, 1, 2
    cross = np.cross(edges[2], -edges[1])
    twice = lengths(cross)
    face_normal = np.divide(cross, twice[:, None], out=np.zeros_like(cross), where=twice[:, None] > 0)
    total = np.zeros((len(vertices), 3))
    for k in range(3):
        # |u x v| is twice the area at every corner.
        angle = np.arctan2(twice, -np.einsum("ij,ij->i", edges[(k + 1) % 3], edges[(k + 2) % 3]))
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
