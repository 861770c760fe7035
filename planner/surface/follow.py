"""Feet of the same points again and again while the surface moves under them a little: where they were is where to start."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.surface.closest import Foot
from planner.surface.curved import CurvedSurface

# A foot is followed where the surface around it turns by less than 25 deg and is farther from its centre of curvature than
# from the point, by half: there the foot on these triangles is the only one.
LEAST_COSINE = 0.9
LEAST_STRETCH = 0.5


class Follower:
    """Remembers the feet of n points; `closest` gives what `CurvedSurface.closest` gives, to its own tolerance.

    A foot is followed only while its point stays within the margin in which the nearest triangle is known to lie among
    those already looked at (`planner.surface.nearest`); elsewhere the whole surface is asked again. loose: feet are
    found from the nearest vertex and followed however far they go; for searches whose end is looked at anew.
    """

    def __init__(self, curved: CurvedSurface, loose: bool = False) -> None:
        self.curved, self.loose = curved, loose
        self._known: dict[str, Any] | None = None

    def closest(self, points_part: Array) -> Foot:
        """Return the feet of points (n, 3), `part`, mm; the same n points each time, moved."""
        query = np.ascontiguousarray(points_part, dtype=np.float64).reshape(-1, 3)
        if not self.curved.triangles.is_fine:
            return self.curved.closest(query)
        known = self._known
        if known is None or len(known["at"]) != len(query):
            return self._asked(query)
        moved = np.linalg.norm(query - known["at"], axis=1)
        follow = np.flatnonzero(moved < known["margin_mm"])
        if 2 * len(follow) < len(query):
            return self._asked(query)
        face, bary = known["face"], known["bary"]
        foot, settled = self.curved.foot_from(query[follow], face[follow], bary[follow])
        good = settled & foot.interior
        follow = follow[good]
        rest = np.ones(len(query), dtype=bool)
        rest[follow] = False
        ask = np.flatnonzero(rest)
        if not len(ask):
            self._keep(follow, foot)
            return foot
        # Few are left: each of them keeps its own anchor.
        merged = _joined(len(query), follow, _taken(foot, good), ask, self._refreshed(query, ask))
        self._keep(np.arange(len(query)), merged)
        return merged

    def _keep(self, rows: NDArray, foot: Foot) -> None:
        assert self._known is not None
        self._known["face"][rows], self._known["bary"][rows] = foot.face, foot.bary

    def _asked(self, query: Array) -> Foot:
        n = len(query)
        self._known = {
            "at": query.copy(),
            "margin_mm": np.zeros(n),
            "face": np.zeros(n, dtype=np.int32),
            "bary": np.zeros((n, 3)),
        }
        foot = self._refreshed(query, np.arange(n))
        self._keep(np.arange(n), foot)
        return foot

    def _refreshed(self, query: Array, rows: NDArray) -> Foot:
        """Return the feet of some points from the whole surface, and remember how far they may be followed."""
        curved, asked = self.curved, query[rows]
        near = curved.triangles.about(asked) if self.loose else curved.triangles.nearest(asked)
        foot, settled = curved.foot_from(asked, near.face, near.bary)
        assert self._known is not None
        sole = settled & foot.interior
        if near.around.shape[1]:
            normals = curved.vertex_fit.normals
            for vertex in near.around.T:
                sole &= np.einsum("ij,ij->i", normals[vertex], foot.normals) > LEAST_COSINE
            bend = curved.shape_operator(foot.face, foot.bary)
            half = 0.5 * np.einsum("nii->n", bend)
            spread = np.sqrt(np.maximum(0.5 * np.einsum("nij,nij->n", bend, bend) - half**2, 0.0))
            stretch = 1.0 + np.minimum(foot.distance_mm * (half - spread), foot.distance_mm * (half + spread))
            sole &= stretch > LEAST_STRETCH
        self._known["at"][rows] = asked
        self._known["margin_mm"][rows] = np.where(sole, np.inf if self.loose else near.margin_mm, 0.0)
        return foot


def _taken(foot: Foot, rows: NDArray) -> Foot:
    return Foot(
        foot.points[rows], foot.normals[rows], foot.distance_mm[rows], foot.face[rows], foot.bary[rows],
        foot.interior[rows],
    )  # fmt: skip


def _joined(n: int, rows: NDArray, foot: Foot, others: NDArray, other: Foot) -> Foot:
    """Return the feet of n points from those of some and of the others."""

    def join(a: NDArray, b: NDArray) -> Any:
        out = np.zeros((n, *a.shape[1:]), dtype=a.dtype)
        out[rows], out[others] = a, b
        return out

    return Foot(
        join(foot.points, other.points), join(foot.normals, other.normals), join(foot.distance_mm, other.distance_mm),
        join(foot.face, other.face), join(foot.bary, other.bary), join(foot.interior, other.interior),
    )  # fmt: skip
