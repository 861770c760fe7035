"""Edges worth crossing: where the part ends beside the surface, and what each crossing tells about the part's place."""

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planner.frames import Array
from planner.path.passes import LEAD_MM
from planner.setup import Setup
from planner.surface.boundary import EdgeKind, boundary
from planner.surface.inspection import InspectionSurface
from planner.surface.keepouts import keep_outs_of

# What one reading of an edge, and one patch of surface, is worth (mm, one sigma); only their ratio to the fixture counts.
EDGE_SIGMA_MM = 0.05
PATCH_SIGMA_MM = 0.05
PATCH_MM = 10.0
_SETTLED = 0.15


@dataclass(frozen=True, eq=False)
class Rim:
    """Points along the boundary: points, outward conormals, edge directions (n, 3), in `part`; open (n,): the part ends
    there."""

    points: Array
    conormals: Array
    along: Array
    open: NDArray[np.bool_]


def usable_rim(surface: InspectionSurface, spacing_mm: float, setup: Setup) -> Rim:
    """Return the rim as this setup may cross it: not under a keep-out, nor where the nozzle or its overrun would meet one."""
    whole, keep = rim(surface, spacing_mm), keep_outs_of(surface, setup)
    if not len(keep) or not len(whole.points):
        return whole
    free = keep.room_mm(whole.points, LEAD_MM + setup.alignment.edge_overrun_mm) >= 0.0
    return replace(whole, open=whole.open & free)


def rim(surface: InspectionSurface, spacing_mm: float) -> Rim:
    """Return the middles of pieces of the boundary at most `spacing_mm` long; kept as long as the surface lives."""
    known = _KNOWN.setdefault(surface, {})
    if spacing_mm not in known:
        known[spacing_mm] = _rim(surface, spacing_mm)
    return known[spacing_mm]


_KNOWN: WeakKeyDictionary[InspectionSurface, dict[float, Rim]] = WeakKeyDictionary()


def _rim(surface: InspectionSurface, spacing_mm: float) -> Rim:
    points, conormals, along, open_ = [], [], [], []
    for curve in boundary(surface):
        ahead = np.roll(curve.points, -1, axis=0) - curve.points
        pieces = np.maximum(np.ceil(np.linalg.norm(ahead, axis=1) / spacing_mm), 1.0).astype(np.int64)
        i = np.repeat(np.arange(len(curve)), pieces)
        rank = np.arange(len(i)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        points.append(curve.points[i] + ahead[i] * ((rank + 0.5) / pieces[i])[:, None])
        conormals.append(curve.segment_conormals[i])
        along.append(ahead[i] / np.maximum(np.linalg.norm(ahead[i], axis=1, keepdims=True), 1e-12))
        open_.append(curve.kind[i] != EdgeKind.CONCAVE)
    if not points:
        return Rim(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=bool))
    return Rim(np.concatenate(points), np.concatenate(conormals), np.concatenate(along), np.concatenate(open_))


def rows(points: Array, directions: Array, centre: Array) -> Array:
    """Return the derivative (n, 6) of the distance along `directions` at `points` to a small motion about `centre`.

    Order (rx, ry, rz, x, y, z), rad and mm.
    """
    return np.concatenate([np.cross(points - centre, directions), directions], axis=1)


def prior_precision(setup: Setup) -> Array:
    """Return the precision (6, 6) of the fixture, about the centroid: equal deviations per axis, whatever the axes."""
    sigma = np.array([np.radians(setup.fixture.sigma_deg)] * 3 + [setup.fixture.sigma_mm] * 3)
    return np.diag(1.0 / sigma**2)


def edge_rows(points: Array, conormals: Array, along: Array, centre: Array, setup: Setup) -> Array:
    """Return rows (n, 3, 6), in units of one sigma, of n crossings: the edge seen by the middle and both sides of the array."""
    shift = setup.probe.swath_mm / 3.0 * np.array([-1.0, 0.0, 1.0])
    at = (points[:, None, :] + shift[:, None] * along[:, None, :]).reshape(-1, 3)
    return rows(at, np.repeat(conormals, 3, axis=0), centre).reshape(-1, 3, 6) / EDGE_SIGMA_MM


def _off_corners(rim_: Rim, free: NDArray[np.intp], room: float) -> NDArray[np.bool_]:
    """Return which of the points `free` leave room for the array beside them; if none does, those with the most."""
    p, c = rim_.points, rim_.conormals
    distance = np.full(len(free), np.inf)
    near = cKDTree(p).query_ball_point(p[free], room)
    for i, members in enumerate(near):
        other = np.array(members)[(c[members] @ c[free[i]]) < 0.8]
        if len(other):
            distance[i] = np.linalg.norm(p[other] - p[free[i]], axis=1).min()
    return np.asarray(distance >= min(room, 0.95 * float(distance.max())))


def best_crossings(
    rim_: Rim, crossed: Array, precision: Array, directions: Array, centre: Array, setup: Setup, most: int = 8
) -> list[int]:
    """Return the points of the rim to cross besides those crossed already (k, 3, conormals), best first.

    One for each of the `directions` (4, 3) in which the part has an end and nothing crosses it yet; then more while some
    direction of motion stays at more than `_SETTLED` of the fixture's prior. precision (6, 6): prior plus all that the path
    measures without them. Each is the one that shrinks the posterior, whitened by the prior, the most (A-optimal).
    """
    free = np.flatnonzero(rim_.open)
    if not len(free):
        return []
    free = free[_off_corners(rim_, free, 0.6 * setup.probe.swath_mm)]
    whiten = np.diag(1.0 / np.sqrt(np.diag(prior_precision(setup))))
    blocks = (
        whiten
        @ np.einsum(
            "nki,nkj->nij", *(2 * [edge_rows(rim_.points[free], rim_.conormals[free], rim_.along[free], centre, setup)])
        )
        @ whiten
    )
    current = whiten @ precision @ whiten
    seen = list(crossed)
    chosen: list[int] = []
    wanted = [d for d in directions if not any(float(c @ d) > 0.7 for c in seen)]
    while len(chosen) < most:
        wanted = [d for d in wanted if not any(float(c @ d) > 0.7 for c in seen)]
        faces = [d for d in wanted if bool((rim_.conormals[free] @ d > 0.7).any())]
        settled = float(np.linalg.eigvalsh(np.linalg.inv(current)).max()) < _SETTLED**2
        if not faces and settled:
            break
        cost = np.trace(np.linalg.inv(current + blocks), axis1=1, axis2=2)
        allowed = rim_.conormals[free] @ faces[0] > 0.7 if faces else np.ones(len(free), dtype=bool)
        allowed[[i for i in range(len(free)) if int(free[i]) in chosen]] = False
        if not allowed.any() or (not faces and cost[allowed].min() > 0.95 * float(np.trace(np.linalg.inv(current)))):
            break
        best = int(np.flatnonzero(allowed)[cost[allowed].argmin()])
        chosen.append(int(free[best]))
        seen.append(rim_.conormals[free[best]])
        current = current + blocks[best]
    return chosen
