"""What stands on a keep-out as high as it says: nozzle and wrist keep off it, against points sampled on both."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.checks import check
from planner.keypoint import KeyPoint
from planner.path.alignment import alignment_path
from planner.path.decimate import decimate
from planner.path.keypoints import suggest
from planner.path.raster import raster
from planner.setup import Setup
from planner.surface.keepouts import Column, keep_outs_of
from planner.toolpath import Role, ToolPath
from tests.path.shapes import curved_of, plate

AT = (150.0, 90.0)


def setup_with(height_mm: float | None, may_cross: bool = True, **more: object) -> Setup:
    stud = {
        "type": "disc",
        "name": "stud",
        "centre_mm": [*AT, 0.0],
        "radius_mm": 10.0,
        "may_cross": may_cross,
        "height_mm": height_mm,
    }
    return Setup.model_validate({"inspection": {"keep_outs": [stud], "strategy": "plane"}, **more})


def finely(path: ToolPath, step_mm: float = 1.5) -> tuple[np.ndarray, Rotation]:
    """TCP positions and orientations at and between the poses, one pose after the other."""
    xyz, turn = path.Ts_part_tcp.xyz_mm, path.Ts_part_tcp.rotation
    at, how = [xyz[:1]], [turn[0].as_quat()[None]]
    for i in range(len(path) - 1):
        delta = turn[i].inv() * turn[i + 1]
        far = np.linalg.norm(xyz[i + 1] - xyz[i]) + 300.0 * delta.magnitude()
        t = np.linspace(0.0, 1.0, max(int(far / step_mm), 1) + 1)[1:, None]
        at.append(xyz[i] + t * (xyz[i + 1] - xyz[i]))
        how.append((turn[i] * Rotation.from_rotvec(t * delta.as_rotvec())).as_quat())
    return np.concatenate(at), Rotation.from_quat(np.concatenate(how))


def nozzle_hits(path: ToolPath, setup: Setup, height_mm: float) -> int:
    """Sampled points of the nozzle inside the cylinder of the stud, anywhere along the path."""
    at, how = finely(path)
    count, tool = 0, setup.tool
    for back in np.linspace(0.0, tool.nozzle_length_mm, 25):
        for r in (0.0, 0.5 * tool.nozzle_radius_mm, tool.nozzle_radius_mm):
            for a in np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False):
                p = at + how.apply([r * np.cos(a), r * np.sin(a), -back])
                beside = np.hypot(p[:, 0] - AT[0], p[:, 1] - AT[1])
                count += int(((beside < 10.0) & (p[:, 2] < height_mm) & (p[:, 2] > -1.0)).sum())
    return count


@pytest.mark.parametrize("height", [6.0, 11.5, 14.0, 30.0, 63.0, 90.0])
def test_nothing_of_the_nozzle_enters_what_stands_there(height: float) -> None:
    setup = setup_with(height)
    curved = curved_of(plate(300.0, 200.0), setup)
    for path in (raster(curved, setup), alignment_path(curved, suggest(curved, setup), setup)):
        sent = decimate(path)
        assert nozzle_hits(sent, setup, height) == 0
        assert not [i for i in check(curved, sent, setup).issues if i.code == "keep-out-nozzle"]
    # Lower than the standoff less its margin it costs nothing but its own area; higher, the nozzle's room around it.
    data = raster(curved, setup)
    room = np.linalg.norm(data.Ts_part_contact.xyz_mm[data.is_data][:, :2] - AT, axis=1).min()
    assert (room > 10.0 + 3.0 + 20.0 - 1e-3) == (height + 3.0 > 15.0)


def test_links_fly_over_what_is_lower_than_they_and_round_what_is_not() -> None:
    keys = tuple(KeyPoint(id=f"S1.{i}", x_mm=x, y_mm=AT[1], z_mm=0.0) for i, x in ((1, 40.0), (2, 260.0)))
    for height, round_it in ((30.0, False), (58.0, False), (90.0, True)):
        setup = setup_with(height, alignment={"edges": False})
        curved = curved_of(plate(300.0, 200.0), setup)
        path = alignment_path(curved, keys, setup)
        assert path.passes == 2
        assert (path.role == Role.LINK).any() == round_it
        assert nozzle_hits(path, setup, height) == 0


def test_a_path_planned_without_the_height_is_refused_with_it() -> None:
    flush, high = setup_with(None), setup_with(14.0)
    curved = curved_of(plate(300.0, 200.0), flush)
    path = decimate(raster(curved, flush))
    assert nozzle_hits(path, high, 14.0) == 0
    higher = setup_with(25.0)
    assert nozzle_hits(path, higher, 25.0) > 0
    found = [i for i in check(curved, path, higher).issues if i.code == "keep-out-nozzle"]
    assert len(found) == 1
    assert "'stud'" in found[0].message
    assert found[0].severity == "error"


def test_between_two_poses_a_way_into_it_is_found() -> None:
    setup = setup_with(25.0)
    curved = curved_of(plate(300.0, 200.0), setup)
    path = raster(curved, setup)
    rows = np.flatnonzero(path.is_data)
    at = path.Ts_part_contact.xyz_mm[rows]
    left = rows[np.linalg.norm(at - [60.0, AT[1], 0.0], axis=1).argmin()]
    right = rows[np.linalg.norm(at - [240.0, AT[1], 0.0], axis=1).argmin()]
    two = path.take(np.array([left, right]))
    assert [i.code for i in check(curved, two, setup).issues if i.code == "keep-out-nozzle"]


@pytest.mark.parametrize("may_cross", [True, False])
def test_the_wrist_keeps_off_it_too(may_cross: bool) -> None:
    """The nozzle passes beside a stud of 300 mm; the wrist, 110 mm thick, 273 mm behind the TCP, does not."""
    tool = {"tcp": {"z_mm": 120.0}, "nozzle_radius_mm": 15.0}
    for height, hits in ((40.0, False), (300.0, True)):
        setup = setup_with(height, may_cross, tool=tool, robot="kuka-kr16-r2010-2")
        curved = curved_of(plate(300.0, 200.0), setup)
        sent = decimate(raster(curved, setup))
        found = check(curved, sent, setup)
        assert bool([i for i in found.issues if i.code == "keep-out-wrist"]) == hits
        # The envelope against the stud, by points on the stud's surface and its axis.
        at, how = finely(sent, 6.0)
        back = 120.0 + 153.0
        centre = at + how.apply([0.0, 0.0, -back])
        z = np.clip(centre[:, 2], 0.0, height)
        side = np.maximum(np.hypot(centre[:, 0] - AT[0], centre[:, 1] - AT[1]) - 10.0, 0.0)
        least = float((np.hypot(side, centre[:, 2] - z) - 110.0).min())
        assert (least < 0.0) == hits
        told = float(found.wrist_clearance_mm.min())
        assert told == pytest.approx(least, abs=1.0) or (not hits and told <= least)


def test_a_leaning_nozzle_hangs_lower_on_one_side() -> None:
    """20 mm thick and leaning by 30 deg, its rim is 10 mm below its middle: it touches a top 9 mm below, not one 11 mm."""
    up = np.array([np.sin(np.radians(30.0)), 0.0, np.cos(np.radians(30.0))])
    for top, touches in ((-9.0, True), (-11.0, False)):
        column = Column(
            "stud",
            np.zeros(3),
            np.array([0.0, 0.0, 1.0]),
            np.array([1.0, 0.0, 0.0]),
            np.array([0.0, 1.0, 0.0]),
            np.zeros((1, 2)),
            5.0,
            -100.0,
            0.0,
            top,
        )
        gap = column.gap_mm(np.zeros((1, 3)), 120.0 * up[None], 20.0)[0]
        assert (gap < 0.0) == touches


def test_regions_know_their_columns_and_obstacles() -> None:
    for height, cross, columns, obstacles in (
        (None, True, 0, 0),
        (None, False, 1, 0),
        (20.0, True, 1, 1),
        (20.0, False, 1, 1),
    ):
        setup = setup_with(height, cross)
        keep = keep_outs_of(curved_of(plate(300.0, 200.0), setup).surface, setup)
        assert (len(keep.columns), len(keep.obstacles)) == (columns, obstacles)
        if columns:
            assert np.isinf(keep.columns[0].top_mm) == (not cross)
        if obstacles:
            assert keep.obstacles[0].top_mm == pytest.approx(20.0)
            ball = keep.obstacles[0].ball_gap_mm(np.array([[*AT, 50.0], [AT[0] + 60.0, AT[1], 10.0]]), 10.0)
            assert ball == pytest.approx([20.0, 40.0])
