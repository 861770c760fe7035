"""Steps that no path can follow are told, with place and height; nothing else is taken for one."""

import numpy as np
import pytest

from alignment.non_rigid import left_over
from tests.non_rigid import cases
from tests.non_rigid.cases import TRUTH
from tests.non_rigid.step_cases import CELL, cloud_of, flat, plan_of, ramp, told

ALONG, ASIDE, SLANT = (1.0, 0.0), (0.0, 1.0), (1.0, 0.6)
SPLASH = {"outliers": 0.1, "dropouts": 0.2}
# A robot that shakes, wanders, or drifts; few and many passes.
NOISE = {
    "reference": {},
    "splash": SPLASH,
    "shaking": {"pose_mm": 0.06, "correlation_mm": 2.0, "pose_deg": 0.02},
    "wandering": {"pose_mm": 0.1, "correlation_mm": 5.0, "reset": True, **SPLASH},
    "drifting": {"pose_mm": 0.1, "correlation_mm": 150.0, "pose_deg": 0.05},
    "rough echoes": {"tof_mm": 0.05, "outliers": 0.1},
    "many passes": {"passes": 8, "pose_mm": 0.08, "correlation_mm": 8.0},
    "sparse": {"spacing_mm": 5.0, **SPLASH},
}


def looked_at(name, field, seed, **noise):
    """What readings leave of the part where it truly lies."""
    return left_over(cloud_of(name, field, seed, **noise), plan_of(name).curved, CELL, TRUTH, None)


@pytest.mark.parametrize(("name", "noise"), [*(("plate", n) for n in NOISE), ("wing", "splash"), ("wing", "wandering")])
def test_a_true_part_has_no_steps(name, noise):
    for seed in range(2):
        left = looked_at(name, flat, seed, **NOISE[noise])
        assert left.rest.known.sum() > 1000
        assert left.steps.found == ()


@pytest.mark.parametrize("width_mm", [0.5, 2.0, 8.0])
@pytest.mark.parametrize(("direction", "at"), [(ALONG, 170.0), (SLANT, 190.0)], ids=["along", "slant"])
def test_a_step_over_the_passes_is_found_with_place_height_and_extent(direction, at, width_mm):
    left = looked_at("plate", ramp(0.4, width_mm, at, direction), 3, **SPLASH)
    (step,) = left.steps.found
    assert step.height_mm == pytest.approx(0.4, abs=0.08)
    assert step.passes == 4
    n = np.array(direction) / np.linalg.norm(direction)
    across = np.vstack([step.ends_part, step.point_part])[:, :2] @ n - at
    assert np.abs(across).max() < 8.0
    # Passes of 30 mm at y = 10, 70, 130, 190, seen to within half a window of the outer laws' cells.
    assert step.extent_mm == pytest.approx(200.0 / n[0], abs=25.0)


def test_a_step_along_a_pass_is_seen_by_its_laws_though_the_robot_wanders_more():
    left = looked_at("plate", ramp(0.2, 1.0, 127.0, ASIDE), 4, pose_mm=0.1, correlation_mm=8.0)
    (step,) = left.steps.found
    assert step.height_mm == pytest.approx(0.2, abs=0.03)
    assert step.passes == 1
    assert abs(step.point_part[1] - 127.0) < 4.0
    assert step.extent_mm > 250.0
    # Between two passes (145 to 175 and beyond) it is not seen, and not told.
    assert looked_at("plate", ramp(0.2, 1.0, 100.0, ASIDE), 4).steps.found == ()


def test_several_passes_know_what_none_knows_alone():
    robot = {"pose_mm": 0.1, "correlation_mm": 8.0, "reach": 0.7}
    step = ramp(0.45, 1.0, 170.0, ALONG)
    together = [looked_at("plate", step, seed, passes=6, **robot).steps for seed in range(3)]
    assert all(s.found for s in together)
    assert all(s.found[0].passes >= 4 for s in together)
    alone = [looked_at("plate", step, seed, passes=1, **robot).steps for seed in range(3)]
    assert not any(s.found for s in alone)


@pytest.mark.parametrize("name", ["plate", pytest.param("wing", marks=pytest.mark.slow)])
def test_the_prediction_of_a_step_beyond_the_path_is_what_the_inspection_sees(name):
    told_of = told(name, ramp(0.4, 1.5, 170.0, ALONG), 1)
    found = told_of.followed.found
    assert found.non_rigid["applied"]
    assert found.verdict == "partial"
    assert found.after.tof_std_mm == pytest.approx(told_of.std_mm, rel=0.25)
    assert found.after.tof_range_mm == pytest.approx(told_of.range_mm, rel=0.25)
    issue = told_of.issue("step-unfollowed")
    assert issue.severity == "warning"
    assert "4 passes" in issue.message
    (step,) = found.non_rigid["steps"]
    assert step["height_mm"] == pytest.approx(0.4, abs=0.08)
    assert step["point_part_mm"][0] == pytest.approx(170.0, abs=4.0)
    assert 0.3 < found.non_rigid["seen_share"] < 0.9


def test_passes_that_stand_off_their_neighbours_are_no_longer_nothing():
    """A step between two passes: the likelihood calls it the robot's, and the prediction left it out (0.02 mm)."""
    told_of = told("wing", ramp(0.4, 1.5, 20.0, ASIDE), 1)
    found = told_of.followed.found
    assert not found.non_rigid["applied"]
    assert told_of.issue("rest-unfollowed") is not None
    assert found.verdict == "partial"
    assert found.after.tof_std_mm == pytest.approx(told_of.std_mm, rel=0.2)
    assert found.after.tof_range_mm == pytest.approx(told_of.range_mm, rel=0.2)


def test_a_true_part_is_told_to_be_true():
    told_of = told("plate", flat, 2)
    found = told_of.followed.found
    assert found.verdict == "pass"
    assert [i for i in found.issues if i.severity != "info"] == []
    assert found.after.tof_std_mm < 0.02
    assert found.non_rigid["steps"] == []


@pytest.mark.slow
@pytest.mark.parametrize("shape", [cases.bend, cases.twist, cases.dent, cases.step], ids=lambda f: f.__name__)
def test_gentle_shapes_are_no_steps(shape):
    part = cases.PLATE
    told_of = told("plate", lambda p: shape(p, part), 1, **SPLASH)
    assert told_of.followed.found.non_rigid["applied"]
    assert told_of.issue("step-unfollowed") is None
    assert told_of.issue("rest-unfollowed") is None


@pytest.mark.slow
def test_another_part_is_not_followed_as_shape():
    """A shell of radii 1.5 m and 0.7 m scanned by the plan of a plate: a smooth field fits it to a quarter of a millimetre."""
    told_of = told("plate", lambda p: -((p[:, 0] - 150.0) ** 2) / 3000.0 - (p[:, 1] - 100.0) ** 2 / 1400.0, 1)
    found = told_of.followed.found
    assert found.residual.rms_mm < 0.5
    assert found.verdict == "fail"
    issue = told_of.issue("scan-of-another-part")
    assert issue.severity == "error"
    assert "Check that this is a scan of this part" in issue.remedy
