"""The checks as a whole: every figure against geometry worked out by hand, every sentence at its place."""

import numpy as np
import pytest
from scipy.integrate import quad

from planner.checks import check, check_path
from planner.checks.motion import path_flange_poses
from planner.checks.suggest import better_place
from planner.checks.ultrasound import bend_loss_db
from planner.frames import Transform
from planner.robot import load_robot
from planner.setup import Alignment, Base, Couplant, Fixture, Inspection, Pose, Probe, Setup, Tool
from planner.toolpath import Role
from tests.checks.parts import curved, path_on, sheet, with_block

TAUGHT = Base(x_mm=1150.0, z_mm=550.0)
TOOL = Tool(tcp=Pose(z_mm=200.0))


def flat(x, y):
    return 0.0 * x


def roof(x, y):
    """A cylinder of radius 300 about the x axis direction."""
    return np.sqrt(300.0**2 - y**2) - 300.0


def barrel(x, y):
    """A cylinder of radius 250 whose passes climb over it."""
    return np.sqrt(250.0**2 - x**2) - 250.0


def codes(issues) -> list[str]:
    return [issue.code for issue in issues]


def setup_of(**changes) -> Setup:
    return Setup(**({"base": TAUGHT, "tool": TOOL, "robot": "kuka-kr16-2"} | changes))


def test_a_good_path_has_nothing_to_say() -> None:
    surface = curved(sheet(flat))
    setup = setup_of()
    path = path_on(surface, flat, setup)
    found = check(surface, path, setup)
    assert found.issues == ()
    assert found.ok
    assert np.nanmax(found.tilt_deg) < 1e-6
    assert np.nanmax(np.abs(found.standoff_mm - 15.0)) < 1e-9
    assert np.isnan(found.tilt_deg).tolist() == (~path.is_data).tolist()
    assert found.reachable.all()
    assert found.summary()["reachable_share"] == 1.0
    assert check_path(surface, path, setup) == []


@pytest.mark.parametrize(("b_deg", "c_deg"), [(0.6, 0.0), (1.2, 0.0), (0.0, 1.7), (0.9, 0.9)])
def test_tilt_is_the_angle_between_beam_and_normal(b_deg: float, c_deg: float) -> None:
    surface = curved(sheet(flat))
    setup = setup_of()
    path = path_on(surface, flat, setup)
    turn = Transform.from_xyzabc("contact", "contact", [0, 0, 0, 30.0, b_deg, c_deg])
    tilted = path.take(slice(None))
    object.__setattr__(tilted, "Ts_part_contact", path.Ts_part_contact @ turn)
    found = check(surface, tilted, setup)
    wanted = np.degrees(np.arccos(np.cos(np.radians(b_deg)) * np.cos(np.radians(c_deg))))
    assert found.tilt_deg[path.is_data] == pytest.approx(wanted, rel=1e-6)
    assert ("tilt" in codes(found.issues)) == (wanted > 1.0)
    if wanted > 1.0:
        issue = next(issue for issue in found.issues if issue.code == "tilt")
        assert f"{path.is_data.sum()} of {path.is_data.sum()}" in issue.message
        assert f"{wanted:.2f}" in issue.message
        assert issue.where == "inspection pass 1 pose 3 (data)"


def test_standoff_off_by_two_is_said_once() -> None:
    surface = curved(sheet(flat))
    setup = setup_of()
    path = path_on(surface, flat, setup)
    moved = Transform.from_xyzabc("contact", "contact", [0.0, 0, 2.0, 0, 0, 0])
    object.__setattr__(path, "Ts_part_contact", path.Ts_part_contact @ moved)
    issues = [issue for issue in check(surface, path, setup).issues if issue.code == "standoff"]
    assert len(issues) == 1
    assert "2.00 mm" in issues[0].message


@pytest.mark.parametrize("sagitta_mm", [0.001, 0.02, 0.0741, 0.15, 0.6])
def test_bend_loss_is_the_phase_sum_over_the_aperture(sagitta_mm: float) -> None:
    wavelength = 1.482 / 5.0
    phase = 2.0 * np.pi * 2.0 * sagitta_mm / wavelength
    real, imag = (quad(lambda t, f=f: f(phase * t * t), 0.0, 1.0, limit=200)[0] for f in (np.cos, np.sin))
    assert bend_loss_db(np.array([sagitta_mm]), wavelength)[0] == pytest.approx(
        -20.0 * np.log10(np.hypot(real, imag)), abs=1e-9
    )


