"""Does the nozzle, anywhere along the path, come above a keep-out that must not be crossed?"""

import numpy as np

from planner.checks.collect import place
from planner.frames import Array
from planner.issues import Issue
from planner.path.detour import Detours
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.keepouts import Column, keep_outs_of
from planner.toolpath import ToolPath

_STEP_MM = 1.0
# A spline through the poses leaves the chords by no more than this in tolerance (decimation), mm.
_BULGE_MM = 0.1


def keep_out_gap_mm(curved: CurvedSurface, path: ToolPath, setup: Setup) -> tuple[Array, list[Issue]]:
    """Return how far the nozzle stays beside what must not be crossed, at each pose and on the way to the next (n,), mm.

    And an error for every region it comes above. Ways are straight motions, looked at every millimetre wherever the poses
    at their ends do not prove them clear.
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
        if bad.any():
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
