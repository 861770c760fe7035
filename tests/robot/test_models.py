"""Robot files: the geometry they state is that of the link chains they were taken from, and wrong files are refused."""

import json
import re

import numpy as np
import pytest

from planner.errors import EchoBaseError
from planner.robot import forward, inverse, load_robot, robot_names
from planner.robot.load import MODELS
from tests.robot.chain import URDF_MM, mdh_flange_l6, urdf_flange


def some_axes(name: str, count: int, seed: int = 7) -> np.ndarray:
    low, high = load_robot(name).limits_deg.T
    return np.random.default_rng(seed).uniform(low, high, (count, 6))


@pytest.mark.parametrize("name", sorted(URDF_MM))
def test_forward_agrees_with_the_urdf_chain(name: str) -> None:
    axes = some_axes(name, 200)
    poses = forward(load_robot(name), axes)
    for i, row in enumerate(axes):
        position, rotation = urdf_flange(name, row)
        assert np.abs(poses.xyz_mm[i] - position).max() < 1e-8
        assert np.abs(poses.rotation_matrix[i] - rotation).max() < 1e-11


def test_forward_of_the_l6_agrees_with_its_denavit_hartenberg_rows() -> None:
    axes = some_axes("kuka-kr16-l6-2", 300)
    poses = forward(load_robot("kuka-kr16-l6-2"), axes).matrix
    chain = np.array([mdh_flange_l6(row) for row in axes])
    assert np.abs(poses - chain).max() < 1e-8


def test_home_of_the_l6_is_where_the_facts_say() -> None:
    home = forward(load_robot("kuka-kr16-l6-2"), [0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
    assert np.allclose(home.xyz_mm, [1345.0, 0.0, 1320.0], atol=1e-9)
    # A0 B90 C0: x down, y left, z forward.
    assert np.allclose(home.rotation_matrix, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-12)


@pytest.mark.parametrize("name", robot_names())
def test_every_shipped_file_round_trips_through_inverse_kinematics(name: str) -> None:
    robot = load_robot(name)
    axes = some_axes(name, 500)
    found = inverse(robot, forward(robot, axes))
    turned = np.abs((found - axes[:, None] + 180.0) % 360.0 - 180.0).max(axis=2)
    assert np.nanmin(turned, axis=1).max() < 1e-6
    back = forward(robot, found[np.isfinite(found[:, :, 0])])
    wanted = np.repeat(forward(robot, axes).matrix, np.isfinite(found[:, :, 0]).sum(axis=1), axis=0)
    assert np.abs(back.matrix - wanted).max() < 1e-6


@pytest.mark.parametrize("name", [name for name in robot_names() if re.search(r"-r\d{3,4}", name)])
def test_reach_agrees_with_the_number_in_the_model_name(name: str) -> None:
    nominal = float(re.search(r"-r(\d{3,4})", name)[1])
    assert load_robot(name).reach_mm == pytest.approx(nominal, abs=6.0)


def test_reach_of_the_l6_is_its_nominal_1911_mm() -> None:
    assert load_robot("kuka-kr16-l6-2").reach_mm == pytest.approx(1911.0, abs=0.5)


def test_unknown_speeds_are_said() -> None:
    robot = load_robot("kuka-kr16-l6-2")
    assert np.isnan(robot.speeds_deg_s).all()
    assert "not known" in robot.file.sources.speeds.lower()


def test_an_unknown_name_lists_the_known_ones(tmp_path) -> None:
    (tmp_path / "my-arm.json").write_text((MODELS / "kuka-kr16-2.json").read_text().replace("kuka-kr16-2", "my-arm"))
    with pytest.raises(EchoBaseError) as error:
        load_robot("kuka-kr17", tmp_path)
    issue = error.value.issues[0]
    assert issue.code == "robot-unknown"
    assert "kuka-kr16-l6-2" in issue.remedy
    assert "my-arm" in issue.remedy
    assert load_robot("my-arm", tmp_path).name == "my-arm"


@pytest.mark.parametrize(
    "change, where",
    [
        (lambda d: d["opw"].pop("c3_mm"), "opw.c3_mm"),
        (lambda d: d["opw"].update(c2_mm=-1), "opw.c2_mm"),
        (lambda d: d["axes"][2].update(min_deg=200), "axes.2"),
        (lambda d: d.update(colour="orange"), "colour"),
        (lambda d: d["axes"].pop(), "axes"),
    ],
)
def test_a_wrong_file_names_its_field(tmp_path, change, where: str) -> None:
    data = json.loads((MODELS / "kuka-kr16-2.json").read_text())
    change(data)
    (tmp_path / "bad.json").write_text(json.dumps(data))
    with pytest.raises(EchoBaseError) as error:
        load_robot("bad", tmp_path)
    assert {issue.code for issue in error.value.issues} == {"robot-file"}
    assert any(where in issue.where for issue in error.value.issues)
