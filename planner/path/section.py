"""One line over the surface through given points: the cut by the plane of the points and their normals."""

from dataclasses import dataclass, replace

import numpy as np

from planner.errors import fail
from planner.frames import Array
from planner.path.isolines import Chains, Ints, isolines
from planner.path.mesh import PathMesh
from planner.path.tracks import Lengths, measure

# A key point this far from the line through it was not reached.
_REACH_MM = 1.0


@dataclass(frozen=True, eq=False)
class Stroke:
    """A stretch of one line, from s0 to s1 (mm along it, of `length`); the line ends at the boundary unless it is a loop."""

    line: Chains
    s0: float
    s1: float
    length: float
    loop: bool = False


def section(mesh: PathMesh, points: Array, normals: Array) -> list[Stroke]:
    """Return the line over the surface through points (n >= 2, 3) that lie in one plane with their mean normal.

    One stroke from the first to the last point; two where a hole or a gap lies between them, each up to its rim.
    Raises `EchoBaseError` where the line misses the points.
    """
    a, b = points[0], points[-1]
    side = _plane_through(points, normals)
    cut = isolines((mesh.vertices - a) @ side, mesh.faces, mesh.other, np.array([0.0]))
    if len(cut.level) == 0:
        raise fail("section-missing", "No line over the surface joins two key points.", "Move one of them.")
    lengths = measure(mesh, cut)
    ca, sa, da = _foot(lengths, a)
    cb, sb, db = _foot(lengths, b)
    if max(da, db) > _REACH_MM:
        raise fail("section-missing", "The line over the surface misses a key point.", "Move it, or add one between.")
    if ca == cb:
        middle = _foot(lengths, points[len(points) // 2])[1] if len(points) > 2 else None
        return [_stroke(lengths, ca, sa, sb, middle)]
    toward = float(np.sign((b - a) @ (_at_end(lengths, ca, True) - _at_end(lengths, ca, False))))
    out = []
    for chain, s, leaves in ((ca, sa, True), (cb, sb, False)):
        ahead = (toward >= 0) == leaves
        rim = lengths.total[chain] if ahead else 0.0
        if abs(rim - s) > 1.0:
            out.append(_stroke(lengths, chain, *((s, rim) if leaves else (rim, s))))
    return out


def whole_lines(mesh: PathMesh, side: Array, offsets: Array) -> list[Stroke]:
    """Return the longest line of each plane `side @ p = offset` that cuts the surface, over its whole length."""
    cut = isolines(mesh.vertices @ side, mesh.faces, mesh.other, offsets)
    if len(cut.level) == 0:
        return []
    lengths = measure(mesh, cut)
    out = []
    for level in np.unique(cut.level):
        chain = int(np.flatnonzero(cut.level == level)[lengths.total[cut.level == level].argmax()])
        out.append(_stroke(lengths, chain, 0.0, float(lengths.total[chain])))
    return out


def positions(mesh: PathMesh, line: Chains, s: Array) -> tuple[Array, Array, Ints]:
    """Return points (n, 3), barycentrics (n, 3) and faces (n,) at arc lengths s (n,), mm, of a line."""
    lengths = measure(mesh, line)
    at = lengths.start[0] + np.clip(s, 0.0, lengths.total[0])
    seg = np.minimum(np.searchsorted(lengths.end, at, side="left"), len(lengths.end) - 1)
    length = np.linalg.norm(lengths.b[seg] - lengths.a[seg], axis=1)
    t = np.clip(1.0 - np.divide(lengths.end[seg] - at, length, out=np.zeros_like(at), where=length > 0), 0.0, 1.0)[
        :, None
    ]
    bary = line.bary_in[seg] * (1.0 - t) + line.bary_out[seg] * t
    return lengths.a[seg] * (1.0 - t) + lengths.b[seg] * t, bary, line.face[seg]


def together(strokes: list[Stroke]) -> Chains:
    """Return the lines of all strokes as one set of chains, in order."""
    size = [len(s.line.face) for s in strokes]
    return Chains(
        np.concatenate([s.line.face for s in strokes]),
        np.concatenate([s.line.bary_in for s in strokes]),
        np.concatenate([s.line.bary_out for s in strokes]),
        np.repeat(np.arange(len(strokes)), size),
        np.arange(len(strokes)),
        np.zeros(len(strokes), dtype=bool),
    )


def _plane_through(points: Array, normals: Array) -> Array:
    """Return the normal (3,) of the plane through the first and the last point that holds the normals best."""
    d = points[-1] - points[0]
    length = float(np.linalg.norm(d))
    if length > 1e-9:
        d = d / length
        held = np.concatenate([normals, 10.0 / length * (points - points[0])])
        held = held - np.outer(held @ d, d)
        values, vectors = np.linalg.eigh(held.T @ held)
        # The eigenvector of the largest value is the common upward direction square to the chord.
        if values[2] > 1e-6:
            side = np.cross(d, vectors[:, 2])
            return np.asarray(side / np.linalg.norm(side))
    raise fail("section-degenerate", "Two key points lie above one another along the normal.", "Move one of them.")


def _foot(lengths: Lengths, p: Array) -> tuple[int, float, float]:
    """Return the chain nearest to a point, the arc length there and the distance."""
    d = lengths.b - lengths.a
    t = np.clip(np.einsum("ij,ij->i", p - lengths.a, d) / np.maximum(np.einsum("ij,ij->i", d, d), 1e-300), 0.0, 1.0)
    away = np.linalg.norm(p - lengths.a - t[:, None] * d, axis=1)
    seg = int(away.argmin())
    chain = int(lengths.chains.chain[seg])
    s = lengths.end[seg] - (1.0 - t[seg]) * np.linalg.norm(d[seg]) - lengths.start[chain]
    return chain, float(s), float(away[seg])


def _at_end(lengths: Lengths, chain: int, last: bool) -> Array:
    rows = np.flatnonzero(lengths.chains.chain == chain)
    return lengths.b[rows[-1]] if last else lengths.a[rows[0]]


def _stroke(lengths: Lengths, chain: int, s0: float, s1: float, middle: float | None = None) -> Stroke:
    """Return the stretch of a chain from s0 to s1 as a line walked forwards; of a loop, the way over `middle`, or the
    shorter one."""
    rows = np.flatnonzero(lengths.chains.chain == chain)
    c, total = lengths.chains, float(lengths.total[chain])
    line = Chains(
        c.face[rows],
        c.bary_in[rows],
        c.bary_out[rows],
        np.zeros(len(rows), dtype=np.int64),
        np.zeros(1, dtype=np.int64),
        np.zeros(1, dtype=bool),
    )
    closed = bool(c.closed[chain])
    around = s0 == 0.0 and s1 == total
    if closed and not around:
        onward = float(np.mod(s1 - s0, total))
        turn = onward > total / 2.0 if middle is None else float(np.mod(middle - s0, total)) > onward
    else:
        turn = s0 > s1
    if turn:
        line = replace(line, face=line.face[::-1], bary_in=line.bary_out[::-1], bary_out=line.bary_in[::-1])
        s0, s1 = total - s0, total - s1
    if not closed:
        return Stroke(line, s0, s1, total)
    if around:
        return Stroke(line, 0.0, total, total, loop=True)
    length = np.linalg.norm(lengths.b[rows] - lengths.a[rows], axis=1)
    return _opened(line, length[::-1] if turn else length, s0, float(np.mod(s1 - s0, total)))


def _opened(line: Chains, length: Array, s0: float, span: float) -> Stroke:
    """Return a loop opened opposite the stretch of `span` mm from s0 on; length (m,): of its segments."""
    ends = np.cumsum(length)
    total = float(ends[-1])
    opening = float(np.mod(s0 + span / 2.0 + total / 2.0, total))
    cut = min(int(np.searchsorted(ends, opening)), len(ends) - 1)
    before = float(ends[cut - 1]) if cut else 0.0
    line = replace(
        line,
        face=np.roll(line.face, -cut),
        bary_in=np.roll(line.bary_in, -cut, axis=0),
        bary_out=np.roll(line.bary_out, -cut, axis=0),
    )
    start = float(np.mod(s0 - before, total))
    return Stroke(line, start, min(start + span, total), total, loop=True)
