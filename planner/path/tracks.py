"""Chains of a cut, resampled at equal spacing; every point stays tied to its triangle."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.path.isolines import Chains, Ints
from planner.path.mesh import PathMesh

# Shorter passes than this have no direction; what they would have covered is reported as missed.
_SHORTEST_MM = 0.5


@dataclass(frozen=True, eq=False)
class Tracks:
    """n points on the triangles in k runs, one after the other.

    face (n,), bary (n, 3): on the triangles of the surface. points (n, 3): there, mm. run (n,): 0..k-1, ascending.
    level (k,): index of the level each run belongs to. closed (k,): the last point of a closed run repeats its first.
    """

    face: NDArray[np.int32]
    bary: Array
    points: Array
    run: Ints
    level: Ints
    closed: NDArray[np.bool_]

    def bounds(self) -> tuple[Ints, Ints]:
        """Return the first and the last row of each run, (k,) each."""
        runs = np.arange(len(self.level))
        return np.searchsorted(self.run, runs), np.searchsorted(self.run, runs, side="right") - 1

    def arranged(self, order: Ints, flip: NDArray[np.bool_]) -> "Tracks":
        """Return the runs in another order, each walked backwards where `flip` (of the ordered runs) says so."""
        first, last = self.bounds()
        size = (last - first + 1)[order]
        run = np.repeat(np.arange(len(order)), size)
        rank = np.arange(len(run)) - np.repeat(np.cumsum(size) - size, size)
        row = np.where(flip[run], last[order][run] - rank, first[order][run] + rank)
        return Tracks(
            self.face[row],
            self.bary[row],
            self.points[row],
            run.astype(np.int64),
            self.level[order],
            self.closed[order],
        )


@dataclass(frozen=True, eq=False)
class _Lengths:
    """Chains with their arc length: start (c,) and total (c,) of each chain on one running axis, end (m,) of segments."""

    chains: Chains
    a: Array
    b: Array
    end: Array
    start: Array
    total: Array


def tracks(mesh: PathMesh, chains: Chains, spacing_mm: float, margin_mm: float) -> Tracks:
    """Resample chains at equal spacing (at most `spacing_mm`), their open ends cut back to the margin.

    Each open end is cut to the first place that is `margin_mm` away from the boundary of the surface; a track that
    passes a hole sideways is not cut there. Loops keep their whole length and end where they began.
    """
    lengths = _measure(mesh, chains)
    s0, s1 = np.zeros(len(chains.level)), lengths.total.copy()
    if margin_mm > 0.0 and len(mesh.boundary_edges):
        s0, s1 = _within_margin(mesh, lengths, min(spacing_mm, margin_mm / 2.0), margin_mm)
    keep = s1 - s0 >= min(_SHORTEST_MM, spacing_mm)
    return _resample(mesh, lengths, s0, s1, keep, spacing_mm)


def _measure(mesh: PathMesh, chains: Chains) -> _Lengths:
    corner = mesh.vertices[mesh.faces[chains.face]]
    a, b = (np.einsum("mk,mkj->mj", x, corner) for x in (chains.bary_in, chains.bary_out))
    length = np.linalg.norm(b - a, axis=1)
    end = np.cumsum(length)
    head = np.searchsorted(chains.chain, np.arange(len(chains.level)))
    tail = np.searchsorted(chains.chain, np.arange(len(chains.level)), side="right") - 1
    start = end[head] - length[head]
    return _Lengths(chains, a, b, end, start, end[tail] - start)


def _resample(
    mesh: PathMesh, lengths: _Lengths, s0: Array, s1: Array, keep: NDArray[np.bool_], spacing: float
) -> Tracks:
    chains = lengths.chains
    which = np.flatnonzero(keep)
    pieces = np.maximum(np.ceil((s1 - s0)[which] / spacing - 1e-9), 1.0).astype(np.int64)
    run = np.repeat(np.arange(len(which)), pieces + 1)
    rank = np.arange(len(run)) - np.repeat(np.cumsum(pieces + 1) - (pieces + 1), pieces + 1)
    chain = which[run]
    s = lengths.start[chain] + s0[chain] + (s1 - s0)[chain] * rank / pieces[run]
    head = np.searchsorted(chains.chain, np.arange(len(chains.level)))
    tail = np.searchsorted(chains.chain, np.arange(len(chains.level)), side="right") - 1
    seg = np.clip(np.searchsorted(lengths.end, s, side="left"), head[chain], tail[chain])
    length = np.linalg.norm(lengths.b[seg] - lengths.a[seg], axis=1)
    t = np.clip(1.0 - np.divide(lengths.end[seg] - s, length, out=np.zeros_like(s), where=length > 0), 0.0, 1.0)
    bary = chains.bary_in[seg] * (1.0 - t)[:, None] + chains.bary_out[seg] * t[:, None]
    points = lengths.a[seg] * (1.0 - t)[:, None] + lengths.b[seg] * t[:, None]
    return Tracks(
        chains.face[seg].astype(np.int32), bary, points, run.astype(np.int64), chains.level[which], chains.closed[which]
    )


def _within_margin(mesh: PathMesh, lengths: _Lengths, spacing: float, margin: float) -> tuple[Array, Array]:
    """Return where on each chain the margin is first and last kept, from its ends; an empty interval if it never is."""
    chains = lengths.chains
    everything = np.ones(len(chains.level), dtype=bool)
    probe = _resample(mesh, lengths, np.zeros_like(lengths.total), lengths.total, everything, spacing)
    distance = np.minimum(mesh.boundary_distance(probe.points, margin * 1.5), margin * 1.5)
    first, last = probe.bounds()
    step = lengths.total / np.maximum(last - first, 1)
    inside = distance >= margin
    rows = np.arange(len(inside))
    n = len(inside)
    low = np.full(len(step), n, dtype=np.int64)
    high = np.full(len(step), -1, dtype=np.int64)
    np.minimum.at(low, probe.run[inside], rows[inside])
    np.maximum.at(high, probe.run[inside], rows[inside])
    ok = high >= 0
    low, high = np.where(ok, low, first), np.where(ok, high, first)
    before, after = np.maximum(low - 1, first), np.minimum(high + 1, last)
    back = _fraction(distance[low], distance[before], margin)
    ahead = _fraction(distance[high], distance[after], margin)
    s0 = (low - first - back * (low - before)) * step
    s1 = (high - first + ahead * (after - high)) * step
    loop = chains.closed
    return np.where(loop, 0.0, s0), np.where(loop, lengths.total, np.where(ok, s1, s0 - 1.0))


def _fraction(inside: Array, outside: Array, margin: float) -> Array:
    """Return how far (0..1) from the inside sample towards the outside one the margin lies."""
    gap = inside - outside
    return np.clip(np.divide(inside - margin, gap, out=np.zeros_like(gap), where=gap > 0), 0.0, 1.0)


def split_at_turns(track: Tracks, sharp: NDArray[np.bool_]) -> Tracks:
    """Return the tracks with a new run beginning at every sharp point (which ends one run and begins the next)."""
    first, last = track.bounds()
    cut = np.flatnonzero(sharp)
    cut = cut[(cut > first[track.run[cut]]) & (cut < last[track.run[cut]])]
    if not len(cut):
        return track
    row = np.sort(np.concatenate([np.arange(len(track.run)), cut]))
    begins = np.zeros(len(row), dtype=bool)
    position = np.searchsorted(row, cut) + 1
    begins[position] = True
    old = track.run[row]
    begins |= np.concatenate([[True], np.diff(old) > 0])
    run = np.cumsum(begins) - 1
    parent = old[begins]
    whole = np.bincount(parent, minlength=len(track.level)) == 1
    return replace(
        track,
        face=track.face[row],
        bary=track.bary[row],
        points=track.points[row],
        run=run.astype(np.int64),
        level=track.level[parent],
        closed=track.closed[parent] & whole[parent],
    )
