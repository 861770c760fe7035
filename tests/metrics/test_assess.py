"""Figures of a scan: from arrays made by hand, and from simulated scans against the simulator's own truth."""

import numpy as np
import pytest

from alignment.cloud import PointCloud
from alignment.metrics import assess, compare
from alignment.metrics.feet import feet, search
from alignment.metrics.figures import centre_laws
from alignment.point_cloud import point_cloud
from alignment.simulator import Noise, Truth, simulate
from planner.errors import EchoBaseError
from planner.frames import Transform
from planner.setup import Probe, Setup
from planner.surface.curved import CurvedSurface
from tests.metrics.test_expected import Plane
from tests.simulator.cells import NO_OFFSET, looking_down, one_pass, plate, program, sheet

HERE = Transform.identity("base", "part")
SINGLE = Setup(probe={"elements": 1}, inspection={"step_mm": 2})


def cloud_of(x, distance, amplitude, lost_x=(), law=1) -> PointCloud:
    n, lost = len(x), np.asarray(lost_x, float)
    down, across = np.tile([0.0, 0, -1], (n, 1)), np.tile([0.0, 1, 0], (n, 1))
    index = np.arange(n, dtype=np.int32)
    return PointCloud(
        origins_base=np.column_stack([x, 0 * x, np.full(n, 15.0)]),
        beams_base=down,
        arrays_base=across,
        distance_mm=np.asarray(distance, float),
        amplitude_pct=np.asarray(amplitude, float),
        law=np.full(n, law, np.int32),
        pose_index=index,
        pass_id=np.zeros(n, np.int32),
        scan_id=np.zeros(n, np.int32),
        lost_origins_base=np.column_stack([lost, 0 * lost, np.full(len(lost), 15.0)]),
        lost_pose_index=np.zeros(len(lost), np.int32),
        lost_law=np.full(len(lost), law, np.int32),
    )


def test_figures_by_hand() -> None:
    x = np.linspace(-48, 48, 97)
    distance = 15 + 0.01 * x
    amplitude = np.where(np.arange(97) < 30, 30.0, 45.0)
    found = assess(cloud_of(x, distance, amplitude, lost_x=[0.0, 1.0, 2.0, 70.0]), Plane(), SINGLE, HERE).figures
    low, high = 20 * np.log10(30 / 50), 20 * np.log10(45 / 50)
    assert found.tof_range_mm == pytest.approx(0.96)
    assert found.tof_std_mm == pytest.approx(distance.std())
    assert found.db_range_db == pytest.approx(high - low)
    assert found.mean_abs_db == pytest.approx((30 * -low + 67 * -high) / 97)
    # Three firings on the part had no echo: they are not within 2 dB. The fourth is over-spray.
    assert found.within_2db == pytest.approx(67 / 100)
    assert found.over_spray == pytest.approx(1 / 101)


def test_what_lies_beside_the_part_is_counted_and_left_out() -> None:
    x = np.linspace(-60, 60, 121)
    distance = np.where(np.abs(x) < 50, 15.0, 18.0)
    result = assess(cloud_of(x, distance, np.where(np.abs(x) < 50, 50.0, 10.0)), Plane(), SINGLE, HERE)
    assert result.figures.over_spray == pytest.approx(22 / 121)
    assert result.figures.tof_range_mm == 0.0
    assert result.figures.db_range_db == 0.0
    np.testing.assert_array_equal(result.on_part, np.abs(x) < 50)


def test_bubbles_do_not_make_the_range() -> None:
    x = np.linspace(-49, 49, 197)
    distance = 15 + 0.5 * np.sin(x / 20)
    clean = assess(cloud_of(x, distance, np.full(197, 50.0)), Plane(), SINGLE, HERE)
    distance = distance.copy()
    distance[[0, 40, 41, 100, 196]] += [3, -6, -6, 9, -2]
    found = assess(cloud_of(x, distance, np.full(197, 50.0)), Plane(), SINGLE, HERE)
    assert found.figures.tof_range_mm == pytest.approx(clean.figures.tof_range_mm, abs=0.02)
    np.testing.assert_array_equal(np.flatnonzero(found.bubble), [0, 40, 41, 100, 196])
    assert any(issue.code == "bubbles" and issue.message.startswith("5 ") for issue in found.issues)
    # A step of the part is no bubble.
    step = assess(cloud_of(x, np.where(x > 0, 15.0, 17.0), np.full(197, 50.0)), Plane(), SINGLE, HERE)
    assert step.figures.tof_range_mm == pytest.approx(2.0)
    assert not step.bubble.any()


