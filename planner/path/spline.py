"""The smooth curve a robot may run through its points: a C2 cubic over chord length, many passes in one solve."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from planner.frames import Array
from planner.path.isolines import Ints

EndRule = Literal["natural", "not-a-knot"]


@dataclass(frozen=True, eq=False)
class Spline:
    """Piecewise cubic through knots. t (k,): chord length, starting anew (a gap of 1) in every block; y (k, c): values;
    moment (k, c): second derivatives."""

    t: Array
    y: Array
    moment: Array

    def at(self, interval: Ints, u: Array) -> tuple[Array, Array]:
        """Return values and derivatives (n, c) in the intervals (n,) at u (n,) past their first knot."""
        h = (self.t[interval + 1] - self.t[interval])[:, None]
        b = u[:, None] / h
        a = 1.0 - b
        y0, y1, m0, m1 = self.y[interval], self.y[interval + 1], self.moment[interval], self.moment[interval + 1]
        value = a * y0 + b * y1 + ((a**3 - a) * m0 + (b**3 - b) * m1) * h**2 / 6.0
        slope = (y1 - y0) / h + ((1.0 - 3.0 * a**2) * m0 + (3.0 * b**2 - 1.0) * m1) * h / 6.0
        return value, slope


def spline(xyz: Array, wxyz: Array, block: Ints, ends: EndRule) -> Spline:
    """Return the C2 spline through knots (k, 3) mm and quaternions (k, 4) of one sign per block; block (k,) ascending.

    Parameter: chord length. ends: second derivative zero, or third derivative continuous at the second knot (blocks of
    fewer than four knots are natural). Textbook moment form: de Boor 1978, A Practical Guide to Splines, chapter IV.
    """
    k = len(xyz)
    step = np.maximum(np.linalg.norm(np.diff(xyz, axis=0), axis=1), 1e-6)
    new = np.diff(block) > 0
    step[new] = 1.0
    t = np.concatenate([[0.0], np.cumsum(step)])
    y = np.concatenate([xyz, wxyz], axis=1)
    first = np.concatenate([[True], new])
    last = np.concatenate([new, [True]])
    bands = np.zeros((5, k))
    right = np.zeros_like(y)
    slope = np.diff(y, axis=0) / step[:, None]
    i = np.flatnonzero(~first & ~last)
    bands[3, i - 1], bands[1, i + 1] = step[i - 1], step[i]
    bands[2, i] = 2.0 * (step[i - 1] + step[i])
    right[i] = 6.0 * (slope[i] - slope[i - 1])
    bands[2, first | last] = 1.0
    if ends == "not-a-knot":
        _not_a_knot(bands, step, np.flatnonzero(first), np.flatnonzero(last))
    return Spline(t, y, np.asarray(solve_banded((2, 2), bands, right)))


def _not_a_knot(bands: Array, step: Array, first: Ints, last: Ints) -> None:
    long = last - first >= 3
    a, z = first[long], last[long]
    bands[2, a], bands[1, a + 1], bands[0, a + 2] = step[a + 1], -(step[a] + step[a + 1]), step[a]
    bands[2, z], bands[3, z - 1], bands[4, z - 2] = step[z - 2], -(step[z - 1] + step[z - 2]), step[z - 1]


def one_sign(wxyz: Array) -> Array:
    """Return quaternions (n, 4) with neighbours in the same half sphere."""
    turn = np.einsum("ij,ij->i", wxyz[1:], wxyz[:-1]) < 0
    sign = np.concatenate([[1.0], np.where(turn, -1.0, 1.0)]).cumprod()
    return wxyz * sign[:, None]


def angle_between(p: Array, q: Array) -> Array:
    """Return the rotation angle (n,), rad, between unit quaternions, exact for small ones."""
    gap = np.minimum(np.linalg.norm(p - q, axis=1), np.linalg.norm(p + q, axis=1))
    return np.asarray(4.0 * np.arcsin(np.minimum(gap / 2.0, 1.0)))


def slerp(p: Array, q: Array, f: Array) -> Array:
    """Return quaternions (n, 4) the share f (n,) of the way from p to q, the short way round."""
    q = np.where((np.einsum("ij,ij->i", p, q) < 0)[:, None], -q, q)
    half = angle_between(p, q) / 2.0
    sine = np.sin(half)
    small = sine < 1e-9
    safe = np.where(small, 1.0, sine)
    a = np.where(small, 1.0 - f, np.sin((1.0 - f) * half) / safe)
    b = np.where(small, f, np.sin(f * half) / safe)
    out = a[:, None] * p + b[:, None] * q
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))


def chord_deviation(y: Array, knots: Array, interval: Ints) -> tuple[Array, Array]:
    """Return how far, mm and rad, each dense pose y (n, 7) lies from the straight motion between knots (k, 7).

    Rows are X Y Z (mm) and quaternion wxyz; interval (n,): of each dense pose, the index of its first knot.
    """
    xyz, a, b = y[:, :3], knots[interval], knots[interval + 1]
    d = b[:, :3] - a[:, :3]
    f = np.einsum("ij,ij->i", xyz - a[:, :3], d) / np.maximum(np.einsum("ij,ij->i", d, d), 1e-12)
    f = np.clip(f, 0.0, 1.0)
    away = np.linalg.norm(xyz - a[:, :3] - f[:, None] * d, axis=1)
    return away, angle_between(y[:, 3:], slerp(a[:, 3:], b[:, 3:], f))


def spline_deviation(
    y: Array, share: Array, knots: Array, interval: Ints, block: NDArray[np.integer], ends: EndRule
) -> tuple[Array, Array]:
    """Return how far, mm and rad, each dense pose y (n, 7) lies from the spline through knots (k, 7), block (k,).

    share (n,): how far along its interval a dense pose is, 0..1; the nearest point of the spline is sought from there.
    """
    curve = spline(knots[:, :3], knots[:, 3:], block.astype(np.int64), ends)
    h = curve.t[interval + 1] - curve.t[interval]
    u = h * share
    value, slope = curve.at(interval, u)
    speed = np.einsum("ij,ij->i", slope[:, :3], slope[:, :3])
    shift = np.einsum("ij,ij->i", y[:, :3] - value[:, :3], slope[:, :3]) / np.maximum(speed, 1e-12)
    u = np.clip(u + shift, 0.0, h)
    value, _ = curve.at(interval, u)
    q = value[:, 3:] / np.linalg.norm(value[:, 3:], axis=1, keepdims=True)
    return np.linalg.norm(y[:, :3] - value[:, :3], axis=1), angle_between(y[:, 3:], q)