def test_curvature_under_the_aperture_on_a_cylinder() -> None:
    surface = curved(sheet(roof, step_mm=2.0))
    setup = setup_of(couplant=Couplant(sound_speed_m_s=1482.0))
    path = path_on(surface, roof, setup, rows=(0.0,))
    found = check(surface, path, setup)
    # 15 x 0.6 mm = 9 mm across a radius of 300 mm: half of 9 squared over twice the radius.
    assert np.nanmedian(found.sagitta_mm) == pytest.approx(4.5**2 / 600.0, rel=0.02)
    # The array lies across the cylinder: at x mm a law tilts by x / 300 rad.
    assert np.nanmedian(found.effective_swath_mm) == pytest.approx(2.0 * 300.0 * np.radians(1.0), rel=0.02)
    assert "effective-swath" in codes(found.issues)
    assert next(i for i in found.issues if i.code == "effective-swath").severity == "info"
    big = setup_of(probe=Probe(aperture_elements=40, frequency_mhz=10.0), couplant=Couplant(sound_speed_m_s=1482.0))
    issue = next(i for i in check(surface, path, big).issues if i.code == "curvature-aperture")
    assert issue.severity == "warning"
    assert "fewer aperture elements" in issue.remedy


def test_along_a_cylinder_the_array_is_straight() -> None:
    surface = curved(sheet(barrel, step_mm=2.0))
    setup = setup_of()
    found = check(surface, path_on(surface, barrel, setup, rows=(0.0,), half_mm=80.0), setup)
    assert np.nanmin(found.effective_swath_mm) == pytest.approx(setup.probe.swath_mm)
    assert "effective-swath" not in codes(found.issues)


def test_poses_past_the_edge_are_not_judged_by_tilt() -> None:
    surface = curved(sheet(flat, 300.0, 200.0))
    setup = setup_of()
    path = path_on(surface, flat, setup, rows=(0.0,))
    beyond = Transform.from_xyzabc("contact", "contact", [100.0, 0, 0, 0, 0, 0])
    object.__setattr__(path, "Ts_part_contact", path.Ts_part_contact @ beyond)
    found = check(surface, path, setup)
    over = path.Ts_part_tcp.xyz_mm[:, 0] > 150.1
    assert np.isnan(found.tilt_deg[over]).all()
    assert np.isfinite(found.tilt_deg[path.is_data & ~over]).all()
    assert not {"tilt", "standoff"} & set(codes(found.issues))


def test_a_bracket_in_the_way_is_a_collision_with_its_place() -> None:
    bare = sheet(flat)
    part = with_block(bare, (40.0, -10.0, 0.0), (60.0, 10.0, 80.0))
    surface = curved(part, len(bare.faces))
    setup = setup_of()
    path = path_on(surface, flat, setup, rows=(-60.0, 0.0, 60.0))
    found = check(surface, path, setup)
    issue = found.issues[0]
    assert (issue.severity, issue.code) == ("error", "collision-nozzle")
    assert issue.where.startswith("inspection pass 2 pose")
    tcp = path.Ts_part_tcp.xyz_mm
    near = (np.abs(tcp[:, 1]) < 30.0) & (np.abs(tcp[:, 0] - 50.0) < 29.0) & path.is_data
    assert (found.clearance_mm[near] < 0.0).all()
    assert (found.clearance_mm[path.pass_id == 0][:-1] > 0.0).all()
    assert not found.ok


def test_a_short_tool_brings_the_wrist_into_a_wall() -> None:
    bare = sheet(flat)
    part = with_block(bare, (-140.0, 90.0, 0.0), (140.0, 99.0, 600.0))
    surface = curved(part, len(bare.faces))
    setup = setup_of(tool=Tool(tcp=Pose(z_mm=60.0), nozzle_length_mm=50.0))
    found = check(surface, path_on(surface, flat, setup, rows=(0.0,)), setup)
    assert "collision-wrist" in codes(found.issues)
    assert found.wrist_clearance_mm.min() == pytest.approx(90.0 - 110.0, abs=0.5)
    assert found.clearance_mm[found.wrist_clearance_mm < 0].min() > 0.0


