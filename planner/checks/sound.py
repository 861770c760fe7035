"""The raster as robot and nozzle can run it: passes along edges that they cannot are left out, for none was asked for."""

from dataclasses import replace

import numpy as np

from planner.checks.check import check
from planner.issues import Issue
from planner.path.decimate import decimate
from planner.path.links import with_links
from planner.path.raster import raster_and_edges
from planner.robot.model import Robot
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.toolpath import Role, ToolPath


def sound_raster(curved: CurvedSurface, setup: Setup, robot: Robot | None = None) -> tuple[ToolPath, list[Issue]]:
    """Return the inspection raster without the passes along edges that its checks would refuse, and an info that says so.

    Along an edge the array stands turned and the nozzle nearer to what rises beside it: an axis may come to its limit, or
    the nozzle into a wall. The raster itself stays as it is, whatever the checks say. Errors: those of `raster` and `check`.
    """
    path, passes = raster_and_edges(curved, setup)
    edges = path.passes - passes
    if not edges:
        return path, []
    sent = decimate(path)
    found = check(curved, sent, setup, robot)
    why = {
        "the nozzle, or the wrist, would run into something": (found.clearance_mm < 0.0)
        | (found.wrist_clearance_mm < 0.0)
        | (found.keep_out_mm < 0.0)
    }
    if setup.base.is_taught:
        why["they are out of reach or beyond an axis limit"] = ~found.reachable
        why["an axis would jump"] = found.jumped
        why["an axis would be too fast"] = np.nan_to_num(found.speed_share, nan=0.0) > 1.0
    bad = {text: np.unique(sent.pass_id[mask & (sent.pass_id >= passes)]) for text, mask in why.items()}
    out = np.unique(np.concatenate(list(bad.values())))
    if not len(out):
        return path, []
    kept = path.take(~np.isin(path.pass_id, out) & (path.role != Role.LINK))
    _, number = np.unique(kept.pass_id, return_inverse=True)
    kept = with_links(replace(kept, pass_id=number.astype(np.int32)), curved, setup)
    reasons = " and ".join(text for text, some in bad.items() if len(some))
    text = (
        f"{len(out)} of {edges} passes along edges are left out, because {reasons}; what they would see is not reached."
    )
    remedy = "Move the part or the tool, enlarge edge_margin_mm, or turn the passes (direction_deg)."
    return kept, [Issue("info", "edge-passes-left-out", text, remedy, "inspection")]
