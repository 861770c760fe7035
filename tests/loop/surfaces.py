"""Analytic surfaces: exact points and normals, exact closest distance, and the STL a CAD system would have exported."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree


@dataclass(frozen=True)
class ParamSurface:
    """z-up surface p(u, v) over a rectangle of parameters; `point` maps (n,), (n,) to (n, 3) in mm."""

    point: Callable[[np.ndarray, np.ndarray], np.ndarray]
    u: tuple[float, float]
    v: tuple[float, float]

    def derivatives(self, u, v, h=1e-4):
        du = (self.point(u + h, v) - self.point(u - h, v)) / (2 * h)
        dv = (self.point(u, v + h) - self.point(u, v - h)) / (2 * h)
        return du, dv

    def normal(self, u, v):
        n = np.cross(*self.derivatives(u, v))
        return n / np.linalg.norm(n, axis=1, keepdims=True)

    def foot(self, query):
        """Parameters of the closest points of the *untrimmed* surface, by Gauss-Newton from a grid search."""
        gu, gv = np.meshgrid(np.linspace(*self.u, 41), np.linspace(*self.v, 41), indexing="ij")
        grid = self.point(gu.ravel(), gv.ravel())
        start = cKDTree(grid).query(query)[1]
        u, v = gu.ravel()[start].copy(), gv.ravel()[start].copy()
        for _ in range(25):
            du, dv = self.derivatives(u, v)
            r = query - self.point(u, v)
            a, b, c = (du * du).sum(1), (du * dv).sum(1), (dv * dv).sum(1)
            e, f = (du * r).sum(1), (dv * r).sum(1)
            det = a * c - b * b
            step_u, step_v = (c * e - b * f) / det, (a * f - b * e) / det
            u, v = u + step_u, v + step_v
            if max(np.abs(step_u).max(), np.abs(step_v).max()) < 1e-9:
                break
        return u, v

    def inside(self, u, v):
        return (u >= self.u[0]) & (u <= self.u[1]) & (v >= self.v[0]) & (v <= self.v[1])

    def mesh(self, nu, nv):
        gu, gv = np.meshgrid(np.linspace(*self.u, nu), np.linspace(*self.v, nv), indexing="ij")
        i = np.arange(nu * nv).reshape(nu, nv)
        a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
        faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
        return self.point(gu.ravel(), gv.ravel()), faces


def write_stl(path: Path, vertices, faces, scale=1.0) -> Path:
    """Binary STL written by hand."""
    tri = (vertices[faces] * scale).astype("<f4")
    n = np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0])
    record = np.zeros(len(tri), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    record["n"] = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
    record["v"] = tri
    path.write_bytes(b"\0" * 80 + np.uint32(len(tri)).tobytes() + record.tobytes())
    return path


def plane(lx=150.0, ly=100.0):
    return ParamSurface(lambda u, v: np.stack([u, v, 0 * u], 1), (0.0, lx), (0.0, ly))


def cylinder(radius=400.0, length=600.0, width=500.0):
    half = width / 2 / radius
    return ParamSurface(
        lambda u, v: np.stack([u, radius * np.sin(v), radius * np.cos(v)], 1), (0.0, length), (-half, half)
    )


def wing(length=900.0, chord=260.0, twist_deg=9.0, taper=0.6, camber=28.0):
    """A twisted, tapered, cambered skin of our own, unlike the sample part."""

    def point(u, v):
        s = u / length
        c = chord * (1 - (1 - taper) * s)
        x = (v - 0.35) * c
        z = camber * (c / chord) * (4 * v * (1 - v)) ** 1.0 * (0.8 + 0.4 * v) + 12 * np.sin(1.5 * s)
        t = np.radians(twist_deg) * s
        return np.stack([u, x * np.cos(t) + z * np.sin(t), -x * np.sin(t) + z * np.cos(t)], 1)

    return ParamSurface(point, (0.0, length), (0.0, 1.0))


def double_curved(lx=500.0, ly=320.0, rx=1500.0, ry=700.0):
    return ParamSurface(
        lambda u, v: np.stack([u, v, -(u**2) / (2 * rx) - v**2 / (2 * ry)], 1), (-lx / 2, lx / 2), (-ly / 2, ly / 2)
    )
