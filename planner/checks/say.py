"""The sentences: from the arrays of the checks to issues with remedies."""

import numpy as np

from planner.checks.clearance import NEAR_MM
from planner.checks.collect import collapse
from planner.checks.collision import Clearance
from planner.checks.ultrasound import Seen
from planner.frames import Array
from planner.issues import Issue
from planner.setup import Setup
from planner.toolpath import ToolPath


def say_seen(path: ToolPath, setup: Setup, found: Seen) -> list[Issue]:
    """Return the issues of tilt, standoff and curvature on the data poses."""
    tol = setup.tolerances
    data = path.is_data
    off = np.abs(found.standoff_mm - path.standoff_mm)
    narrow = found.effective_swath_mm < setup.probe.swath_mm - 1e-6
    missing = setup.probe.swath_mm - found.effective_swath_mm
    least = float(np.nanmin(found.effective_swath_mm)) if narrow.any() else setup.probe.swath_mm
    issues = collapse(
        path,
        _above(found.tilt_deg, tol.tilt_deg),
        "warning",
        "tilt",
        f"At {{count}} of {int(data.sum())} data poses the beam stands more than {tol.tilt_deg:g} deg off the surface normal,"
        " up to {worst:.2f} deg.",
        "Look at creases and tight radii there; enlarge edge_margin_mm or leave them out of the inspection surface.",
        found.tilt_deg,
    )
    issues += collapse(
        path,
        _above(off, tol.standoff_mm),
        "warning",
        "standoff",
        f"At {{count}} of {int(data.sum())} data poses the TCP is more than {tol.standoff_mm:g} mm off its standoff,"
        " up to {worst:.2f} mm.",
        "The surface bends more tightly there than the standoff allows; shorten the standoff or leave the place out.",
        off,
    )
    issues += collapse(
        path,
        _above(found.curvature_loss_db, tol.loss_db),
        "warning",
        "curvature-aperture",
        "At {count} data poses the surface bends so much under the active aperture that its echo loses more than"
        f" {tol.loss_db:g} dB, up to {{worst:.1f}} dB.",
        "Use fewer aperture elements or a lower frequency there.",
        found.curvature_loss_db,
    )
    issues += collapse(
        path,
        narrow,
        "info",
        "effective-swath",
        f"At {{count}} data poses the outer laws stand more than {tol.tilt_deg:g} deg off their own normal; the swath"
        f" within tolerance is as narrow as {least:.1f} of {setup.probe.swath_mm:.1f} mm.",
        "Lay the passes so that the array stands along the lower curvature (inspection.direction_deg 90 turns them), or"
        " leave inspection.step_mm open: the step then follows the swath.",
        missing,
    )
    return issues


def _above(values: Array, limit: float) -> np.ndarray:
    return np.nan_to_num(values, nan=-np.inf) > limit


def say_clearance(path: ToolPath, found: Clearance) -> list[Issue]:
    """Return the issues of collision of nozzle and wrist with the part."""
    hit = found.nozzle_mm < 0.0
    near = ~hit & (found.nozzle_mm < np.minimum(NEAR_MM, 0.5 * path.standoff_mm))
    issues = collapse(
        path,
        hit,
        "error",
        "collision-nozzle",
        "At {count} of {of} poses, or on the way to the next, the nozzle runs into the part, by {worst:.1f} mm or more.",
        "Check nozzle_radius_mm and nozzle_length_mm, raise standoff_mm, or leave the place out (keep-out, edge margin).",
        -found.nozzle_mm,
    )
    issues += collapse(
        path,
        near,
        "warning",
        "clearance-nozzle",
        f"At {{count}} of {{of}} poses the nozzle comes closer to the part than {NEAR_MM:g} mm or half the standoff.",
        "Raise standoff_mm, or check the nozzle's dimensions in the setup.",
    )
    issues += collapse(
        path,
        found.wrist_mm < 0.0,
        "error",
        "collision-wrist",
        "At {count} of {of} poses, or on the way to the next, the robot's wrist would touch the part (sphere about the wrist"
        " centre, {worst:.0f} mm too deep).",
        "Use a longer tool, turn it about the beam, or leave the place out.",
        -found.wrist_mm,
    )
    return issues


def say_fixture(path: ToolPath, setup: Setup, fixture_mm: Array) -> list[Issue]:
    """Return the issue of a fixture tolerance that does not fit in the standoff of the alignment scan."""
    if path.kind != "alignment":
        return []
    bad = path.is_data & (fixture_mm >= path.standoff_mm)
    if not bad.any():
        return []
    worst = float(fixture_mm[bad].max())
    enough = 5.0 * np.ceil((worst + 1.0) / 5.0)
    return collapse(
        path,
        bad,
        "warning",
        "fixture-standoff",
        f"Two sigma of the fixture's tolerance ({setup.fixture.sigma_mm:g} mm, {setup.fixture.sigma_deg:g} deg per axis) move"
        f" the part by up to {{worst:.1f}} mm along the normal, no less than the standoff of"
        f" {setup.alignment_standoff_mm:g} mm: the nozzle may touch it before it is aligned.",
        f"Set alignment.standoff_mm to {enough:.0f} or more, or state a tighter fixture.",
        fixture_mm,
    )