def test_the_wrist_follows_the_tool_as_taught() -> None:
    surface = curved(sheet(flat))
    along_x = Tool(beam_axis="x", array_axis="-z", tcp=Pose(z_mm=200.0, b_deg=-90.0))
    one, other = setup_of(), setup_of(tool=along_x)
    path = path_on(surface, flat, one)
    a, b = check(surface, path, one), check(surface, path, other)
    # Beam along taught +X, turned by B = -90 onto flange z: the same tool, so the same wrist.
    assert np.abs(a.wrist_clearance_mm - b.wrist_clearance_mm).max() < 1e-6


def test_far_away_is_an_error_when_taught_with_a_place_that_works() -> None:
    surface = curved(sheet(flat))
    setup = setup_of(base=Base(x_mm=2600.0, y_mm=300.0, z_mm=100.0), robot_root=Pose(x_mm=100.0, a_deg=30.0))
    path = path_on(surface, flat, setup)
    found = check(surface, path, setup)
    issue = next(issue for issue in found.issues if issue.code == "reach")
    assert issue.severity == "error"
    assert f"{len(path)} of {len(path)}" in issue.message
    assert "1611 mm" in issue.message
    words = issue.remedy.replace(",", "").split()
    shift = [float(words[words.index(axis) + 1]) for axis in "XYZ"]
    moved = setup.model_copy(
        update={"base": Base(x_mm=2600.0 + shift[0], y_mm=300.0 + shift[1], z_mm=100.0 + shift[2])}
    )
    again = check(surface, path, moved)
    assert again.reachable.all()
    assert not [issue for issue in again.issues if issue.severity == "error"]


def test_an_untaught_base_warns_once() -> None:
    surface = curved(sheet(flat))
    setup = setup_of(base=Base())
    issues = check_path(surface, path_on(surface, flat, setup), setup)
    about_robot = [issue for issue in issues if issue.code != "axis-speed-unknown"]
    assert codes(about_robot) == ["reach-untaught"]
    assert about_robot[0].severity == "warning"


def test_axis_limits_name_the_axis() -> None:
    surface = curved(sheet(flat))
    setup = setup_of(base=Base(x_mm=1100.0, z_mm=500.0), tool=Tool(tcp=Pose(x_mm=0, z_mm=150.0, b_deg=-179.0)))
    found = check(surface, path_on(surface, flat, setup), setup)
    issue = next(issue for issue in found.issues if issue.code in {"axis-limit", "reach"})
    assert issue.severity == "error"
    if issue.code == "axis-limit":
        assert "A" in issue.message.split(":")[1]


def test_axis_speed_is_the_difference_quotient_and_scales_with_the_scan() -> None:
    surface = curved(sheet(flat))
    slow = setup_of(inspection=Inspection(scan_speed_mm_s=100.0))
    path = path_on(surface, flat, slow)
    share = check(surface, path, slow).speed_share
    assert np.nanmax(share) < 1.0
    top = 100.0 / np.nanmax(share)
    fast = setup_of(inspection=Inspection(scan_speed_mm_s=min(2000.0, 1.2 * top)))
    found = check(surface, path, fast)
    if top < 1600.0:
        issue = next(issue for issue in found.issues if issue.code == "axis-speed")
        assert float(issue.remedy.split()[2]) == pytest.approx(top, abs=1.0)
    robot = load_robot("kuka-kr16-2")
    axes = found.axes_deg
    step = int(np.nanargmax(share))
    moved = np.linalg.norm(np.diff(path.Ts_part_tcp.xyz_mm, axis=0)[step])
    by_hand = (np.abs(axes[step + 1] - axes[step]) / (moved / 100.0) / robot.speeds_deg_s).max()
    assert np.nanmax(share) == pytest.approx(by_hand, rel=1e-9)
    assert np.isnan(share[path.role == Role.RETRACT]).all()


def test_unknown_axis_speeds_are_said() -> None:
    surface = curved(sheet(flat))
    setup = setup_of(robot="kuka-kr16-l6-2")
    issues = check_path(surface, path_on(surface, flat, setup), setup)
    assert codes(issues) == ["axis-speed-unknown"]
    assert "$machine.dat" in issues[0].remedy


