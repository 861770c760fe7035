"""The few poses a robot needs: within tolerance of the dense path whether it runs chords or a spline through them."""

import numpy as np

from planner.errors import fail
from planner.frames import Array
from planner.path.isolines import Ints
from planner.path.knots import Blocks, Knots, blocks_of, knots_at, placed, with_knots
from planner.path.spline import chord_deviation, spline_deviation
from planner.toolpath import ToolPath

# Growth of the spacing along the path: (1 + g/2) / (1 - g/2) = 1.5 from one to the next leaves room for rounding.
_GROWTH = 0.4
_MARGIN = 0.95
# Knots are this much of the longest spacing apart at most: chords and arcs, and the last digit that is written.
_FILL = 0.999
_ROUNDS = 12
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
    tolerance = (_MARGIN * chord_tol_mm, _MARGIN * float(np.radians(angle_tol_deg)))
    longest = _FILL * max_spacing_mm
    knots = knots_at(b, _first_choice(b, *tolerance, longest))
    for _ in range(_ROUNDS):
        knots = _graded(b, knots, longest, max_ratio)
        more = _in_violated(b, knots, *tolerance)
        if not len(more):
            break
        knots = knots_at(b, _merged(knots.s, more))
    return with_knots(path, b, knots)


def deviation(dense: ToolPath, sparse: ToolPath) -> tuple[float, float, float, float]:
    """Return the largest distance of a dense path from the chords and from the splines of a sparse one.

    (chord mm, chord deg, spline mm, spline deg) at the TCP, lead-in to lead-out; the poses of `sparse` lie on the motion of
    `dense`, in order. The spline figures are the larger of natural and not-a-knot ends. Raises ValueError if they do not.
    """
    b = blocks_of(dense)
    knots = placed(b, blocks_of(sparse))
    interval = _interval_of(b, knots)
    best = [(np.full(len(b.s), np.inf), np.zeros(len(b.s))) for _ in range(3)]
    # Where a pose bulges from the dense polyline its place on it is not exact: neighbouring intervals are looked at as well.
    for aside in (0, -1, 1):
        beside = np.clip(interval + aside, 0, len(knots) - 2)
        beside = np.where((knots.block[beside] == b.block) & (knots.block[beside + 1] == b.block), beside, interval)
        for k, (mm, rad) in enumerate(_readings(b, knots, beside)):
            less = mm < best[k][0] - 1e-9
            best[k] = np.where(less, mm, best[k][0]), np.where(less, rad, best[k][1])
    away = [float(mm.max(initial=0.0)) for mm, _ in best]
    turned = [float(np.degrees(rad.max(initial=0.0))) for _, rad in best]
    return away[0], turned[0], max(away[1:]), max(turned[1:])


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


def _first_choice(b: Blocks, tol_mm: float, tol_rad: float, longest: float) -> Array:
    """Return places spaced by the local curvature and turn: sag = k h^2 / 8, as far as the growth allows."""
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
    want = (running[a][section] + amount[section] * rank / pieces[section])[rank > 0]
    return _merged(b.s[end], np.interp(want, running, b.s))


def _curvature_spacing(b: Blocks, tol_mm: float, tol_rad: float, longest: float) -> Array:
    h = np.full(len(b.s), longest)
    turn = b.bend[:, 3:]
    # A steady turn bends the quaternion too; only the part along the sphere counts.
    radial = np.einsum("ij,ij->i", turn, b.wxyz)
    along = np.sqrt(np.maximum(np.einsum("ij,ij->i", turn, turn) - radial**2, 0.0))
    for k, tol in ((np.linalg.norm(b.bend[:, :3], axis=1), tol_mm), (2.0 * along, tol_rad)):
        h = np.minimum(h, np.sqrt(8.0 * tol / np.maximum(k, 1e-12)))
    step = np.diff(b.s)
    step[np.diff(b.block) > 0] = 0.0
    return np.minimum(np.maximum(h, np.maximum(np.append(step, 0.0), np.append(0.0, step))), longest)


def _graded(b: Blocks, knots: Knots, longest: float, ratio: float) -> Knots:
    """Return the knots with more of them, until no spacing is too long or too unlike its neighbours."""
    for _ in range(_GRADINGS):
        same = knots.block[1:] == knots.block[:-1]
        d = np.where(same, np.linalg.norm(np.diff(knots.y[:, :3], axis=0), axis=1), np.inf)
        left = np.concatenate([[np.inf], np.where(same[:-1], d[:-1], np.inf)])
        right = np.concatenate([np.where(same[1:], d[1:], np.inf), [np.inf]])
        small = np.minimum(left, right)
        limit = np.minimum(longest, ratio * small)
        wrong = np.flatnonzero(same & (d > limit * (1.0 + 1e-9)))
        if not len(wrong):
            break
        # The piece next to the smaller neighbour is half, or as much as that neighbour allows.
        share = np.minimum(0.5, np.where(d[wrong] > longest, 0.5, 0.98 * ratio * small[wrong] / d[wrong]))
        share = np.where(left[wrong] <= right[wrong], share, 1.0 - share)
        knots = knots_at(b, _merged(knots.s, (1.0 - share) * knots.s[wrong] + share * knots.s[wrong + 1]))
    return knots


def _interval_of(b: Blocks, knots: Knots) -> Ints:
    """Return the interval (index of its first knot) of each dense pose; the last pose of a block is in the one before."""
    i = np.searchsorted(knots.s, b.s + 1e-6, side="right") - 1
    i = np.clip(i, 0, len(knots) - 2)
    tail = knots.block[i] != knots.block[i + 1]
    return np.where(tail, i - 1, i)


def _in_violated(b: Blocks, knots: Knots, tol_mm: float, tol_rad: float) -> Array:
    """Return a place (j,) in every interval where a dense pose is out of tolerance of the chord or of a spline.

    It is the dense pose nearest to the middle: kinks are poses, and stay.
    """
    interval = _interval_of(b, knots)
    out = np.zeros(len(b.s), dtype=bool)
    for mm, rad in _readings(b, knots, interval):
        out |= (mm > tol_mm) | (rad > tol_rad)
    bad = np.zeros(len(knots) - 1, dtype=bool)
    bad[interval[out]] = True
    lower, upper = knots.s[:-1][bad], knots.s[1:][bad]
    at = _nearest(b, 0.5 * (lower + upper))
    return at[(at > lower + 1e-6) & (at < upper - 1e-6)]


def _nearest(b: Blocks, s: Array) -> Array:
    """Return the places of the dense poses nearest to s (k,)."""
    after = np.clip(np.searchsorted(b.s, s), 1, len(b.s) - 1)
    return np.where(b.s[after] - s < s - b.s[after - 1], b.s[after], b.s[after - 1])
