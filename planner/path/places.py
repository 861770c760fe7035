"""Where on their strips suggested key points stand: useful ones, away from each other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.path.ends import EDGE_REACH_MM
from planner.path.mesh import PathMesh
from planner.path.section import Stroke, positions
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.keepouts import keep_outs_of

ALONG_INSET = 1.2
# Key points nearer than this many search radii share readings; from the second figure on they share none.
APART, WELL_APART = 1.05, 2.0
# Room to the edge in search radii, a little more than the verdict asks.
EDGE_ROOM = 1.02
_FINE_MM, _FEWEST, _MOST = 1.0, 81, 401
# How far from where it should be an inner end may stand, as a share of the strip.
_WINDOW = 0.15


@dataclass(frozen=True, eq=False)
class Strip:
    """A stretch s0..s1 of a line over the surface; free: which ends (first, last) go on to the boundary; inset: how many
    search radii its points keep from there."""

    stroke: Stroke
    s0: float
    s1: float
    free: tuple[bool, bool]
    inset: float = ALONG_INSET


def too_curved(bend: Array, setup: Setup) -> NDArray[np.bool_]:
    """Return where a surface of curvature bend (n,), 1/mm, is no plane within the search radius r.

    Such a plane lies bend r^2 / 4 off on average, and its rim is turned by bend r.
    """
    radius = setup.alignment.search_radius_mm
    turned = np.cos(np.minimum(bend * radius, np.pi)) < setup.alignment.min_normal_dot
    return np.asarray((bend * radius**2 / 4.0 > setup.tolerances.position_mm) | turned)


def flat_radius_mm(bend: float, setup: Setup) -> float:
    """Return the largest search radius (mm) within which a surface of curvature bend, 1/mm, is a plane."""
    tolerance, dot = setup.tolerances.position_mm, setup.alignment.min_normal_dot
    return float(min(np.sqrt(4.0 * tolerance / bend), np.arccos(dot) / bend)) if bend > 0.0 else float("inf")


def places(curved: CurvedSurface, mesh: PathMesh, strips: list[Strip], each: int, setup: Setup) -> list[Array]:
    """Return the key points (k, 3) of strips that are worth having: two to `each` a strip, in order along it.

    They keep their search radius from edges, avoid curved places, never stand in a keep-out, and stand two search radii
    from each other if they can. Strips that cannot have two points on flat places without sharing readings are left out, unless
    so little would be left that no placement could be found; where most of the surface is curved, points are.
    """
    taken = np.zeros((0, 3))
    good: list[Array] = []
    poor: list[Array] = []
    rest: list[Strip] = []
    for strip in strips:
        chosen, sound, flat = _on_strip(curved, mesh, strip, each, taken, setup)
        if sound and flat:
            good.append(chosen)
            taken = np.concatenate([taken, chosen])
        elif len(chosen):
            rest.append(strip)
    mostly_curved = len(good) < max(2, len(rest))
    for strip in rest:
        chosen, sound, _ = _on_strip(curved, mesh, strip, each, taken, setup)
        if sound and mostly_curved:
            good.append(chosen)
            taken = np.concatenate([taken, chosen])
        elif len(chosen):
            poor.append(chosen)
    for chosen in poor[: max(2 - len(good), 0)]:
        gap = _gap(chosen, taken)
        apart = chosen[gap >= APART * setup.alignment.search_radius_mm]
        good.append(apart if len(apart) else chosen[[int(gap.argmax())]])
        taken = np.concatenate([taken, good[-1]])
    return good


def _on_strip(
    curved: CurvedSurface, mesh: PathMesh, strip: Strip, each: int, taken: Array, setup: Setup
) -> tuple[Array, bool, bool]:
    """Return the points of one strip (k, 3), none if two find no place; whether they keep off edges and share no readings;
    and whether all stand on flat places."""
    radius, span = setup.alignment.search_radius_mm, strip.s1 - strip.s0
    fine = np.linspace(strip.s0, strip.s1, int(np.clip(span / _FINE_MM, _FEWEST, _MOST)))
    on_line, bary, face = positions(mesh, strip.stroke.line, fine)
    points, _ = curved.evaluate(face.astype(np.int32), bary)
    room = keep_outs_of(curved.surface, setup).room_mm(on_line)
    edge = np.minimum(mesh.boundary_distance(points, EDGE_ROOM * radius), EDGE_ROOM * radius) / radius
    bend = np.abs(np.linalg.eigvalsh(curved.shape_operator(face.astype(np.int32), bary))).max(axis=1)
    allowed = room >= 0.0
    # What speaks against a place whatever else is chosen: near an edge or a keep-out, curved.
    against = 100.0 * (EDGE_ROOM - edge) + 30.0 * (room < radius)
    bent = too_curved(bend, setup)
    against += bent * (20.0 + 10.0 * bend / max(float(bend.max()), 1e-12))
    off = min(strip.inset * radius, max(0.45 * span, span - APART * radius))
    a = strip.s0 + (off if strip.free[0] else 0.0)
    b = strip.s1 - (off if strip.free[1] else 0.0)
    reach = max(0.95 * min(EDGE_REACH_MM, strip.stroke.length / 3.0), off)
    first = (strip.s0, min(strip.s0 + reach, strip.s0 + 0.6 * span)) if strip.free[0] else (a, a + _WINDOW * span)
    last = (max(strip.s1 - reach, strip.s1 - 0.6 * span), strip.s1) if strip.free[1] else (b - _WINDOW * span, b)
    count = int(np.clip(1 + (b - a) // (WELL_APART * radius), 2, each))
    inner = np.linspace(a, b, count)[1:-1]
    half = 0.4 * (b - a) / max(count - 1, 1)
    wants = [(a, first, True), (b, last, True), *((w, (w - half, w + half), False) for w in inner)]
    picked: list[int] = []
    sound = True
    for want, (low, high), needed in wants:
        near = np.flatnonzero(allowed & (fine >= low - 1e-9) & (fine <= high + 1e-9))
        if not len(near):
            if needed:
                return np.zeros((0, 3)), False, False
            continue
        gap = _gap(points[near], np.concatenate([taken, points[picked]])) / radius
        cost = against[near] + 100.0 * np.maximum(APART - gap, 0.0) + 15.0 * np.maximum(WELL_APART - gap, 0.0)
        cost += 4.0 * np.abs(fine[near] - want) / max(span, 1e-9)
        k = int(cost.argmin())
        if not needed and (gap[k] < WELL_APART or against[near[k]] >= 1.0):
            continue
        sound &= bool(gap[k] >= APART and edge[near[k]] >= 1.0)
        picked.append(int(near[k]))
    return points[sorted(picked)], sound, not bent[picked].any()


def _gap(points: Array, others: Array) -> Array:
    """Return how far each point (n, 3) is from the nearest of the others (m, 3), mm; infinite without any."""
    if not len(others):
        return np.full(len(points), np.inf)
    return np.asarray(np.linalg.norm(points[:, None] - others[None], axis=2).min(axis=1))
