"""Chains of a cut, resampled at equal spacing; every point stays tied to its triangle."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.path.fence import Fence
from planner.path.isolines import Chains, Ints
from planner.path.mesh import PathMesh
from planner.surface.normals import lengths as row_lengths

_HALVINGS = 20


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
class Lengths:
    """Chains with their arc length: start (c,) and total (c,) of each chain on one running axis, end (m,) of segments."""

    chains: Chains
    a: Array
    b: Array
    end: Array
    start: Array
    total: Array


def tracks(mesh: PathMesh, chains: Chains, spacing_mm: float, fence: Fence) -> Tracks:
    """Resample chains at equal spacing (at most `spacing_mm`), kept inside a fence.

    Each pass begins and ends at the first place where the fence lets it. Between its ends a track may come nearer, as one
    that passes a hole sideways does, but where the fence forbids it is cut in two. Loops that are nowhere cut keep
    their whole length and end where they began.
    """
    lengths = measure(mesh, chains)
    which = np.arange(len(chains.level))
    s0, s1, closed = np.zeros(len(which)), lengths.total.copy(), chains.closed
    if not fence.is_open:
        which, s0, s1, closed = within(lengths, which, s0, s1, min(spacing_mm, fence.finest_mm / 2.0), fence)
    keep = s1 - s0 >= spacing_mm * (1.0 - 1e-9)
    return resample(lengths, which[keep], s0[keep], s1[keep], closed[keep], spacing_mm)


def measure(mesh: PathMesh, chains: Chains) -> Lengths:
    """Return the chains with their segments' ends in space and their arc lengths."""
    corner = mesh.vertices[mesh.faces[chains.face]]
    a, b = (np.einsum("mk,mkj->mj", x, corner) for x in (chains.bary_in, chains.bary_out))
    length = row_lengths(b - a)
    end = np.cumsum(length)
    head = np.searchsorted(chains.chain, np.arange(len(chains.level)))
    tail = np.searchsorted(chains.chain, np.arange(len(chains.level)), side="right") - 1
    start = end[head] - length[head]
    return Lengths(chains, a, b, end, start, end[tail] - start)


def resample(
    lengths: Lengths, which: Ints, s0: Array, s1: Array, closed: NDArray[np.bool_], spacing_mm: float
) -> Tracks:
    """Return equally spaced points on the intervals s0..s1 (k,), mm, of the chains `which` (k,)."""
    chains = lengths.chains
    pieces = np.maximum(np.ceil((s1 - s0) / spacing_mm - 1e-9), 1.0).astype(np.int64)
    run = np.repeat(np.arange(len(which)), pieces + 1)
    rank = np.arange(len(run)) - np.repeat(np.cumsum(pieces + 1) - (pieces + 1), pieces + 1)
    chain = which[run]
    s = lengths.start[chain] + s0[run] + (s1 - s0)[run] * rank / pieces[run]
    numbers = np.arange(len(chains.level))
    head = np.searchsorted(chains.chain, numbers)
    tail = np.searchsorted(chains.chain, numbers, side="right") - 1
    seg = np.clip(np.searchsorted(lengths.end, s, side="left"), head[chain], tail[chain])
    length = row_lengths(lengths.b[seg] - lengths.a[seg])
    t = np.clip(1.0 - np.divide(lengths.end[seg] - s, length, out=np.zeros_like(s), where=length > 0), 0.0, 1.0)[
        :, None
    ]
    bary = chains.bary_in[seg] * (1.0 - t) + chains.bary_out[seg] * t
    points = lengths.a[seg] * (1.0 - t) + lengths.b[seg] * t
    return Tracks(chains.face[seg].astype(np.int32), bary, points, run.astype(np.int64), chains.level[which], closed)


def within(
    lengths: Lengths, which: Ints, start: Array, stop: Array, spacing: float, fence: Fence
) -> tuple[Ints, Array, Array, NDArray[np.bool_]]:
    """Return what of the intervals start..stop (k,), mm, of the chains `which` (k,) lies inside a fence.

    Chain, from, to (mm), and whether it is a whole loop, (j,) each. Tested every `spacing` mm, ends found by halving.
    """
    chains = lengths.chains
    whole_chain = chains.closed[which] & (start <= 0.0) & (stop >= lengths.total[which])
    probe = resample(lengths, which, start, stop, whole_chain, spacing)
    inside, allowed = fence.tests(probe.points)
    first, last = probe.bounds()
    step = ((stop - start) / np.maximum(last - first, 1))[probe.run]
    loop = whole_chain & np.logical_and.reduceat(allowed, first)
    new = np.concatenate([[True], np.diff(probe.run) > 0])
    begins = new | np.concatenate([[False], allowed[1:] & ~allowed[:-1]])
    piece = np.cumsum(begins) - 1
    n, pieces = len(inside), int(piece[-1]) + 1
    good = np.flatnonzero(inside & allowed)
    low, high = np.full(pieces, n, dtype=np.int64), np.full(pieces, -1, dtype=np.int64)
    np.minimum.at(low, piece[good], good)
    np.maximum.at(high, piece[good], good)
    # A piece runs on to the end of its chain after it has come too near: cut it at the last allowed sample.
    has = high >= 0
    low, high = low[has], high[has]
    run = probe.run[low]
    chain, base = which[run], start[run]
    before, after = np.maximum(low - 1, first[run]), np.minimum(high + 1, last[run])
    spans = step[low]

    def at(row: Ints) -> Array:
        return np.asarray(base + (row - first[run]) * spans)

    s0 = _turning(lengths, chain, at(before), at(low), fence)
    s1 = _turning(lengths, chain, at(after), at(high), fence)
    is_loop = loop[run]
    return chain, np.where(is_loop, 0.0, s0), np.where(is_loop, lengths.total[chain], s1), is_loop


def _turning(lengths: Lengths, chain: Ints, outside: Array, inside: Array, fence: Fence) -> Array:
    """Return where on the chains the fence stands between two places (mm), by halving; `inside` lies within."""
    outside, inside = outside.copy(), inside.copy()
    # Where a chain ends inside the fence there is nothing to seek.
    moving = np.flatnonzero(outside != inside)
    for _ in range(_HALVINGS):
        middle = 0.5 * (outside[moving] + inside[moving])
        kept = fence.may_end(_points_at(lengths, chain[moving], middle))
        inside[moving] = np.where(kept, middle, inside[moving])
        outside[moving] = np.where(kept, outside[moving], middle)
    return inside


def _points_at(lengths: Lengths, chain: Ints, s: Array) -> Array:
    at = lengths.start[chain] + s
    numbers = np.arange(len(lengths.chains.level))
    head = np.searchsorted(lengths.chains.chain, numbers)
    tail = np.searchsorted(lengths.chains.chain, numbers, side="right") - 1
    seg = np.clip(np.searchsorted(lengths.end, at, side="left"), head[chain], tail[chain])
    d = lengths.b[seg] - lengths.a[seg]
    length = np.linalg.norm(d, axis=1)
    back = np.divide(lengths.end[seg] - at, length, out=np.zeros_like(at), where=length > 0)
    return lengths.b[seg] - np.clip(back, 0.0, 1.0)[:, None] * d


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