def test_passing_the_wrist_singularity_is_a_jump() -> None:
    # With the tool bent by 43 deg the hand is in line with the forearm in mid-pass: A5 goes through zero, A4 whips round.
    surface = curved(sheet(flat))
    setup = setup_of(base=Base(x_mm=1200.0, y_mm=1.0, z_mm=500.0), tool=Tool(tcp=Pose(z_mm=200.0, c_deg=43.0)))
    path = path_on(surface, flat, setup, rows=(0.0,), spacing_mm=4.0)
    found = check(surface, path, setup)
    assert found.jumped.any()
    assert found.singular[found.jumped].all()
    jump = next(issue for issue in found.issues if issue.code == "axis-jump")
    assert jump.severity == "error"
    assert any(issue.code == "singularity-wrist" for issue in found.issues)
    assert any(issue.code == "axis-speed" for issue in found.issues)
    straight = setup.model_copy(update={"tool": Tool(tcp=Pose(z_mm=200.0, c_deg=20.0))})
    assert not check(surface, path, straight).jumped.any()


def test_the_fixture_must_fit_in_the_standoff_of_the_alignment_scan() -> None:
    surface = curved(sheet(flat))
    loose = setup_of(fixture=Fixture(sigma_mm=3.0, sigma_deg=4.0), base=Base())
    path = path_on(surface, flat, loose, kind="alignment", rows=(-90.0, 90.0), half_mm=140.0)
    found = check(surface, path, loose)
    lever = np.linalg.norm(path.Ts_part_contact.xyz_mm[:, :2], axis=1)
    assert found.fixture_mm == pytest.approx(2.0 * np.hypot(3.0, np.radians(4.0) * lever), rel=1e-9)
    issue = next(issue for issue in found.issues if issue.code == "fixture-standoff")
    wanted = float(issue.remedy.split()[3])
    higher = loose.model_copy(update={"alignment": Alignment(standoff_mm=wanted)})
    lifted = path_on(surface, flat, higher, kind="alignment", rows=(-90.0, 90.0), half_mm=140.0)
    assert "fixture-standoff" not in codes(check_path(surface, lifted, higher))
    inspection = path_on(surface, flat, loose, rows=(-90.0, 90.0), half_mm=140.0)
    assert "fixture-standoff" not in codes(check_path(surface, inspection, loose))


def test_fixture_reach_holds_for_drawn_offsets() -> None:
    surface = curved(sheet(barrel, step_mm=4.0))
    setup = setup_of(fixture=Fixture(sigma_mm=1.0, sigma_deg=0.8))
    path = path_on(surface, barrel, setup, kind="alignment", half_mm=120.0)
    found = check(surface, path, setup)
    rng = np.random.default_rng(6)
    shift = rng.normal(0, 1.0, (4000, 3))
    turn = rng.normal(0, np.radians(0.8), (4000, 3))
    contact = path.Ts_part_contact
    arm = contact.xyz_mm - surface.surface.centroid_part
    normal = contact.rotation_matrix[:, :, 2]
    moved = shift @ normal.T + np.einsum("kni,ni->kn", np.cross(turn[:, None], arm[None]), normal)
    assert 2.0 * moved.std(axis=0) == pytest.approx(found.fixture_mm, rel=0.06)


def test_better_place_of_a_path_already_in_reach_reaches_all_of_it() -> None:
    robot = load_robot("kuka-kr16-l6-2")
    surface = curved(sheet(flat))
    setup = setup_of(robot="kuka-kr16-l6-2", base=Base(x_mm=3500.0, y_mm=-2000.0, z_mm=-800.0))
    path = path_on(surface, flat, setup)
    move = better_place(robot, path_flange_poses(path, setup))
    assert move.share == 1.0


def test_an_empty_path_is_an_issue_and_no_crash() -> None:
    surface = curved(sheet(flat))
    setup = setup_of()
    path = path_on(surface, flat, setup).take(slice(0, 0))
    assert codes(check_path(surface, path, setup)) == ["path-empty"]
    single = path_on(surface, flat, setup).take(slice(5, 6))
    assert check_path(surface, single, setup) == []
