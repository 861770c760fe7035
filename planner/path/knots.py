"""The motion of a dense path as one curve, and places on it between the poses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array, Transform
from planner.path.isolines import Ints
from planner.path.spline import one_sign
from planner.toolpath import Role, ToolPath, contact_to_tcp

BLOCK_ROLES = (Role.LEAD_IN, Role.DATA, Role.LEAD_OUT)
# How far the bends at two neighbouring poses may put the middle between them apart.
UNSURE_MM, UNSURE_RAD = 0.005, np.radians(0.01)
# A distance and a turn that count alike where a place on the motion is sought: the tolerances of `decimate` by default.
ALIKE_MM, ALIKE_RAD = 0.05, float(np.radians(0.1))
_GAP_MM = 1e3
# Places nearer to a pose than this (mm) are that pose.
_SAME_MM = 1e-6
# Weight of the distance along a pass beside the distance from it.
_ALIKE = 1e-6


@dataclass(frozen=True, eq=False)
class Blocks:
    """The motion of all passes from lead-in to lead-out: row (m,) in the dense path, y (m, 7) X Y Z (mm) and quaternion wxyz of
    the TCP, of one sign, s (m,) running arc length with a gap between blocks, block (m,), bend (m, 7): second derivatives;
    ends (m,): where leads and data begin and end."""

    row: Ints
    y: Array
    s: Array
    block: Ints
    bend: Array
    ends: NDArray[np.bool_]

    @property
    def xyz(self) -> Array:
        """Places of the TCP (m, 3), mm."""
        return self.y[:, :3]

    @property
    def wxyz(self) -> Array:
        """Orientations of the TCP (m, 4)."""
        return self.y[:, 3:]

    def only(self, mask: NDArray[np.bool_]) -> "Blocks":
        """Return the blocks that a mask of poses (m,) holds whole."""
        return Blocks(self.row[mask], self.y[mask], self.s[mask], self.block[mask], self.bend[mask], self.ends[mask])


def blocks_of(path: ToolPath) -> Blocks:
    """Return the blocks of a path."""
    row = np.flatnonzero(np.isin(path.role, [int(r) for r in BLOCK_ROLES]))
    if not len(row):
        none = np.zeros(0, dtype=np.int64)
        return Blocks(none, np.zeros((0, 7)), np.zeros(0), none, np.zeros((0, 7)), np.zeros(0, dtype=bool))
    tcp = path.Ts_part_tcp[row]
    y = np.concatenate([tcp.xyz_mm, one_sign(tcp.wxyz)], axis=1)
    new = np.concatenate([[True], (np.diff(path.pass_id[row]) != 0) | (np.diff(row) > 1)])
    step = np.concatenate([[0.0], np.linalg.norm(np.diff(y[:, :3], axis=0), axis=1)])
    step[new] = _GAP_MM
    data = path.role[row] == Role.DATA
    before = np.concatenate([[False], data[:-1]]) & ~new
    after = np.concatenate([data[1:], [False]]) & ~np.concatenate([new[1:], [True]])
    ends = new | np.concatenate([new[1:], [True]]) | (data & (~before | ~after))
    return Blocks(row, y, np.cumsum(step), np.cumsum(new) - 1, _bend(y, step, new), ends)


def _bend(y: Array, step: Array, new: NDArray[np.bool_]) -> Array:
    """Return second derivatives (m, 7) by arc length at poses; at the ends of a block those of the neighbour."""
    m = len(y)
    bend = np.zeros_like(y)
    if m < 3:
        return bend
    h = np.maximum(step[1:], _SAME_MM)[:, None]
    slope = np.diff(y, axis=0) / h
    bend[1:-1] = 2.0 * np.diff(slope, axis=0) / (h[1:] + h[:-1])
    first, last = new, np.concatenate([new[1:], [True]])
    bend[first | last] = 0.0
    i, j = np.flatnonzero(first), np.flatnonzero(last)
    long = j - i >= 2
    bend[i[long]], bend[j[long]] = bend[i[long] + 1], bend[j[long] - 1]
    return bend


@dataclass(frozen=True, eq=False)
class Knots:
    """Places on the dense motion, ascending: s (k,) mm along it, before (k,): the pose at or before each, share (k,) of the way
    to the next one, y (k, 7), block (k,)."""

    s: Array
    before: Ints
    share: Array
    y: Array
    block: Ints

    def __len__(self) -> int:
        return len(self.s)


def knots_at(b: Blocks, s: Array) -> Knots:
    """Return the places at s (k,), mm, ascending and inside blocks.

    Between two poses the motion bends as it does at both of them; where these do not agree (kinks, jumps of curvature) it is
    straight.
    """
    i = np.clip(np.searchsorted(b.s, s + _SAME_MM, side="right") - 1, 0, len(b.s) - 1)
    j = np.minimum(i + 1, len(b.s) - 1)
    h = np.where(b.block[i] == b.block[j], b.s[j] - b.s[i], 0.0)
    f = np.where(s - b.s[i] > _SAME_MM, (s - b.s[i]) / np.where(h > 0.0, h, 1.0), 0.0).clip(0.0, 1.0) * (h > 0.0)
    doubt = 0.125 * h[:, None] ** 2 * (b.bend[i] - b.bend[j])
    sure = (np.linalg.norm(doubt[:, :3], axis=1) < UNSURE_MM) & (
        2.0 * np.linalg.norm(doubt[:, 3:], axis=1) < UNSURE_RAD
    )
    y = (1.0 - f)[:, None] * b.y[i] + f[:, None] * b.y[j]
    y -= (0.25 * f * (1.0 - f) * h**2 * sure)[:, None] * (b.bend[i] + b.bend[j])
    y[:, 3:] /= np.linalg.norm(y[:, 3:], axis=1, keepdims=True)
    return Knots(b.s[i] + f * h, i, f, y, b.block[i])


def with_knots(path: ToolPath, b: Blocks, knots: Knots) -> ToolPath:
    """Return the path with the knots instead of its blocks; everything outside of the blocks stays.

    A knot on a pose is that pose. Between two poses it has the barycentric coordinates between theirs, or those of the nearer
    one where they stand on different triangles; the way from a lead to data is the lead's.
    """
    keep = np.ones(len(path), dtype=bool)
    keep[b.row] = False
    on = knots.share == 0.0
    keep[b.row[knots.before[on]]] = True
    off = np.flatnonzero(~on)
    if not len(off):
        return path.take(keep)
    i, f = b.row[knots.before[off]], knots.share[off]
    nearer = np.where(f < 0.5, i, i + 1)
    standoff = (1.0 - f) * path.standoff_mm[i] + f * path.standoff_mm[i + 1]
    same = path.face[i] == path.face[i + 1]
    bary = np.where(same[:, None], (1.0 - f)[:, None] * path.bary[i] + f[:, None] * path.bary[i + 1], path.bary[nearer])
    tcp = Transform.from_xyz_wxyz("part", "tcp", knots.y[off, :3], knots.y[off, 3:])
    contact = tcp @ contact_to_tcp(standoff, path.heading[i]).inv()
    kept = np.flatnonzero(keep)
    order = np.argsort(np.concatenate([kept, i + f]), kind="stable")
    old = path.take(kept)
    rigid = type(contact.rigid).concatenate([old.Ts_part_contact.rigid, contact.rigid])[order]
    role = np.where(path.role[i] == Role.DATA, path.role[i + 1], path.role[i]).astype(np.uint8)

    def join(a: NDArray, c: NDArray) -> NDArray:
        return np.concatenate([a, c.astype(a.dtype)])[order]

    return ToolPath(
        kind=path.kind,
        Ts_part_contact=Transform("part", "contact", rigid),
        standoff_mm=join(old.standoff_mm, standoff),
        heading=join(old.heading, path.heading[i]),
        pass_id=join(old.pass_id, path.pass_id[i]),
        role=join(old.role, role),
        face=join(old.face, path.face[nearer]),
        bary=join(old.bary, bary),
    )


def placed(b: Blocks, sparse: Blocks, tolerance_mm: float = 0.1) -> Knots:
    """Return where the poses of a sparse path lie on the dense motion.

    Both have the same leads and data, whose ends are poses of both; between these each sparse pose is sought on the polyline
    of the dense ones, by place and turn: where the TCP backs in a kink, it comes by the same place again, turned otherwise.
    Raises ValueError if they do not match, or a pose is farther from it than `tolerance_mm` and the bulge of the motion
    between poses.
    """
    end, theirs = np.flatnonzero(b.ends), np.flatnonzero(sparse.ends)
    if len(end) != len(theirs) or np.abs(b.xyz[end] - sparse.xyz[theirs]).max(initial=0.0) > tolerance_mm:
        raise ValueError("the sparse path has other leads and data than the dense one")
    s = np.zeros(len(sparse.s))
    s[theirs] = b.s[end]
    for (u, v), (p, q) in zip(_pairs(end), _pairs(theirs), strict=True):
        if q - p < 2:
            continue
        at, a = _weighed(sparse.y[p + 1 : q]), _weighed(b.y[u : v + 1])
        at[:, 3:] *= np.where(sparse.wxyz[p] @ b.wxyz[u] < 0.0, -1.0, 1.0)
        a, d = a[:-1], np.diff(a, axis=0)
        dd = np.maximum(np.einsum("ij,ij->i", d, d), _SAME_MM**2)
        t = (np.einsum("nj,mj->nm", at, d) - np.einsum("mj,mj->m", a, d)) / dd
        t = t.clip(0.0, 1.0)
        gap2 = sum(((at[:, None, c] - a[None, :, c] - t * d[None, :, c]) ** 2 for c in range(7)), np.zeros_like(t))
        # A pass that comes by the same place again: the one that is as far along as the pose is.
        length = np.cumsum(np.linalg.norm(np.diff(sparse.xyz[p : q + 1], axis=0), axis=1))
        far = (length[:-1] / length[-1] * (b.s[v] - b.s[u]))[:, None] - (b.s[u:v] - b.s[u])
        best = (gap2 + _ALIKE * far**2).argmin(axis=1)
        rows = np.arange(len(best))
        h = np.diff(b.s[u : v + 1])
        bulge = (
            0.125
            * h**2
            * np.maximum(*(np.linalg.norm(b.bend[r, :3], axis=1) for r in (slice(u, v), slice(u + 1, v + 1))))
        )
        away = np.linalg.norm((at - a[best] - t[rows, best, None] * d[best])[:, :3], axis=1)
        if (away > tolerance_mm + bulge[best]).any():
            raise ValueError("the sparse path holds poses that the dense path does not pass")
        s[p + 1 : q] = b.s[u + best] + t[rows, best] * h[best]
    s = np.maximum.accumulate(s)
    return Knots(s, np.searchsorted(b.s, s + _SAME_MM, side="right") - 1, np.zeros(len(s)), sparse.y, sparse.block)


def _weighed(y: Array) -> Array:
    """Return poses (n, 7) with quaternions long enough that a turn counts as much as the distance that is tolerated with it."""
    return y * np.array([1.0, 1.0, 1.0, *4 * [2.0 * ALIKE_MM / ALIKE_RAD]])


def _pairs(ends: Ints) -> list[tuple[int, int]]:
    return list(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))
