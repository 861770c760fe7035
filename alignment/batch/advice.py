"""What a batch suggests for `setup.json`: the nominal BASE moved by what parts have in common, and a fixture sigma."""

from typing import Any

from alignment.batch.batch import Batch
from alignment.batch.scatter import LEAST_FOR_SCATTER
from planner.issues import Issue
from planner.placement import corrected_base
from planner.setup import Pose, Setup

# No fixture is better, and no prior may be sharper than what the next scan could contradict.
LEAST_SIGMA = {"mm": 0.02, "deg": 0.005}


def advice(found: Batch, setup: Setup) -> tuple[dict[str, Any], list[Issue]]:
    """Return (patch of setup.json, what to say of it).

    base: T_world_base T_base_common, if the common place differs from nominal (95 %) and BASE is taught. fixture: a sigma of
    which two hold the next part with 95 %, about the common place, the largest of the directions of its kind; never less
    than the present one while some of them are not seen by three parts.
    """
    patch: dict[str, Any] = {}
    issues: list[Issue] = []
    if found.offset_known and setup.base.is_taught:
        world = Pose.of(corrected_base(setup.T_world_base, found.T_base_common)).model_dump()
        patch["base"] = {k: round(v, 6) for k, v in world.items()}
    elif found.offset_known:
        text = "BASE is not taught, so that there is none to move: the common correction stands beside it."
        issues.append(Issue("info", "batch-base", text, "Enter it on the controller, or teach BASE again.", "base"))
    else:
        text = "What the parts have in common cannot be told from nominal (95 %): BASE stays."
        issues.append(Issue("info", "batch-base", text, "Add parts.", "base"))
    fixture = {}
    for unit, field in (("mm", "sigma_mm"), ("deg", "sigma_deg")):
        present = float(getattr(setup.fixture, field))
        told = [c.next_sigma for a, c in zip(found.axes, found.common, strict=True) if a.unit == unit]
        known = [v for v in told if v is not None]
        if not known:
            continue
        sigma = max(*known, LEAST_SIGMA[unit])
        if len(known) < LEAST_FOR_SCATTER and sigma < present:
            text = f"fixture.{field} stays {present:g}: not all directions in {unit} are shown by three parts."
            issues.append(Issue("info", "batch-fixture", text, "Cross edges with the alignment scan.", field))
            continue
        fixture[field] = float(f"{sigma:.3g}")
    if fixture:
        patch["fixture"] = fixture
    return patch, issues
