"""Does the nozzle or the wrist, anywhere along the path, run into what stands on a keep-out, or come above what forbids it?"""

import numpy as np

from planner.checks.clearance import Envelope
from planner.checks.collect import place
from planner.frames import Array
from planner.issues import Issue
from planner.path.detour import Detours
from planner.path.isolines import Ints
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.keepouts import Column, keep_outs_of
from planner.toolpath import ToolPath

_STEP_MM = 1.0
# The wrist is a sphere of decimetres: between places this far apart (mm) it bulges by less than a tenth of a millimetre.
_WRIST_STEP_MM = 5.0
# A spline through the poses leaves the chords by no more than this in tolerance (decimation), mm.
_BULGE_MM = 0.1


def keep_out_gap_mm(curved: CurvedSurface, path: ToolPath, setup: Setup) -> tuple[Array, list[Issue]]:
    """Return how far the nozzle stays beside what must not be crossed, at each pose and on the way to the next (n,), mm.

    And an error for every region it comes above, or runs into what stands there. Ways are straight motions, looked at every
    millimetre wherever the poses at their ends do not prove them clear.
    """
    out = np.full(len(path), np.inf)
    issues: list[Issue] = []
    keep = keep_outs_of(curved.surface, setup)
    if not len(path) or not keep.columns:
        return out, issues
    tcp = path.Ts_part_tcp
    tip, up = tcp.xyz_mm, -tcp.rotation_matrix[:, :, 2]
    for column in keep.columns:
        gap = _along(column, tip, up, setup)
        out = np.minimum(out, gap)
        bad = gap < 0.0
        if bad.any() and np.isfinite(column.top_mm):
            issues.append(
                Issue(
                    "error",
                    "keep-out-nozzle",
                    f"At {int(bad.sum())} of {len(path)} poses, or on the way to the next, the nozzle runs into "
                    f"'{column.name}' as high as it stands, by up to {-float(gap.min()):.1f} mm.",
                    "Enlarge its margin_mm, raise standoff_mm above its height, or correct height_mm and the nozzle.",
                    place(path, int(np.argmax(bad))),
                )
            )
        elif bad.any():
            issues.append(
                Issue(
                    "error",
                    "keep-out-crossed",
                    f"At {int(bad.sum())} of {len(path)} poses, or on the way to the next, the nozzle comes above "
                    f"'{column.name}', which must not be crossed, by up to {-float(gap.min()):.1f} mm.",
                    "Enlarge its margin_mm, correct tool.nozzle_radius_mm, or leave that side of it out (box, paint).",
                    place(path, int(np.argmax(bad))),
                )
            )
    return out, issues


def keep_out_wrist_mm(
    curved: CurvedSurface, path: ToolPath, setup: Setup, envelope: Envelope
) -> tuple[Array, list[Issue]]:
    """Return how far the wrist stays off what stands on keep-outs of known height, at each pose and on the way to the next
    (n,), mm; and an error for each it touches."""
    out = np.full(len(path), np.inf)
    issues: list[Issue] = []
    obstacles = keep_outs_of(curved.surface, setup).obstacles
    if not len(path) or not obstacles or envelope.wrist_tcp is None:
        return out, issues
    at, way = _wrist_ways(path, envelope.wrist_tcp)
    for column in obstacles:
        gap = column.ball_gap_mm(at, envelope.wrist_radius_mm)
        here = np.full(len(path), np.inf)
        np.minimum.at(here, way, gap)
        out = np.minimum(out, here)
        bad = here < 0.0
        if bad.any():
            issues.append(
                Issue(
                    "error",
                    "keep-out-wrist",
                    f"At {int(bad.sum())} of {len(path)} poses, or on the way to the next, the robot's wrist would touch "
                    f"'{column.name}' (sphere about the wrist centre, {-float(here.min()):.0f} mm too deep).",
                    "Use a longer tool, turn it about the beam, or leave that side of it out (box, paint).",
                    place(path, int(np.argmax(bad))),
                )
            )
    return out, issues


def _wrist_ways(path: ToolPath, wrist_tcp: Array) -> tuple[Array, Ints]:
    """Return wrist centres (m, 3) at the poses and every few mm on straight ways between them, and the pose before each."""
    tcp = path.Ts_part_tcp
    turn = (tcp.rotation[:-1].inv() * tcp.rotation[1:]).as_rotvec() if len(path) > 1 else np.zeros((0, 3))
    shift = np.diff(tcp.xyz_mm, axis=0)
    moved = np.linalg.norm(shift, axis=1) + np.linalg.norm(turn, axis=1) * float(np.linalg.norm(wrist_tcp))
    pieces = np.append(np.maximum(np.ceil(moved / _WRIST_STEP_MM), 1.0), 1.0).astype(np.int64)
    way = np.repeat(np.arange(len(path)), pieces)
    t = ((np.arange(len(way)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[way])[:, None]
    shift, turn = (np.concatenate([x, np.zeros((1, 3))]) for x in (shift, turn))
    rotation = tcp.rotation[way] * type(tcp.rotation).from_rotvec(t * turn[way])
    return tcp.xyz_mm[way] + t * shift[way] + rotation.apply(wrist_tcp), way


def _along(column: Column, tip: Array, up: Array, setup: Setup) -> Array:
    one = Detours((column,), setup.tool.nozzle_radius_mm, setup.tool.nozzle_length_mm)
    gap = one.gap_mm(tip, up)
    if len(tip) < 2:
        return gap
    turned = np.linalg.norm(np.diff(up, axis=0), axis=1)
    moved = np.linalg.norm(np.diff(tip, axis=0), axis=1) + turned * one.length_mm
    least = np.minimum(gap[:-1], gap[1:])
    # No point of the nozzle comes nearer than half the motion below the nearer end. Below its foot a column is no witness.
    doubtful = np.flatnonzero(~(np.isfinite(least) & (least - moved / 2.0 > _BULGE_MM)) & (moved > _STEP_MM))
    pieces = np.ceil(moved[doubtful] / _STEP_MM).astype(np.int64)
    way = np.repeat(doubtful, pieces)
    rank = np.arange(len(way)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    t = ((rank + 0.5) / np.repeat(pieces, pieces))[:, None]
    stand = (1.0 - t) * up[way] + t * up[way + 1]
    stand /= np.maximum(np.linalg.norm(stand, axis=1, keepdims=True), 1e-9)
    between = one.gap_mm((1.0 - t) * tip[way] + t * tip[way + 1], stand)
    np.minimum.at(gap, way, between)
    return gap
