"""`Field`: how far, in which slope and how surely the part stands out of its CAD, anywhere on the surface."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.spatial.distance import cdist

from alignment.non_rigid.covariance import matern, matern_slope
from alignment.non_rigid.support import Support
from planner.frames import Array
from planner.surface.curved import CurvedSurface

CHUNK = 4000


@dataclass(frozen=True, eq=False)
class Field:
    """Signed displacement along the outward normal of the CAD, mm, relative to a placement of the part.

    nodes_part (n, 3), `part`, mm, and alpha (n,): the Gaussian process s^2 matern(|(p - node) scaling|) alpha,
    scaling (3, 3), 1/mm. motion (6,): the
    rigid rest (rx, ry, rz, x, y, z), rad and mm, axes of `part`, about centre_part (3,). lower (n, n): Cholesky factor of
    the nodes' covariance; design (n, 6): their motions in prior standard deviations `prior` (6,), axes of `part`.
    support: where the data determine it. Beyond, it is the most probable continuation, which goes back to the rigid part
    within a length of the kernel: to cut it off sooner would put a slope there that the part has not.
    """

    curved: CurvedSurface
    nodes_part: Array
    alpha: Array
    motion: Array
    sigma_mm: float
    scaling: Array
    lower: Array
    design: Array
    prior: Array
    support: Support | None = None

    @property
    def centre_part(self) -> Array:
        """Area centroid of the surface (3,), mm."""
        return self.curved.surface.centroid_part

    @cached_property
    def lengths_mm(self) -> Array:
        """Length scales along and across the part (2,), mm."""
        return np.asarray(1.0 / np.linalg.norm(self.scaling, axis=0)[:2])

    @cached_property
    def _scaled(self) -> Array:
        return self.nodes_part @ self.scaling

    def on(self, face: NDArray, bary: Array) -> tuple[Array, Array]:
        """Return the displacement (n,), mm, and its gradient along the surface (n, 3) at barycentrics of faces."""
        points, normals = self.curved.evaluate(face, bary)
        shape = self.curved.shape_operator(face, bary)
        w, v = self.motion[:3], self.motion[3:]
        arm = points - self.centre_part
        moved = v + np.cross(w, arm)
        f = np.einsum("ij,ij->i", normals, moved)
        g = np.einsum("nij,nj->ni", shape, moved) + np.cross(normals, w)
        for rows in _chunks(len(points)):
            u = points[rows] @ self.scaling
            d = cdist(u, self._scaled)
            f[rows] += self.sigma_mm**2 * (matern(d) @ self.alpha)
            q = self.sigma_mm**2 * matern_slope(d) * self.alpha
            g[rows] -= (q.sum(axis=1)[:, None] * u - q @ self._scaled) @ self.scaling.T
        return f, tangential(g, normals)

    def deviation(self, points: Array, normals: Array, shape: Array) -> tuple[Array, Array]:
        """Return posterior standard deviations: of the displacement (n,), mm, and of its gradient (n,), rad, the larger
        of two directions."""
        sd, slope = np.zeros(len(points)), np.zeros(len(points))
        s2 = self.sigma_mm**2
        t1 = np.cross(normals, np.eye(3)[np.argmin(np.abs(normals), axis=1)])
        t1 /= np.linalg.norm(t1, axis=1, keepdims=True)
        for rows in _chunks(len(points), 1000):
            p, n = points[rows], normals[rows]
            x = np.hstack([np.cross(p - self.centre_part, n), n]) * self.prior
            d = cdist(p @ self.scaling, self._scaled)
            k = s2 * matern(d) + x @ self.design.T
            sd[rows] = self._left(s2 + (x**2).sum(axis=1), k)
            q = s2 * matern_slope(d)
            for t in (t1[rows], np.cross(n, t1[rows])):
                turned = np.einsum("nij,nj->ni", shape[rows], t)
                # d/dt of n . (v + w x arm) = (W t) . (v + w x arm) + (n x w) . t
                dx = np.hstack([np.cross(p - self.centre_part, turned) + np.cross(t, n), turned]) * self.prior
                tu = t @ self.scaling
                along = (tu * (p @ self.scaling)).sum(axis=1)[:, None] - tu @ self._scaled.T
                own = 5.0 / 3.0 * s2 * (tu**2).sum(axis=1) + (dx**2).sum(axis=1)
                slope[rows] = np.maximum(slope[rows], self._left(own, -q * along + dx @ self.design.T))
        return sd, slope

    def _left(self, own: Array, k: Array) -> Array:
        half = solve_triangular(self.lower, k.T, lower=True, check_finite=False)
        return np.asarray(np.sqrt(np.maximum(own - (half**2).sum(axis=0), 0.0)))

    @cached_property
    def posterior_motion(self) -> Array:
        """The rigid part of the process (6,), rad and mm, axes of `part`: prior design' alpha."""
        return np.asarray(self.prior * (self.design.T @ self.alpha))


def tangential(v: Array, normals: Array) -> Array:
    """Return vectors (n, 3) without their component along the normals."""
    return np.asarray(v - np.einsum("ij,ij->i", v, normals)[:, None] * normals)


def _chunks(n: int, size: int = CHUNK) -> list[slice]:
    return [slice(i, min(i + size, n)) for i in range(0, n, size)]
