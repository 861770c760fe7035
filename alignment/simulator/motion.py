"""How the robot moves through the poses of a program: where the TCP is at each moment of the path."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from planner.frames import Array, Transform
from planner.program_path import Motion, ProgramPath


class ProgramMotion:
    """The path as a function of `s`, the chord length (mm) travelled since the first pose.

    LIN: straight lines with slerp. SPL: through the poses of one block, and the pose before it, a C2 cubic spline over
    chord length, of the position and (sign-continuous, renormalised) of the quaternion.
    """

    def __init__(self, path: ProgramPath) -> None:
        self.xyz = path.Ts_base_tcp.xyz_mm
        self.turns = path.Ts_base_tcp.rotation
        chord = np.linalg.norm(np.diff(self.xyz, axis=0), axis=1)
        # A pure turn takes some path too, so that every motion has a length.
        turn_mm = np.degrees((self.turns[:-1].inv() * self.turns[1:]).magnitude())
        self.s = np.concatenate(
            [[0.0], np.cumsum(np.maximum(chord, np.where(chord > 1e-9, 0.0, np.maximum(turn_mm, 1e-6))))]
        )
        speed = np.maximum(path.speed_mm_s[1:], 1e-3)
        self.t = np.concatenate([[0.0], np.cumsum(np.diff(self.s) / speed)])
        self.blocks = _blocks(path)

    @property
    def length_mm(self) -> float:
        """Length of the whole path (mm)."""
        return float(self.s[-1])

    def seconds(self, s: Array) -> Array:
        """Return the time (s) at which the robot is at `s`."""
        return np.interp(s, self.s, self.t)

    def at_seconds(self, t: Array) -> Array:
        """Return `s` at time `t` (s); it stays on the path."""
        return np.interp(t, self.t, self.s)

    def poses(self, s: Array) -> Transform:
        """Return `Ts_base_tcp` of the tool as taught, in the program's BASE, at path lengths s (n,)."""
        s = np.clip(s, 0.0, self.s[-1])
        xyz = np.stack([np.interp(s, self.s, self.xyz[:, i]) for i in range(3)], axis=1)
        quat = Slerp(self.s, self.turns)(s).as_quat()
        for first, last in self.blocks:
            inside = (s >= self.s[first]) & (s <= self.s[last])
            if inside.any():
                xyz[inside], quat[inside] = self._spline(first, last, s[inside])
        return Transform.from_parts("base", "tcp", Rotation.from_quat(quat), xyz)

    def _spline(self, first: int, last: int, s: Array) -> tuple[Array, Array]:
        knots = slice(first, last + 1)
        q = self.turns[knots].as_quat()
        flips = np.concatenate([[1.0], np.cumprod(np.where(np.einsum("ij,ij->i", q[1:], q[:-1]) < 0.0, -1.0, 1.0))])
        ends = "not-a-knot" if last - first >= 3 else "natural"
        spline = CubicSpline(self.s[knots], np.hstack([self.xyz[knots], q * flips[:, None]]), bc_type=ends)
        values = spline(s)
        return values[:, :3], values[:, 3:]


def _blocks(path: ProgramPath) -> list[tuple[int, int]]:
    """First and last pose of each spline: the pose before the block, and its last one."""
    smooth = (path.motion == Motion.SPL) & (path.block >= 0)
    starts = np.flatnonzero(smooth & np.concatenate([[True], (path.block[1:] != path.block[:-1]) | ~smooth[:-1]]))
    out = []
    for start in starts:
        same = smooth[start:] & (path.block[start:] == path.block[start])
        stop = int(start) + (len(same) if same.all() else int(np.argmin(same)))
        if stop - 1 > max(int(start) - 1, 0):
            out.append((max(int(start) - 1, 0), int(stop) - 1))
    return out


def firing_places(
    path: ProgramPath, motion: ProgramMotion, spacing_mm: float
) -> tuple[Array, NDArray[np.int32], list[slice]]:
    """Return where readings are taken: s (m,), pass (m,), and the stretches of unbroken data taking as slices of them.

    On each stretch with the data signal on, every `spacing_mm` from where it is switched on.
    """
    on = path.data_on.copy()
    on[0] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(np.int8)))
    s_all, pass_all, stretches, n = [], [], [], 0
    for begin, end in edges.reshape(-1, 2):
        s0, s1 = motion.s[begin - 1], motion.s[end - 1]
        s = s0 + spacing_mm * np.arange(int(np.floor((s1 - s0) / spacing_mm + 1e-9)) + 1)
        row = np.clip(np.searchsorted(motion.s, s, side="left"), begin, end - 1)
        s_all.append(s)
        pass_all.append(path.pass_id[row])
        stretches.append(slice(n, n + len(s)))
        n += len(s)
    if not s_all:
        return np.zeros(0), np.zeros(0, dtype=np.int32), []
    return np.concatenate(s_all), np.concatenate(pass_all).astype(np.int32), stretches
