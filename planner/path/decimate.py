"""The few poses a robot needs: within tolerance of the dense path whether it runs chords or a spline through them."""

from dataclasses import dataclass

import numpy as np

from planner.errors import fail
from planner.frames import Array
from planner.path.isolines import Ints
from planner.path.knots import ALIKE_MM, ALIKE_RAD, Blocks, Knots, blocks_of, knots_at, placed, with_knots
from planner.path.spline import chord_deviation, spline_deviation
from planner.toolpath import ToolPath

# Growth of the spacing along the path: (1 + g/2) / (1 - g/2) = 1.5 from one to the next leaves room for rounding.
_GROWTH = 0.4
_MARGIN = 0.95
# Between poses, knots are this much of the longest spacing apart at most: the last digit that is written, and a pose moved.
_FILL = 0.999
_ROUNDS = 12
_SHY = 0.98
_GRADINGS = 60


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
    the leads and the first and last DATA pose of each pass are kept. The others stand where spacing asks for them, on the
    motion through the dense poses (`knots_at`), so that the spacing does not depend on that of the acquisition.
    """
    if not (chord_tol_mm > 0 and angle_tol_deg > 0 and max_spacing_mm > 0 and max_ratio >= 1.5):
        raise fail(
            "decimate-tolerance", "Tolerances must be positive and max_ratio at least 1.5.", "Correct the arguments."
        )
    b = blocks_of(path)
    if len(b.row) == 0:
        return path
    limits = _Limits(_MARGIN * chord_tol_mm, _MARGIN * float(np.radians(angle_tol_deg)), max_spacing_mm, max_ratio)
    knots, rough = _thinned(b, limits, on_poses=False)
    if len(rough):
        # Between the poses of a rough pass nothing is known well: its knots are poses where these can keep the limits with
        # no more of them.
        poses, _ = _thinned(b.only(np.isin(b.block, rough)), limits, on_poses=True)
        n = int(b.block[-1]) + 1
        dense, free, bound = (np.bincount(x, minlength=n) for x in (b.block, knots.block, poses.block))
        better = (bound > 0) & ((free > dense) | ((bound <= free) & (_ratio(poses, n) <= max_ratio * (1.0 + 1e-6))))
        knots = knots_at(b, np.sort(np.concatenate([knots.s[~better[knots.block]], poses.s[better[poses.block]]])))
        # Poses may stand beside each other as no two knots may.
        knots, _ = _kept(b, knots, limits, on_poses=False)
    return with_knots(path, b, knots)


@dataclass(frozen=True)
class _Limits:
    """Tolerances (mm, rad), the longest spacing (mm), and how much larger than the one beside it a spacing may be."""

    mm: float
    rad: float
    longest_mm: float
    ratio: float


def _thinned(b: Blocks, limits: _Limits, on_poses: bool) -> tuple[Knots, Ints]:
    """Return knots that keep the limits, and the blocks that did not with the first choice. on_poses: all are poses."""
    return _kept(b, knots_at(b, _first_choice(b, limits, on_poses)), limits, on_poses)


def _kept(b: Blocks, knots: Knots, limits: _Limits, on_poses: bool) -> tuple[Knots, Ints]:
    """Return knots with more of them until they keep the limits, and the blocks that did not at first."""
    rough = np.zeros(0, dtype=np.int64)
    for k in range(_ROUNDS):
        knots = _graded(b, knots, limits, on_poses)
        more = _in_violated(b, knots, limits)
        if not len(more):
            break
        if k == 0:
            rough = np.unique(knots_at(b, more).block)
        knots = knots_at(b, _merged(knots.s, more))
    return knots, rough


def deviation(dense: ToolPath, sparse: ToolPath) -> tuple[float, float, float, float]:
    """Return the largest distance of a dense path from the chords and from the splines of a sparse one.

    (chord mm, chord deg, spline mm, spline deg) at the TCP, lead-in to lead-out; the poses of `sparse` lie on the motion of
    `dense`, in order. The spline figures are the larger of natural and not-a-knot ends. Raises ValueError if they do not.
    """
    b = blocks_of(dense)
    knots = placed(b, blocks_of(sparse))
    interval = _interval_of(b, knots)
    best = [(np.full(len(b.s), np.inf), np.full(len(b.s), np.inf)) for _ in range(3)]
    # Where a pose bulges from the dense polyline, or the TCP backs in a kink, its place on it is not exact: neighbouring
    # intervals are looked at as well. Of two places, the better is the one from which place and turn together are nearer.
    for aside in (0, -1, 1):
        beside = np.clip(interval + aside, 0, len(knots) - 2)
        beside = np.where((knots.block[beside] == b.block) & (knots.block[beside + 1] == b.block), beside, interval)
        for k, (mm, rad) in enumerate(_readings(b, knots, beside)):
            less = _off(mm, rad) < _off(*best[k]) - 1e-9
            best[k] = np.where(less, mm, best[k][0]), np.where(less, rad, best[k][1])
    away = [float(mm.max(initial=0.0)) for mm, _ in best]
    turned = [float(np.degrees(rad.max(initial=0.0))) for _, rad in best]
    return away[0], turned[0], max(away[1:]), max(turned[1:])


def _off(mm: Array, rad: Array) -> Array:
    return np.maximum(mm / ALIKE_MM, rad / ALIKE_RAD)


def _readings(b: Blocks, knots: Knots, interval: Ints) -> list[tuple[Array, Array]]:
    """Return how far, mm and rad, the dense poses lie from the chords and from the splines with either end."""
    lower, upper = knots.s[interval], knots.s[interval + 1]
    share = np.clip((b.s - lower) / np.maximum(upper - lower, 1e-12), 0.0, 1.0)
    return [
        chord_deviation(b.y, knots.y, interval),
        spline_deviation(b.y, share, knots.y, interval, knots.block, "natural"),
        spline_deviation(b.y, share, knots.y, interval, knots.block, "not-a-knot"),
    ]


def _merged(s: Array, more: Array) -> Array:
    """Return places s (k,) and more of them, ascending, without those that stand on another."""
    every = np.sort(np.concatenate([s, more]))
    return every[np.concatenate([[True], np.diff(every) > 1e-6])]


def _first_choice(b: Blocks, limits: _Limits, on_poses: bool) -> Array:
    """Return places spaced by the local curvature and turn: sag = k h^2 / 8, as far as the growth allows."""
    h = _curvature_spacing(b, limits, on_poses)
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
    want = (running[a][section] + amount[section] * rank / pieces[section])[rank > 0]
    places = np.interp(want, running, b.s)
    return _merged(b.s[end], _nearest(b, places) if on_poses else places)


def _curvature_spacing(b: Blocks, limits: _Limits, on_poses: bool) -> Array:
    step = np.diff(b.s)
    step[np.diff(b.block) > 0] = 0.0
    step = np.maximum(np.append(step, 0.0), np.append(0.0, step))
    longest = np.full(len(b.s), _FILL * limits.longest_mm)
    if on_poses:
        # A whole number of steps.
        whole = np.maximum(np.floor(limits.longest_mm / np.maximum(step, 1e-9) * (1.0 + 1e-6)), 1.0) * step
        longest = np.where(whole > 0.0, np.minimum(whole, limits.longest_mm), limits.longest_mm)
    h = longest
    turn = b.bend[:, 3:]
    # A steady turn bends the quaternion too; only the part along the sphere counts.
    radial = np.einsum("ij,ij->i", turn, b.wxyz)
    along = np.sqrt(np.maximum(np.einsum("ij,ij->i", turn, turn) - radial**2, 0.0))
    for k, tol in ((np.linalg.norm(b.bend[:, :3], axis=1), limits.mm), (2.0 * along, limits.rad)):
        h = np.minimum(h, np.sqrt(8.0 * tol / np.maximum(k, 1e-12)))
    return np.minimum(np.maximum(h, step), longest)


def _ratio(knots: Knots, blocks: int) -> Array:
    """Return the largest ratio of neighbouring spacings in each block (blocks,)."""
    d = np.maximum(np.linalg.norm(np.diff(knots.y[:, :3], axis=0), axis=1), 1e-9)
    same = knots.block[2:] == knots.block[:-2]
    ratio = np.zeros(blocks)
    np.maximum.at(ratio, knots.block[2:][same], np.maximum(d[1:] / d[:-1], d[:-1] / d[1:])[same])
    return ratio


def _graded(b: Blocks, knots: Knots, limits: _Limits, on_poses: bool) -> Knots:
    """Return the knots with more of them, until no spacing is too long or too unlike its neighbours."""
    longest, ratio = limits.longest_mm * (1.0 if on_poses else _FILL), limits.ratio
    for _ in range(_GRADINGS):
        same = knots.block[1:] == knots.block[:-1]
        d = np.where(same, np.linalg.norm(np.diff(knots.y[:, :3], axis=0), axis=1), np.inf)
        left = np.concatenate([[np.inf], np.where(same[:-1], d[:-1], np.inf)])
        right = np.concatenate([np.where(same[1:], d[1:], np.inf), [np.inf]])
        small = np.minimum(left, right)
        limit = np.minimum(longest, ratio * small)
        room = np.diff(knots.before) > 1 if on_poses else True
        wrong = np.flatnonzero(same & room & (d > limit * (1.0 + 1e-9)))
        if not len(wrong):
            break
        # The piece next to the smaller neighbour is half, or as much as that neighbour allows.
        share = np.minimum(0.5, np.where(d[wrong] > longest, 0.5, _SHY * ratio * small[wrong] / d[wrong]))
        from_left = left[wrong] <= right[wrong]
        share = np.where(from_left, share, 1.0 - share)
        at = (1.0 - share) * knots.s[wrong] + share * knots.s[wrong + 1]
        if on_poses:
            # The pose next to it, on the side of the smaller neighbour.
            a, z = knots.before[wrong], knots.before[wrong + 1]
            row = np.searchsorted(b.s, at + np.where(from_left, 1e-9, -1e-9), side="right") - from_left
            at = b.s[np.clip(row, a + 1, z - 1)]
        knots = knots_at(b, _merged(knots.s, at))
    return knots


def _interval_of(b: Blocks, knots: Knots) -> Ints:
    """Return the interval (index of its first knot) of each dense pose; the last pose of a block is in the one before."""
    i = np.searchsorted(knots.s, b.s + 1e-6, side="right") - 1
    i = np.clip(i, 0, len(knots) - 2)
    tail = knots.block[i] != knots.block[i + 1]
    return np.where(tail, i - 1, i)


def _in_violated(b: Blocks, knots: Knots, limits: _Limits) -> Array:
    """Return a place (j,) in every interval where a dense pose is out of tolerance of the chord or of a spline.

    It is the dense pose nearest to the middle: kinks are poses, and stay.
    """
    interval = _interval_of(b, knots)
    out = np.zeros(len(b.s), dtype=bool)
    for mm, rad in _readings(b, knots, interval):
        out |= (mm > limits.mm) | (rad > limits.rad)
    bad = np.zeros(len(knots) - 1, dtype=bool)
    bad[interval[out]] = True
    lower, upper = knots.s[:-1][bad], knots.s[1:][bad]
    at = _nearest(b, 0.5 * (lower + upper))
    return at[(at > lower + 1e-6) & (at < upper - 1e-6)]


def _nearest(b: Blocks, s: Array) -> Array:
    """Return the places of the dense poses nearest to s (k,)."""
    after = np.clip(np.searchsorted(b.s, s), 1, len(b.s) - 1)
    return np.where(b.s[after] - s < s - b.s[after - 1], b.s[after], b.s[after - 1])
