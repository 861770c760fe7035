"""Passes along edges that the robot or the nozzle cannot run are left out; the raster stays as it is."""

import numpy as np

from planner.checks import check
from planner.checks.sound import sound_raster
from planner.path.decimate import decimate
from planner.path.raster import raster, raster_and_edges
from planner.robot import load_robot
from planner.robot.model import Axis, Robot, RobotFile
from planner.setup import Setup
from tests.path.shapes import curved_of, drilled

CELL = {
    "base": {"x_mm": 1100.0, "y_mm": -100.0, "z_mm": 300.0},
    "tool": {"tcp": {"z_mm": 200.0, "b_deg": -35.0}},
    "inspection": {"direction_deg": 20.0},
}
PLATE = drilled(300, 200, ((100, 80, 20), (220, 130, 20)))


def with_axis(robot: Robot, number: int, axis: Axis) -> Robot:
    axes = [axis if i == number - 1 else a for i, a in enumerate(robot.file.axes)]
    return Robot(RobotFile.model_validate({**robot.file.model_dump(), "axes": [a.model_dump() for a in axes]}))


def test_a_robot_that_can_run_all_of_it_gets_all_of_it() -> None:
    setup = Setup.model_validate(CELL)
    path, said = sound_raster(curved_of(PLATE, setup), setup)
    assert said == []
    assert (path.Ts_part_tcp.matrix == raster(curved_of(PLATE, setup), setup).Ts_part_tcp.matrix).all()


def test_a_robot_whose_wrist_turns_less_far_runs_the_raster_alone() -> None:
    setup = Setup.model_validate(CELL)
    curved = curved_of(PLATE, setup)
    whole, passes = raster_and_edges(curved, setup)
    assert whole.passes > passes
    sent, robot = decimate(whole), load_robot(setup.robot)
    a6 = check(curved, sent, setup).axes_deg[:, 5]
    of_raster = a6[sent.pass_id < passes]
    tight = Axis(min_deg=float(of_raster.min()) - 2.0, max_deg=float(of_raster.max()) + 2.0, speed_deg_s=None)
    assert a6.min() < tight.min_deg or a6.max() > tight.max_deg
    small = with_axis(robot, 6, tight)
    assert [i for i in check(curved, sent, setup, small).issues if i.severity == "error"]
    path, (issue,) = sound_raster(curved, setup, small)
    assert issue.code == "edge-passes-left-out"
    assert passes <= path.passes < whole.passes
    assert f"{whole.passes - path.passes} of {whole.passes - passes} passes" in issue.message
    assert not [i for i in check(curved, decimate(path), setup, small).issues if i.severity == "error"]
    # What is kept is what it was, in order.
    rows = path.is_data & (path.pass_id < passes)
    same = whole.is_data & (whole.pass_id < passes)
    np.testing.assert_array_equal(path.Ts_part_tcp.matrix[rows], whole.Ts_part_tcp.matrix[same])


def test_an_axis_too_slow_for_a_tight_arc_leaves_it_out() -> None:
    setup = Setup.model_validate(CELL)
    curved = curved_of(PLATE, setup)
    whole, passes = raster_and_edges(curved, setup)
    sent, robot = decimate(whole), load_robot(setup.robot)
    found = check(curved, sent, setup, with_axis(robot, 6, Axis(min_deg=-350.0, max_deg=350.0, speed_deg_s=1.0)))
    share = np.nan_to_num(found.speed_share)
    slow = 1.05 * float(share[sent.pass_id < passes].max())
    assert slow < share.max()
    limited = with_axis(robot, 6, Axis(min_deg=-350.0, max_deg=350.0, speed_deg_s=slow))
    path, (issue,) = sound_raster(curved, setup, limited)
    assert "too fast" in issue.message
    assert path.passes >= passes
    left = check(curved, decimate(path), setup, limited)
    assert np.nan_to_num(left.speed_share).max() <= 1.0 + 1e-9
