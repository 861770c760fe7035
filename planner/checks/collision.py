"""Collision of nozzle and wrist with the part along the whole path, between the poses as well as at them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from planner.checks.clearance import Envelope, clearance_mm
from planner.frames import Array, Transform
from planner.surface.solid import Solid
from planner.toolpath import Role, ToolPath

# Steps are halved until the motion between neighbours can no longer hide a contact, or is this short (mm).
SHORTEST_STEP_MM = 1.0
MAX_HALVINGS = 9


@dataclass(frozen=True, eq=False)
class Clearance:
    """Clearance (mm) of nozzle and wrist at each pose and on the way to the next one, (n,) each.

    Negative where they touch; a way that is found to touch is not searched for its deepest place.
    """

    nozzle_mm: Array
    wrist_mm: Array


def path_clearance(solid: Solid, path: ToolPath, envelope: Envelope, keep_mm: float) -> Clearance:
    """Return the clearance along the path, straight (LIN) and splined (SPL) between its poses.

    No point of the envelope moves more than m between two poses, so half of m is all the clearance that the way between
    them can lose; where that would leave less than `keep_mm`, the step is halved and looked at.
    """
    poses = path.Ts_part_tcp
    nozzle, wrist = clearance_mm(solid, poses, envelope)
    if len(path) < 2:
        return Clearance(nozzle, wrist)
    at_n, at_w = nozzle.copy(), wrist.copy()
    bulge = spline_bulge_mm(path)
    step = _Steps(
        np.arange(len(path) - 1), poses[:-1], poses[1:], np.minimum(at_n, at_w)[:-1], np.minimum(at_n, at_w)[1:]
    )
    for _ in range(MAX_HALVINGS):
        moved = _motion_mm(step.start, step.end, envelope)
        doubtful = np.minimum(step.low, step.high) - moved / 2.0 - bulge[step.index] < keep_mm
        # A step that is known to touch needs no closer look.
        known = np.minimum(nozzle, wrist)[step.index] < 0.0
        step = step.take(doubtful & (moved > SHORTEST_STEP_MM) & ~known)
        if len(step.index) == 0:
            break
        middle = _halfway(step.start, step.end)
        mid_n, mid_w = clearance_mm(solid, middle, envelope)
        np.minimum.at(nozzle, step.index, mid_n)
        np.minimum.at(wrist, step.index, mid_w)
        step = step.halved(middle, np.minimum(mid_n, mid_w))
    return Clearance(nozzle, wrist)


@dataclass(frozen=True, eq=False)
class _Steps:
    """m pieces of the way: which step of the path they belong to, their ends and the clearances there."""

    index: NDArray[np.intp]
    start: Transform
    end: Transform
    low: Array
    high: Array

    def take(self, mask: NDArray[np.bool_]) -> "_Steps":
        return _Steps(self.index[mask], self.start[mask], self.end[mask], self.low[mask], self.high[mask])

    def halved(self, middle: Transform, clearance: Array) -> "_Steps":
        start, end = _join(self.start, middle), _join(middle, self.end)
        low, high = np.r_[self.low, clearance], np.r_[clearance, self.high]
        return _Steps(np.r_[self.index, self.index], start, end, low, high)


def _join(first: Transform, second: Transform) -> Transform:
    rigid = type(first.rigid).concatenate([first.rigid, second.rigid])
    return Transform(first.dst, first.src, rigid)


def _turn(start: Transform, end: Transform) -> Array:
    """Return the rotation vectors (m, 3) from start to end, in the axes of the start's TCP, rad."""
    return np.asarray((start.rotation.inv() * end.rotation).as_rotvec())


def _motion_mm(start: Transform, end: Transform, envelope: Envelope) -> Array:
    """Return how far any point of the envelope can move at most between the poses (m,), mm."""
    shift = np.linalg.norm(end.xyz_mm - start.xyz_mm, axis=1)
    return np.asarray(shift + np.linalg.norm(_turn(start, end), axis=1) * envelope.farthest_mm())


def _halfway(start: Transform, end: Transform) -> Transform:
    turn = type(start.rotation).from_rotvec(_turn(start, end) / 2.0)
    return Transform.from_parts(start.dst, start.src, start.rotation * turn, (start.xyz_mm + end.xyz_mm) / 2.0)


def spline_bulge_mm(path: ToolPath) -> Array:
    """Return how far a C2 chord-length spline through each pass leaves the chords (n - 1,), mm; 0 on links.

    A controller that splines (SPL) runs such a curve within one pass; links and retracts are straight.
    """
    bulge = np.zeros(max(len(path) - 1, 0))
    xyz = path.Ts_part_tcp.xyz_mm
    splined = (path.role >= Role.LEAD_IN) & (path.role <= Role.LEAD_OUT)
    cuts = np.flatnonzero((np.diff(path.pass_id) != 0) | (np.diff(splined.astype(np.int8)) != 0)) + 1
    for rows in np.split(np.arange(len(path)), cuts):
        p = xyz[rows]
        chord = np.linalg.norm(np.diff(p, axis=0), axis=1)
        keep = np.r_[True, chord > 1e-9]
        if not splined[rows[0]] or keep.sum() < 3:
            continue
        s = np.r_[0.0, np.cumsum(chord)][keep]
        middle = CubicSpline(s, p[keep])((s[:-1] + s[1:]) / 2.0)
        q = p[keep]
        bulge[rows[keep][:-1]] = np.linalg.norm(middle - (q[:-1] + q[1:]) / 2.0, axis=1)
    return bulge
