"""Analytic surfaces as triangles, with their truth: heights z(x, y) over grids, even, uneven or irregular."""

from collections.abc import Callable

import numpy as np

from planner.part import Part, Provenance
from planner.surface.inspection import InspectionSurface


def part_of(vertices, faces) -> Part:
    return Part(
        np.asarray(vertices, dtype=np.float64),
        np.asarray(faces, dtype=np.int32),
        Provenance("test.stl", "0" * 64, "mm"),
    )


def whole(vertices, faces) -> InspectionSurface:
    return InspectionSurface(part_of(vertices, faces), np.arange(len(faces), dtype=np.int32))


def grid(x, y, height: Callable, jitter: float = 0.0):
    """Return vertices and faces of z = height(x, y) over axes x, y; inner vertices moved by `jitter` of their spacing."""
    xs, ys = np.meshgrid(x, y, indexing="ij")
    if jitter:
        rng = np.random.default_rng(1)
        for a, spacing in ((xs, np.diff(x).min()), (ys, np.diff(y).min())):
            a[1:-1, 1:-1] += rng.uniform(-jitter, jitter, a[1:-1, 1:-1].shape) * spacing
    vertices = np.stack([xs.ravel(), ys.ravel(), height(xs, ys).ravel()], axis=1)
    i = np.arange(xs.size).reshape(xs.shape)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    return vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def panel(x, y):
    """A 1.5 x 0.5 m panel curved both ways, 25 mm waves."""
    return 25.0 * np.sin(2 * np.pi * x / 900.0 + 0.3) * np.cos(2 * np.pi * y / 700.0) + x * x / 6000.0


def saddle(x, y):
    return 0.25e-3 * x * y


def normals_of(height: Callable, x, y):
    """Return unit normals (n, 3) of z = height(x, y) by central differences."""
    step = 1e-3
    dx = (height(x + step, y) - height(x - step, y)) / (2 * step)
    dy = (height(x, y + step) - height(x, y - step)) / (2 * step)
    n = np.stack([-dx, -dy, np.ones_like(x)], axis=1)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def angle_deg(a, b):
    """Return angles between unit vectors (n, 3), deg, accurate near zero."""
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b)))


def samples(surface: InspectionSurface, n: int, seed: int = 0):
    """Return faces (n,) by area and barycentrics (n, 3)."""
    rng = np.random.default_rng(seed)
    face = rng.choice(len(surface.faces), n, p=surface.face_areas_mm2 / surface.area_mm2).astype(np.int32)
    return face, rng.dirichlet([1, 1, 1], n)