def test_a_simulated_scan_agrees_with_the_truth_it_was_made_from() -> None:
    part, surface = plate()
    curved = CurvedSurface(surface, 4.5)
    setup = Setup()
    offset = Transform.from_xyzabc("base", "basecorr", [0, 0, 0.8, 0, 1.0, 0.6])
    path = one_pass([-100, 0, 20], [100, 0, 20])
    scan = simulate(part, surface, path, setup, Truth(offset), Noise.none())
    T_base_part = Transform("base", "part", offset.rigid)
    result = assess(point_cloud([scan], setup), curved, setup, T_base_part)
    x = scan.Ts_scan_tcp.xyz_mm[:, 0]
    normal = offset.directions([0.0, 0, 1])
    true_distance = (scan.Ts_scan_tcp.xyz_mm - offset.points([0.0, 0, 5])) @ normal
    foot = offset.inv().points(scan.Ts_scan_tcp.xyz_mm - true_distance[:, None] * normal)
    on = np.abs(foot[:, 0]) < 75
    assert result.figures.over_spray == pytest.approx(1 - on.mean(), abs=0.003)
    assert result.figures.tof_std_mm == pytest.approx(true_distance[on].std(), rel=2e-3)
    assert result.figures.tof_range_mm == pytest.approx(np.ptp(true_distance[on]), abs=0.02)
    loss = 2.0 * 0.6**2 + 1.0 * 1.0**2
    inner = result.centre & (np.abs(result.feet_part[:, 0]) < 70)
    np.testing.assert_allclose(result.db[inner], -loss, atol=2e-3)
    np.testing.assert_allclose(result.expected_db[inner], -loss, atol=2e-3)
    np.testing.assert_allclose(result.deviation_mm[result.on_part], 0.0, atol=1e-6)
    assert np.abs(x).max() == 100


def test_after_against_before() -> None:
    x = np.linspace(-49, 49, 99)
    after = assess(cloud_of(x, 15 + 0 * x, np.full(99, 50.0 * 10 ** (-0.8 / 20))), Plane(), SINGLE, HERE).figures
    before = assess(cloud_of(x, 15 + 0 * x, np.full(99, 50.0 * 10 ** (-1.6 / 20))), Plane(), SINGLE, HERE).figures
    report = compare(after, before)
    assert report["improvement_pct"] == pytest.approx(50.0)
    assert set(report) == {"after", "before", "improvement_pct"}
    fields = {"over_spray", "tof_std_mm", "tof_range_mm", "db_range_db", "mean_abs_db", "within_2db"}
    assert set(report["after"]) == fields == set(report["before"])
    alone = compare(after, None)
    assert alone["before"] is None
    assert alone["improvement_pct"] is None


def test_unknown_amplitudes_are_null_not_zero() -> None:
    x = np.linspace(-49, 49, 99)
    found = assess(cloud_of(x, 15 + 0 * x, np.full(99, np.nan)), Plane(), SINGLE, HERE).figures.to_json()
    assert found["mean_abs_db"] is None
    assert found["within_2db"] is None
    assert found["tof_std_mm"] == 0.0


def test_scans_that_cannot_be_assessed() -> None:
    x = np.linspace(200, 300, 99)
    with pytest.raises(EchoBaseError, match="never met"):
        assess(cloud_of(x, 15 + 0 * x, 50 + 0 * x), Plane(), SINGLE, HERE)
    laser = cloud_of(x, 0 * x, 50 + 0 * x)
    with pytest.raises(EchoBaseError, match="surface points"):
        assess(PointCloud(**{**vars(laser), "beams_base": None}), Plane(), SINGLE, HERE)


def test_centre_laws() -> None:
    np.testing.assert_array_equal(centre_laws(Probe()), [25, 26])
    np.testing.assert_array_equal(centre_laws(Probe(elements=63)), [25])
    np.testing.assert_array_equal(centre_laws(Probe(elements=1)), [1])
    part, surface = plate()
    scan = simulate(part, surface, one_pass([0, 0, 20], [10, 0, 20]), Setup(), Truth(NO_OFFSET), Noise.none())
    result = assess(point_cloud([scan], Setup()), CurvedSurface(surface, 4.5), Setup(), HERE)
    assert result.centre.sum() == 2 * len(scan.Ts_scan_tcp)


def test_feet_between_searched_laws_are_those_of_a_search() -> None:
    def cylinder(u, v):
        return np.stack([120 * np.sin(u / 120), v, 120 * np.cos(u / 120)], axis=1)

    part, surface = sheet(cylinder, 41, 31, (-60.0, 60.0), (-75.0, 75.0))
    curved = CurvedSurface(surface, 4.5)
    # Travel along the axis: the array lies across the curvature, and runs over the rim of the sheet.
    for x in (0.0, 58.0):
        tilt = np.arcsin(x / 135)
        poses = looking_down(
            np.array([[x, -10, 135 * np.cos(tilt)], [x, 10, 135 * np.cos(tilt)]]), np.array([0.0, 1, 0])
        )
        scan = simulate(
            part, surface, program(poses, [False, True]), Setup(), Truth(NO_OFFSET), Noise(lost_deg=60, floor_db=0)
        )
        cloud = point_cloud([scan], Setup())
        found, exact = feet(cloud, curved, HERE.inv(), Setup().probe), search(curved, cloud.origins_base)
        np.testing.assert_array_equal(found.interior, exact.interior)
        inside = exact.interior
        np.testing.assert_allclose(found.distance_mm[inside], exact.distance_mm[inside], atol=1e-4)
        np.testing.assert_allclose(found.points[inside], exact.points[inside], atol=5e-3)
        radius = np.hypot(cloud.origins_base[inside, 0], cloud.origins_base[inside, 2])
        np.testing.assert_allclose(found.distance_mm[inside], radius - 120, atol=2e-3)
        assert exact.interior.all() == (x == 0.0)
