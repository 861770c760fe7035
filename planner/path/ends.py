"""How the passes of the alignment scan end: at the margin, or across an edge where the part ends."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.path.crossings import Rim
from planner.path.fence import Fence
from planner.path.isolines import Chains, Ints
from planner.path.mesh import PathMesh
from planner.path.passes import DataRuns, contact_frames, extrapolate
from planner.path.section import Stroke, positions, together
from planner.path.tracks import measure, within
from planner.setup import Setup
from planner.surface.keepouts import KeepOuts

EDGE_REACH_MM = 40.0
"""A pass that ends this near the edge, and no farther than a third of its line, goes on to it."""
_OVERRUN_TURN_RAD = np.radians(10.0)
# Between two keep-outs a pass shorter than this is not worth its approach.
_LEAST_PIECE_MM = 6.0


@dataclass(frozen=True, eq=False)
class Run:
    """A pass on one line from s0 to s1 (mm along it); over: which ends (0 first, 1 last) cross an edge."""

    line: Chains
    s0: float
    s1: float
    over: tuple[int, ...]
    ends: Array

    def rim_at(self, rim: Rim, end: int) -> int:
        """Return the point of the rim where this end crosses it."""
        return int(np.linalg.norm(rim.points - self.ends[end], axis=1).argmin())


def finished(mesh: PathMesh, stroke: Stroke, rim: Rim, setup: Setup, only_last: bool = False) -> Run:
    """Return the stroke with its ends led to the margin, or to an edge that is to be crossed; loops end as they are."""
    line, total = stroke.line, stroke.length
    ends, _, _ = positions(mesh, line, np.array([0.0, total]))
    if stroke.loop or not len(rim.points):
        here, _, _ = positions(mesh, line, np.array([stroke.s0, stroke.s1]))
        return Run(line, stroke.s0, stroke.s1, (), here)
    reach = min(EDGE_REACH_MM, total / 3.0)
    inside0, inside1 = _margin(mesh, stroke, setup.inspection.edge_margin_mm)
    s0, s1, over = stroke.s0, stroke.s1, []
    if s0 <= reach and not only_last:
        if setup.alignment.edges and _is_open(rim, ends[0]):
            s0 = 0.0
            over.append(0)
        else:
            s0 = min(s0, inside0)
    if total - s1 <= reach:
        if setup.alignment.edges and _is_open(rim, ends[1]):
            s1 = total
            over.append(1)
        else:
            s1 = max(s1, inside1)
    return Run(line, s0, s1, tuple(over), ends)


def outside(mesh: PathMesh, runs: list[Run], keep: KeepOuts) -> list[Run]:
    """Return what of passes lies outside the keep-out regions, in pieces long enough to be worth one, in order."""
    if not len(keep):
        return runs
    out: list[Run] = [r for r in runs if r.s1 <= r.s0]
    some = [r for r in runs if r.s1 > r.s0]
    if not some:
        return out
    fence = Fence(mesh, 0.0, keep=keep)
    spacing = min(_LEAST_PIECE_MM, fence.finest_mm) / 2.0
    lengths = measure(mesh, together([Stroke(r.line, r.s0, r.s1, 0.0) for r in some]))
    s0, s1 = np.array([r.s0 for r in some]), np.array([r.s1 for r in some])
    which, low, high, _ = within(lengths, np.arange(len(some)), s0, s1, spacing, fence)
    for k, a, b in zip(which.tolist(), low.tolist(), high.tolist(), strict=True):
        run = some[k]
        over = tuple(end for end in run.over if (a <= run.s0 + 1e-6 if end == 0 else b >= run.s1 - 1e-6))
        if b - a >= _LEAST_PIECE_MM:
            out.append(Run(run.line, a, b, over, run.ends))
    return out


def _is_open(rim: Rim, end: Array) -> bool:
    return bool(rim.open[int(np.linalg.norm(rim.points - end, axis=1).argmin())])


def _margin(mesh: PathMesh, stroke: Stroke, margin: float) -> tuple[float, float]:
    """Return where the line first and last keeps the margin (mm along it)."""
    if margin <= 0.0:
        return 0.0, stroke.length
    s = np.linspace(0.0, stroke.length, max(int(np.ceil(4.0 * stroke.length / margin)), 8) + 1)
    points, _, _ = positions(mesh, stroke.line, s)
    inside = np.flatnonzero(~(mesh.boundary_distance(points, margin) < margin))
    if not len(inside):
        return stroke.length / 2.0, stroke.length / 2.0
    return float(s[inside[0]]), float(s[inside[-1]])


def overrun(
    points: Array,
    normals: Array,
    travel: Array,
    face: NDArray[np.int32],
    bary: Array,
    run: Ints,
    over: list[tuple[int, ...]],
    setup: Setup,
    spacing_mm: float,
) -> DataRuns:
    """Return the DATA poses with `edge_overrun_mm` more at the ends `over` of each run: off the surface, face -1."""
    length = setup.alignment.edge_overrun_mm
    count = int(np.ceil(length / spacing_mm - 1e-9))
    k = len(over)
    first, last = np.searchsorted(run, np.arange(k)), np.searchsorted(run, np.arange(k), side="right") - 1
    if not count or not any(over):
        return DataRuns(points, normals, travel, face, bary, run, np.ones(k, dtype=np.int8))
    inside = max(round(6.0 / spacing_mm), 2)
    parts: list[tuple[Array, ...]] = [(points, normals, travel)]
    key, runs = [np.arange(len(run)) * 1.0], [run]
    for end, at, sign in ((0, first, -1.0), (1, last, 1.0)):
        which = np.flatnonzero([end in o for o in over])
        if not len(which):
            continue
        a = at[which]
        toward = np.clip(a - int(sign) * inside, first[which], last[which])
        steps = np.tile(sign * length * np.arange(1, count + 1) / count, (len(a), 1))
        here, inner = (contact_frames(points[i], normals[i], travel[i]) for i in (a, toward))
        frame = extrapolate(here, inner, steps, _OVERRUN_TURN_RAD)
        axes = frame.rotation_matrix
        parts.append((frame.xyz_mm, axes[:, :, 2], axes[:, :, 0]))
        key.append((a[:, None] + sign * np.arange(1, count + 1) / (2.0 * count + 2.0)).ravel())
        runs.append(np.repeat(which, count))
    order = np.argsort(np.concatenate(key), kind="stable")
    p, n, t = (np.concatenate([x[i] for x in parts])[order] for i in range(3))
    extra = len(order) - len(run)
    return DataRuns(
        p,
        n,
        t,
        np.concatenate([face, np.full(extra, -1, dtype=np.int32)])[order],
        np.concatenate([bary, np.zeros((extra, 3))])[order],
        np.concatenate(runs)[order].astype(np.int64),
        np.ones(k, dtype=np.int8),
    )
