"""Crossings matched to the CAD edges: in-surface distances, and how they change as the part moves."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from alignment.estimate.edge_points import EdgePoints
from alignment.estimate.motion import motion_rows
from planner.frames import Array, Transform
from planner.surface.boundary import BoundaryCurve, EdgeKind
from planner.surface.curved import CurvedSurface

# A crossing leaves the part about where the edge does, or it is another edge.
LEAST_COS = 0.5
# Where the rim turns by more than this within a beam, half the beam on the part does not mean its middle over the edge.
MOST_TURN = np.radians(30.0)
# How far off its edge a crossing may be at first (mm): the capture range, and a little for the turn.
CAPTURE_MM = 13.0


@dataclass(frozen=True, eq=False)
class EdgeRows:
    """r (k,): the edge's distance beyond the crossing, mm, in the surface and across the edge. jacobian (k, 6): dr / dxi.

    lag (k,): share of the travel across the edge. cosine (k,): of the step across it. valid (k,).
    point_base (k, 3): on the placed edge. segment (k,). height_mm (k,): of the law over the surface.
    """

    r: Array
    jacobian: Array
    lag: Array
    cosine: Array
    valid: NDArray[np.bool_]
    point_base: Array
    segment: NDArray[np.int64]
    height_mm: Array


class EdgeMap:
    """The edges where the part ends as the probe sees it (free, or falling away): segments in `part`, mm."""

    def __init__(self, curves: Sequence[BoundaryCurve], beam_width_mm: float = 0.0) -> None:
        """beam_width_mm: crossings nearer than this to where the rim turns within a beam say nothing; 0: all do."""
        kind = [c.kind != EdgeKind.CONCAVE for c in curves]
        ends = [(c.points[k], np.roll(c.points, -1, axis=0)[k]) for c, k in zip(curves, kind, strict=True)]
        join = lambda parts: np.concatenate(parts) if parts else np.zeros((0, 3))  # noqa: E731
        self.start, self.end = join([a for a, _ in ends]), join([b for _, b in ends])
        self.conormal = join([c.segment_conormals[k] for c, k in zip(curves, kind, strict=True)])
        self._beam_width_mm = beam_width_mm
        corners = join([_corners(c, beam_width_mm) for c in curves]) if beam_width_mm > 0 else np.zeros((0, 3))
        self._corners = cKDTree(corners) if len(corners) else None

    def near_corner(self, points_part: Array) -> NDArray[np.bool_]:
        """Return which points (k, 3) on the edges are so near a corner that a beam there sees both its sides."""
        if self._corners is None:
            return np.zeros(len(points_part), dtype=bool)
        distance, _ = self._corners.query(points_part, distance_upper_bound=self._beam_width_mm)
        return np.asarray(np.isfinite(distance))

    def __len__(self) -> int:
        return len(self.start)

    @cached_property
    def _mesh(self) -> tuple[Array, NDArray[np.int64]]:
        n = len(self.start)
        rows = np.arange(n, dtype=np.int64)
        return np.concatenate([self.start, self.end]), np.column_stack([rows, rows + n])

    def nearest(self, points_part: Array) -> tuple[NDArray[np.int64], Array]:
        """Return the nearest segment (k,) and the point on it (k, 3)."""
        vertices, segments = self._mesh
        query = np.ascontiguousarray(points_part)
        _, index, point = igl.point_mesh_squared_distance(query, vertices, segments)
        return np.asarray(index).reshape(-1).astype(np.int64), np.asarray(point).reshape(-1, 3)


def _corners(curve: BoundaryCurve, beam_width_mm: float) -> Array:
    """Return the points (q, 3) of a curve about which, within half a beam either way, it turns by more than `MOST_TURN`."""
    after = curve.segment_conormals
    cosine = np.einsum("ij,ij->i", np.roll(after, 1, axis=0), after)
    turn = np.arccos(np.clip(cosine, -1.0, 1.0))
    length = np.linalg.norm(np.roll(curve.points, -1, axis=0) - curve.points, axis=1)
    n, total = len(curve), length.sum()
    s = np.concatenate([[0.0], np.cumsum(length)[:-1]])
    # Thrice around, so that windows may pass the first point.
    around = np.concatenate([s - total, s, s + total])
    turned = np.concatenate([[0.0], np.cumsum(np.tile(turn, 3))])
    first = np.searchsorted(around, s - 0.5 * beam_width_mm, side="left")
    last = np.searchsorted(around, s + 0.5 * beam_width_mm, side="right")
    within = turned[last] - turned[first]
    return np.asarray(curve.points[within[:n] > MOST_TURN])


def edge_rows(
    points: EdgePoints, edges: EdgeMap, curved: CurvedSurface, T_base_part: Transform, centre_mm: Array
) -> EdgeRows:
    """Return the residuals of crossings: conormal . (edge - foot of the crossing).

    The foot is taken on the surface, continued flat past its rim. The edge's own motion along the conormal is what a
    motion of the part changes, to first order.
    """
    T_part_base = T_base_part.inv()
    origin, outward = T_part_base.points(points.origins_base), T_part_base.directions(points.outward_base)
    near = curved.closest(origin)
    height = np.einsum("ij,ij->i", origin - near.points, near.normals)
    foot = origin - height[:, None] * near.normals
    segment, point = edges.nearest(foot)
    conormal = edges.conormal[segment]
    off = foot - point
    e = np.einsum("ij,ij->i", off, conormal)
    aside = np.linalg.norm(off - e[:, None] * conormal, axis=1)
    leaves = np.einsum("ij,ij->i", outward, conormal)
    valid = (leaves > LEAST_COS) & (np.abs(e) < CAPTURE_MM) & (aside < 0.5 * np.abs(e) + 1.0)
    valid &= ~edges.near_corner(point)
    point_base, b = T_base_part.points(point), T_base_part.directions(conormal)
    lag = np.einsum("ij,ij->i", points.travel_base, b)
    return EdgeRows(-e, motion_rows(point_base, b, centre_mm), lag, leaves, valid, point_base, segment, height)
