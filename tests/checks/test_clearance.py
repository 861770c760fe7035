"""Clearance of nozzle and wrist against a brute-force count over dense points of the part."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.checks.clearance import Envelope, clearance_mm, cylinder_distance_mm
from planner.checks.collision import path_clearance, spline_bulge_mm
from planner.frames import Transform
from planner.setup import Setup
from planner.surface.solid import Solid, solid_of
from planner.toolpath import Role
from tests.checks.parts import curved, path_on, sheet, surface_samples, with_block

RADIUS, LENGTH = 20.0, 120.0


def flat(x, y):
    return 0.0 * x


def bowl(x, y):
    return 200.0 - np.sqrt(200.0**2 - x**2 - y**2)


def ridges(x, y):
    return 12.0 * np.cos(x / 18.0) * np.cos(y / 25.0)


def brute(part, poses: Transform) -> np.ndarray:
    """Return the smallest distance of 1.2 mm samples of the part from the cylinder, pose by pose."""
    points = surface_samples(part, 1.2)
    return np.array(
        [cylinder_distance_mm(poses[i].inv().rigid.apply(points), RADIUS, LENGTH).min() for i in range(len(poses))]
    )


@pytest.mark.parametrize("shape", [flat, bowl, ridges])
def test_clearance_is_a_lower_bound_or_measured_and_finds_every_collision(shape) -> None:
    part = sheet(shape, 160.0, 160.0, 4.0)
    rng = np.random.default_rng(1)
    n = 60
    at = np.column_stack([rng.uniform(-50, 50, (n, 2)), np.zeros(n)])
    at[:, 2] = shape(at[:, 0], at[:, 1]) + rng.uniform(-6.0, 25.0, n)
    tilt = Rotation.from_euler(
        "xyz",
        np.column_stack([180 + rng.normal(0, 12, (n, 1)), rng.normal(0, 12, (n, 1)), 0 * at[:, :1]]),
        degrees=True,
    )
    poses = Transform.from_parts("part", "tcp", tilt, at)
    found, _ = clearance_mm(Solid(part), poses, Envelope(RADIUS, LENGTH))
    truth = brute(part, poses)
    above = at[:, 2] > shape(at[:, 0], at[:, 1])
    clear = above & (found >= 2.0)
    assert (found[clear] <= truth[clear] + 0.2).all()
    assert (found[truth < -0.5] < 0.0).all()
    assert (found[(truth > 0.5) & above] > 0.0).all()
    assert (truth < -0.5).sum() > 10
    assert (truth > 3.0).sum() > 3
    near = above & (found < 2.0)
    assert np.abs(found - truth)[near & (truth > 0.0)].max() < 0.5
    assert np.abs(found - truth)[near].max() < 2.0


def test_on_a_flat_part_the_bound_is_as_tight_as_it_says() -> None:
    solid = Solid(sheet(flat, 1500.0, 1500.0, 50.0))
    for gap in (3.0, 5.0, 15.0, 40.0):
        pose = Transform.from_xyzabc("part", "tcp", [[0.0, 0.0, gap, 0.0, 180.0, 0.0]])
        found, wrist = clearance_mm(solid, pose, Envelope(RADIUS, LENGTH, np.array([0.0, 0.0, -300.0]), 80.0))
        assert gap - RADIUS**2 / LENGTH - 1e-9 <= found[0] <= gap
        assert wrist[0] == pytest.approx(gap + 220.0)


def test_a_nozzle_deep_in_the_material_is_not_clear() -> None:
    block = with_block(sheet(flat, 20.0, 20.0, 10.0), (-500.0, -500.0, -1000.0), (500.0, 500.0, -10.0))
    poses = Transform.from_xyzabc("part", "tcp", [[0, 0, -500, 0, 180, 0], [0, 0, 30, 0, 180, 0]])
    found, _ = clearance_mm(solid_of(block), poses, Envelope(RADIUS, LENGTH))
    assert found[0] < -300.0
    assert found[1] > 0.0


def test_inside_near_a_sharp_edge() -> None:
    block = Solid(with_block(sheet(flat, 20.0, 20.0, 10.0), (100.0, 0.0, 0.0), (200.0, 100.0, 100.0)))
    rng = np.random.default_rng(3)
    points = rng.uniform([80.0, -20.0, -20.0], [220.0, 120.0, 120.0], (3000, 3))
    truth = ((points > [100.0, 0.0, 0.0]) & (points < [200.0, 100.0, 100.0])).all(axis=1)
    assert (block.inside(points) == truth).all()


def test_a_block_between_two_poses_is_found() -> None:
    # A post 6 mm wide stands 8 mm off the poses on either side of it, in the way of the nozzle between them.
    part = with_block(sheet(flat, 400.0, 200.0, 20.0), (-3.0, -3.0, 0.0), (3.0, 3.0, 60.0))
    surface = curved(part, len(part.faces) - 12)
    setup = Setup()
    path = path_on(surface, flat, setup, rows=(0.0,), half_mm=90.0, spacing_mm=180.0)
    assert len(path) == 4
    ends, _ = clearance_mm(solid_of(part), path.Ts_part_tcp, Envelope(RADIUS, LENGTH))
    assert ends.min() > 0.0
    found = path_clearance(solid_of(part), path, Envelope(RADIUS, LENGTH), 0.0)
    assert found.nozzle_mm[1] < -2.0
    assert found.nozzle_mm[[0, 2, 3]].min() > 0.0
    away = path_on(surface, flat, setup, rows=(40.0,), half_mm=90.0, spacing_mm=180.0)
    assert path_clearance(solid_of(part), away, Envelope(RADIUS, LENGTH), 0.0).nozzle_mm.min() > 0.0


def test_between_poses_agrees_with_a_dense_look() -> None:
    part = sheet(ridges, 200.0, 160.0, 4.0)
    surface = curved(part)
    path = path_on(surface, ridges, Setup(standoff_mm=3.0), rows=(-10.0, 12.0), half_mm=84.0, spacing_mm=42.0)
    envelope = Envelope(8.0, 60.0)
    found = path_clearance(solid_of(part), path, envelope, 0.0)
    poses = path.Ts_part_tcp
    dense = []
    for i in range(len(path) - 1):
        share = np.linspace(0, 1, 25)[:, None]
        start, end = poses[i], poses[i + 1]
        turn = (start.rotation.inv() * end.rotation).as_rotvec()
        between = Transform.from_parts(
            "part",
            "tcp",
            start.rotation * Rotation.from_rotvec(share * turn),
            (1 - share) * start.xyz_mm + share * end.xyz_mm,
        )
        dense.append(clearance_mm(solid_of(part), between, envelope)[0].min())
    hit = np.array(dense) < 0.0
    assert hit.any()
    assert not hit.all()
    assert (found.nozzle_mm[:-1][hit] < 0.0).all()


def test_spline_bulge_of_points_on_a_circle_is_the_sagitta() -> None:
    surface = curved(sheet(flat))
    path = path_on(surface, flat, Setup(), rows=(0.0,), half_mm=100.0, spacing_mm=5.0)
    assert spline_bulge_mm(path).max() < 1e-9
    angle = np.linspace(0, np.pi / 2, len(path) - 2)
    angle = np.r_[angle[0], angle, angle[-1]]
    centre = np.column_stack([100 * np.cos(angle), 100 * np.sin(angle), np.zeros(len(path))])
    round_ = replace(
        path,
        Ts_part_contact=Transform.from_parts("part", "contact", path.Ts_part_contact.rotation, centre),
    )
    inner = spline_bulge_mm(round_)[4:-4]
    step = np.diff(angle)[5]
    assert inner == pytest.approx(100 * (1 - np.cos(step / 2)), rel=0.02)
    assert spline_bulge_mm(round_)[0] == 0.0
    assert round_.role[0] == Role.APPROACH


def test_cylinder_distance() -> None:
    points = np.array([[25.0, 0, -50], [0, 0, 3], [0, 0, -60], [19, 0, -60], [23, 0, 4], [0, 0, -130], [0, 0, -1]])
    assert cylinder_distance_mm(points, 20.0, 120.0) == pytest.approx([5.0, 3.0, -20.0, -1.0, 5.0, 10.0, -1.0])
