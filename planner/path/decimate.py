"""The few poses a robot needs: within tolerance of the dense path whether it runs chords or a spline through them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.errors import fail
from planner.frames import Array
from planner.path.isolines import Ints
from planner.path.spline import chord_deviation, one_sign, spline_deviation
from planner.toolpath import Role, ToolPath

# Growth of the spacing along the path: (1 + g/2) / (1 - g/2) = 1.5 from one to the next leaves room for rounding.
_GROWTH = 0.4
_MARGIN = 0.95
_ROUNDS = 12
_BLOCK_ROLES = (Role.LEAD_IN, Role.DATA, Role.LEAD_OUT)


@dataclass(frozen=True, eq=False)
class Blocks:
    """The motion of all passes from lead-in to lead-out: row (m,) in the dense path, xyz (m, 3), wxyz (m, 4) of the TCP,
    s (m,) running arc length with a gap between blocks, block (m,), section (m,): changes at the ends of data."""

    row: Ints
    xyz: Array
    wxyz: Array
    s: Array
    block: Ints
    ends: NDArray[np.bool_]


def blocks_of(path: ToolPath) -> Blocks:
    """Return the blocks of a dense path."""
    row = np.flatnonzero(np.isin(path.role, [int(r) for r in _BLOCK_ROLES]))
    tcp = path.Ts_part_tcp[row]
    xyz = tcp.xyz_mm
    new = (
        np.concatenate([[True], (np.diff(path.pass_id[row]) != 0) | (np.diff(row) > 1)])
        if len(row)
        else np.zeros(0, bool)
    )
    step = np.concatenate([[0.0], np.linalg.norm(np.diff(xyz, axis=0), axis=1)]) if len(row) else np.zeros(0)
    step[new] = 1e3
    role = path.role[row]
    data = role == Role.DATA
    before = np.concatenate([[False], data[:-1]]) & ~new
    after = np.concatenate([data[1:], [False]]) & ~np.concatenate([new[1:], [True]])
    ends = new | np.concatenate([new[1:], [True]]) | (data & (~before | ~after))
    return Blocks(row, xyz, one_sign(tcp.wxyz), np.cumsum(step), np.cumsum(new) - 1, ends)


def decimate(
    path: ToolPath,
    chord_tol_mm: float = 0.05,
    angle_tol_deg: float = 0.1,
    max_spacing_mm: float = 15.0,
    max_ratio: float = 2.0,
) -> ToolPath:
    """Return the poses of a dense path that a robot program needs, in order.

    Both readings of the result stay within `chord_tol_mm` and `angle_tol_deg` of the dense path at the TCP, from lead-in to
    lead-out of each pass: straight chords with slerp, and a C2 chord-length spline (natural or not-a-knot). Neighbouring
    spacings differ by no more than `max_ratio` and none exceeds `max_spacing_mm`. Approach, retract, links, the ends of
    the leads and the first and last DATA pose of each pass are kept.
    """
    if not (chord_tol_mm > 0 and angle_tol_deg > 0 and max_spacing_mm > 0 and max_ratio >= 1.5):
        raise fail(
            "decimate-tolerance", "Tolerances must be positive and max_ratio at least 1.5.", "Correct the arguments."
        )
    b = blocks_of(path)
    keep = np.ones(len(path), dtype=bool)
    if len(b.row) == 0:
        return path
    tolerance = (_MARGIN * chord_tol_mm, _MARGIN * float(np.radians(angle_tol_deg)))
    knot = _first_choice(b, *tolerance, max_spacing_mm)
    for _ in range(_ROUNDS):
        knot = _graded(b, knot, max_spacing_mm, max_ratio)
        bad = _violated(b, knot, *tolerance)
        if not bad.any():
            break
        knot = np.union1d(knot, _middle(b, knot, np.flatnonzero(bad)))
    keep[b.row] = False
    keep[b.row[knot]] = True
    return path.take(keep)


def deviation(dense: ToolPath, sparse: ToolPath) -> tuple[float, float, float, float]:
    """Return the largest distance of a dense path from the chords and from the splines of a sparse one.

    (chord mm, chord deg, spline mm, spline deg) at the TCP, lead-in to lead-out; `sparse` holds poses of `dense`, in order.
    The spline figures are the larger of natural and not-a-knot ends. Raises ValueError if a pose is not from `dense`.
    """
    b = blocks_of(dense)
    knot = np.flatnonzero(_members(dense, sparse)[b.row])
    interval = _interval_of(b, knot)
    chord = chord_deviation(b.xyz, b.wxyz, knot, interval)
    curves = [spline_deviation(b.xyz, b.wxyz, b.s, knot, interval, b.block, e) for e in ("natural", "not-a-knot")]
    mm = [float(c[0].max(initial=0.0)) for c in (chord, *curves)]
    deg = [float(np.degrees(c[1].max(initial=0.0))) for c in (chord, *curves)]
    return mm[0], deg[0], max(mm[1:]), max(deg[1:])


def _members(dense: ToolPath, sparse: ToolPath) -> NDArray[np.bool_]:
    """Return which poses of the dense path the sparse one holds (n,)."""

    def key(p: ToolPath) -> Array:
        return np.column_stack([p.pass_id, p.role, p.standoff_mm, p.Ts_part_contact.xyz_mm])

    n = len(dense)
    _, name = np.unique(np.concatenate([key(dense), key(sparse)]), axis=0, return_inverse=True)
    name = name.ravel()
    # The k-th pose of a name stands for the k-th of the other path (the two ends of a loop share a place).
    rank = np.zeros(len(name), dtype=np.int64)
    for part in (slice(0, n), slice(n, None)):
        order = np.argsort(name[part], kind="stable")
        ordered = name[part][order]
        start = np.concatenate([[True], ordered[1:] != ordered[:-1]])
        rank[part][order] = np.arange(len(ordered)) - np.flatnonzero(start)[np.cumsum(start) - 1]
    member = np.zeros(n, dtype=bool)
    full = name * (int(rank.max()) + 1) + rank
    member = np.isin(full[:n], full[n:])
    if int(member.sum()) != len(sparse):
        raise ValueError("the sparse path holds poses that the dense path does not")
    return member


def _first_choice(b: Blocks, tol_mm: float, tol_rad: float, longest: float) -> Ints:
    """Return knots spaced by the local curvature and turn: sag = k h^2 / 8, as far as the growth allows."""
    h = _curvature_spacing(b, tol_mm, tol_rad, longest)
    forward = np.minimum.accumulate(h - _GROWTH * b.s) + _GROWTH * b.s
    h = np.minimum.accumulate((forward + _GROWTH * b.s)[::-1])[::-1] - _GROWTH * b.s
    step = np.diff(b.s)
    inside = np.diff(b.block) == 0
    count = np.where(inside, step * 0.5 * (1.0 / h[1:] + 1.0 / h[:-1]), 0.0)
    running = np.concatenate([[0.0], np.cumsum(count)])
    end = np.flatnonzero(b.ends)
    a, z = end[:-1], end[1:]
    same = b.block[a] == b.block[z]
    a, z = a[same], z[same]
    amount = running[z] - running[a]
    pieces = np.maximum(np.ceil(amount - 1e-6), 1.0).astype(np.int64)
    section = np.repeat(np.arange(len(a)), pieces)
    rank = np.arange(len(section)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    want = running[a][section] + amount[section] * rank / pieces[section]
    near = np.searchsorted(running, want, side="left")
    lower = np.maximum(near - 1, 0)
    near = np.where(np.abs(running[lower] - want) < np.abs(running[near] - want), lower, near)
    near = np.clip(near, a[section], z[section])
    return np.union1d(near, end)


def _curvature_spacing(b: Blocks, tol_mm: float, tol_rad: float, longest: float) -> Array:
    n = len(b.s)
    h = np.full(n, longest)
    if n < 3:
        return h
    i = np.arange(1, n - 1)
    i = i[(b.block[i - 1] == b.block[i + 1])]
    before, after = np.maximum(b.s[i] - b.s[i - 1], 1e-6), np.maximum(b.s[i + 1] - b.s[i], 1e-6)
    for y, tol, factor in ((b.xyz, tol_mm, 1.0), (b.wxyz, tol_rad, 2.0)):
        bend = (y[i + 1] - y[i]) / after[:, None] - (y[i] - y[i - 1]) / before[:, None]
        k = factor * np.linalg.norm(bend, axis=1) / (0.5 * (before + after))
        if y is b.wxyz:
            # A steady turn bends the quaternion too; only the part along the sphere counts.
            radial = np.einsum("ij,ij->i", bend, y[i])
            k = factor * np.sqrt(np.maximum((bend**2).sum(axis=1) - radial**2, 0.0)) / (0.5 * (before + after))
        h[i] = np.minimum(h[i], np.sqrt(8.0 * tol / np.maximum(k, 1e-12)))
    # Knots are dense poses: the longest spacing is a whole number of their steps.
    step = np.diff(b.s)
    around = np.minimum(np.append(step, np.inf), np.concatenate([[np.inf], step]))
    whole = np.maximum(np.floor(longest / around * (1.0 + 1e-6)), 1.0) * around
    return np.minimum(h, np.where(whole > 0.0, whole, longest))


def _spacing(b: Blocks, knot: Ints) -> tuple[Array, NDArray[np.bool_]]:
    """Return the distance between neighbouring knots (k - 1,) and whether they are of one block."""
    same = b.block[knot[1:]] == b.block[knot[:-1]]
    return np.where(same, np.linalg.norm(np.diff(b.xyz[knot], axis=0), axis=1), np.inf), same


def _graded(b: Blocks, knot: Ints, longest: float, ratio: float) -> Ints:
    """Return the knots with more of them, until no spacing is too long or too unlike its neighbours."""
    while True:
        d, same = _spacing(b, knot)
        room = np.diff(knot) > 1
        left = np.concatenate([[np.inf], np.where(same[:-1], d[:-1], np.inf)])
        right = np.concatenate([np.where(same[1:], d[1:], np.inf), [np.inf]])
        small = np.minimum(left, right)
        limit = np.minimum(longest, ratio * small)
        wrong = np.flatnonzero(same & room & (d > limit * (1.0 + 1e-9)))
        if not len(wrong):
            return knot
        # The piece next to the smaller neighbour is half, or as much as that neighbour allows.
        share = np.minimum(0.5, np.where(d[wrong] > longest, 0.5, ratio * small[wrong] / d[wrong]))
        from_left = left[wrong] <= right[wrong]
        a, z = knot[wrong], knot[wrong + 1]
        length = b.s[z] - b.s[a]
        want = np.where(from_left, b.s[a] + share * length, b.s[z] - share * length)
        at = np.searchsorted(b.s, want, side="right") - 1
        at = np.where(from_left, at, np.where(b.s[at] < want - 1e-9, at + 1, at))
        knot = np.union1d(knot, np.clip(at, a + 1, z - 1))


def _interval_of(b: Blocks, knot: Ints) -> Ints:
    """Return the interval (index of its first knot) of each dense pose; the last pose of a block is in the one before."""
    i = np.searchsorted(knot, np.arange(len(b.s)), side="right") - 1
    i = np.minimum(i, len(knot) - 2)
    tail = b.block[knot[i]] != b.block[knot[i + 1]]
    return np.where(tail, i - 1, i)


def _violated(b: Blocks, knot: Ints, tol_mm: float, tol_rad: float) -> NDArray[np.bool_]:
    """Return the intervals (k - 1,) in which a dense pose is out of tolerance of the chord or of a spline."""
    interval = _interval_of(b, knot)
    out = np.zeros(len(b.s), dtype=bool)
    mm, rad = chord_deviation(b.xyz, b.wxyz, knot, interval)
    out |= (mm > tol_mm) | (rad > tol_rad)
    for ends in ("natural", "not-a-knot"):
        mm, rad = spline_deviation(b.xyz, b.wxyz, b.s, knot, interval, b.block, ends)
        out |= (mm > tol_mm) | (rad > tol_rad)
    bad = np.zeros(len(knot) - 1, dtype=bool)
    bad[interval[out]] = True
    return bad & (np.diff(knot) > 1)


def _middle(b: Blocks, knot: Ints, interval: Ints) -> Ints:
    a, z = knot[interval], knot[interval + 1]
    at = np.searchsorted(b.s, 0.5 * (b.s[a] + b.s[z]))
    return np.clip(at, a + 1, z - 1)
