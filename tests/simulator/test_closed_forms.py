"""The simulated scanner against what can be worked out by hand."""

import numpy as np
import pytest

from alignment.simulator import Noise, Truth, simulate
from planner.couplant import water_speed_m_s
from planner.frames import Transform
from planner.setup import Setup
from tests.simulator.cells import NO_OFFSET, looking_down, one_pass, part_of, plate, program

SETUP = Setup()
LAWS = SETUP.probe.laws
X_K = (np.arange(1, LAWS + 1) - (LAWS + 1) / 2) * 0.6
PERFECT = Noise.none()


def distances(scan, setup=SETUP):
    c = (
        water_speed_m_s(setup.couplant.temperature_c)
        if setup.couplant.sound_speed_m_s is None
        else (setup.couplant.sound_speed_m_s)
    )
    return ((scan.tof_us - setup.couplant.delay_us) * c * 1e-3 / 2).reshape(-1, setup.probe.laws)


def amplitudes(scan):
    return scan.amplitude_pct.reshape(-1, LAWS)


def test_a_tilted_plate_gives_the_distance_to_its_plane_and_the_loss_of_its_tilt() -> None:
    part, surface = plate()
    offset = Transform.from_xyzabc("base", "basecorr", [1.1, -0.7, 1.0, 0.2, -0.8, 0.5])
    path = one_pass([-30, 4, 20], [30, 4, 20])
    scan = simulate(part, surface, path, SETUP, Truth(offset), PERFECT)
    tcp = scan.Ts_scan_tcp
    origins = tcp.xyz_mm[:, None] + X_K[:, None] * tcp.rotation_matrix[:, None, :, 0]
    normal = offset.directions([0.0, 0.0, 1.0])
    on_plane = offset.points([0.0, 0.0, 5.0])
    np.testing.assert_allclose(distances(scan), (origins - on_plane) @ normal, atol=1e-9)
    # Seen from the TCP the beam is -normal: its components along TCP x and y are the tilts B and C.
    x, y, z = (-(tcp.rotation_matrix[0].T @ normal)[i] for i in range(3))
    loss = 2.0 * np.degrees(np.arctan2(x, z)) ** 2 + 1.0 * np.degrees(np.arctan2(y, z)) ** 2
    assert 0.5 < loss < 5.0
    np.testing.assert_allclose(amplitudes(scan), 50.0 * 10 ** (-loss / 20), rtol=1e-9)


def test_the_two_axes_lose_what_their_coefficients_say_and_the_array_axis_sees_a_slope() -> None:
    part, surface = plate()
    for xyzabc, db in (([0, 0, 0, 0, 0, 1.0], 2.0), ([0, 0, 0, 0, 1.0, 0], 1.0)):
        # Travel along x, so the array lies along y: a turn about x (C) tilts the array axis (TCP B), one about y does not.
        tilt = Transform.from_xyzabc("base", "basecorr", xyzabc)
        scan = simulate(part, surface, one_pass([-5, 0, 20], [5, 0, 20]), SETUP, Truth(tilt), PERFECT)
        np.testing.assert_allclose(amplitudes(scan), 50.0 * 10 ** (-db / 20), rtol=1e-6)
        slope = np.ptp(distances(scan)[0]) / np.ptp(X_K)
        assert slope == pytest.approx(np.sin(np.radians(1.0)) if xyzabc[5] else 0.0, abs=1e-9)


def test_the_minus_6_db_crossing_lies_at_the_edge_under_the_beam_centre() -> None:
    part, surface = plate()
    setup = SETUP.model_copy(update={"inspection": SETUP.inspection.model_copy(update={"point_spacing_mm": 0.25})})
    scan = simulate(part, surface, one_pass([60, 3, 20], [85, 3, 20]), setup, Truth(NO_OFFSET), PERFECT)
    x = scan.Ts_scan_tcp.xyz_mm[:, 0]
    level = np.nan_to_num(amplitudes(scan)[:, LAWS // 2])
    crossing = np.interp(-25.0, -level, x)
    assert crossing == pytest.approx(75.0, abs=2e-3)
    # Half the beam width (-6 dB of the beam itself) inside the edge, a Gaussian keeps Phi(sqrt(2 ln 2)) of itself.
    assert np.interp(73.5, x, level) == pytest.approx(50.0 * 0.880516, abs=0.05)


def test_laws_beside_the_plate_are_lost_and_a_corner_keeps_a_quarter() -> None:
    part, surface = plate()
    scan = simulate(part, surface, one_pass([0, 50, 20], [75, 50, 20]), SETUP, Truth(NO_OFFSET), PERFECT)
    y = (scan.Ts_scan_tcp.points(np.zeros((len(scan.Ts_scan_tcp), 3)))[:, None] + X_K[:, None]
         * scan.Ts_scan_tcp.rotation_matrix[:, None, :, 0])[..., 1]  # fmt: skip
    middle = np.abs(scan.Ts_scan_tcp.xyz_mm[:, 0]) < 60
    level = np.nan_to_num(amplitudes(scan))[middle]
    order = np.argsort(y[0])
    crossing = np.interp(-25.0, -level[0][order], y[0][order])
    assert crossing == pytest.approx(50.0, abs=0.02)
    assert np.isnan(distances(scan)[middle][:, y[0] > 53.0]).all()
    single = Setup(probe={"elements": 1}, inspection={"step_mm": 2, "point_spacing_mm": 75})
    corner = simulate(part, surface, one_pass([0, 50, 20], [75, 50, 20]), single, Truth(NO_OFFSET), PERFECT)
    np.testing.assert_allclose(corner.amplitude_pct, [25.0, 12.5], rtol=1e-6)


def test_tilt_beyond_the_floor_stays_at_the_floor_and_a_wall_gives_no_echo() -> None:
    part, surface = plate()
    for angle, expected in ((5.0, 5.0), (12.0, np.nan)):
        truth = Truth(Transform.from_xyzabc("base", "basecorr", [0, 0, 0, 0, 0, angle]))
        scan = simulate(part, surface, one_pass([-5, 0, 20], [5, 0, 20]), SETUP, truth, PERFECT)
        np.testing.assert_allclose(amplitudes(scan), expected, rtol=1e-9)


def test_beside_the_inspected_face_a_lower_step_of_the_part_answers() -> None:
    lower, _ = plate(200, 100, 10)
    upper, _ = plate(100, 100, 10)
    part = part_of(
        np.concatenate([lower.vertices, upper.vertices + np.array([0, 0, 10])]),
        np.concatenate([lower.faces, upper.faces + len(lower.vertices)]),
    )
    top = (part.face_normals[:, 2] > 0.9) & (part.vertices[part.faces].mean(axis=1)[:, 2] > 10)
    surface = type(plate()[1])(part, np.flatnonzero(top).astype(np.int32))
    scan = simulate(part, surface, one_pass([0, 0, 30], [90, 0, 30]), SETUP, Truth(NO_OFFSET), PERFECT)
    x = scan.Ts_scan_tcp.xyz_mm[:, 0]
    np.testing.assert_allclose(distances(scan)[x < 48], 15.0, atol=1e-9)
    np.testing.assert_allclose(distances(scan)[x > 55], 25.0, atol=1e-6)
    assert np.nanmax(amplitudes(scan)[x > 55]) == pytest.approx(50.0)
    hidden = type(surface)(part, np.flatnonzero((part.face_normals[:, 2] > 0.9) & ~top).astype(np.int32))
    under = simulate(part, hidden, one_pass([0, 0, 30], [90, 0, 30]), SETUP, Truth(NO_OFFSET), PERFECT)
    # The upper block hides the lower face: its top answers first.
    np.testing.assert_allclose(distances(under)[x < 45], 15.0, atol=1e-6)


def test_taught_tool_axes_base_and_active_base_do_not_change_what_is_seen() -> None:
    part, surface = plate()
    path = one_pass([-30, 4, 20], [30, 4, 20])
    plain = simulate(part, surface, path, SETUP, Truth(NO_OFFSET), PERFECT)
    turned = Setup(tool={"beam_axis": "x", "array_axis": "y"})
    # The taught tool has the beam along +X and the array along +Y: its axes in EchoBase's TCP are x = z, y = x, z = y.
    taught = np.eye(4)
    taught[:3, :3] = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    poses = path.Ts_base_tcp @ Transform.from_matrix("tcp", "tcp", taught)
    same = simulate(part, surface, program(poses, path.data_on), turned, Truth(NO_OFFSET), PERFECT)
    np.testing.assert_allclose(same.tof_us, plain.tof_us, atol=1e-9)
    # A program in another BASE: its poses seen from there, the BASE named in the scan.
    setup = Setup(base={"x_mm": 800, "y_mm": 100, "z_mm": 300, "a_deg": 30, "b_deg": 5, "c_deg": -3})
    moved = setup.T_world_base @ Transform.from_xyzabc("base", "basecorr", [1, 2, 3, 1, 1, 1])
    inside = Transform("base", "tcp", (moved.inv() @ setup.T_world_base @ path.Ts_base_tcp).rigid)
    other = simulate(
        part, surface, program(inside, path.data_on), setup, Truth(NO_OFFSET), PERFECT, T_world_active=moved
    )
    np.testing.assert_allclose(other.tof_us, plain.tof_us, atol=1e-9)
    assert plain.T_world_scan is None
    np.testing.assert_allclose(other.T_world_scan.matrix, moved.matrix)


def test_placement_and_face_offset_count() -> None:
    part, surface = plate()
    setup = Setup(
        placement={"x_mm": 500, "y_mm": -200, "z_mm": 50, "a_deg": 90},
        probe={"face_offset_mm": 4, "reversed": True},
        couplant={"sound_speed_m_s": 1500, "delay_us": 3.5},
    )
    up = Transform.from_xyzabc("base", "basecorr", [0, 0, 2, 0, 0, 0])
    path = program(looking_down(np.array([[480.0, -200, 70], [520.0, -200, 70]]), np.array([1.0, 0, 0])), [False, True])
    scan = simulate(part, surface, path, setup, Truth(up), PERFECT)
    # Top at 50 + 5 + 2, TCP at 70, origins 4 behind it; half the plate is 50 along x after the quarter turn.
    np.testing.assert_allclose(distances(scan, setup), 70 - 57 + 4, atol=1e-9)


def test_warmer_water_than_believed_shortens_every_time() -> None:
    part, surface = plate()
    path = one_pass([-30, 4, 20], [30, 4, 20])
    warm = simulate(part, surface, path, SETUP, Truth(NO_OFFSET, temperature_error_c=2.0), PERFECT)
    np.testing.assert_allclose(warm.tof_us, 2 * 15.0 / (water_speed_m_s(22.0) * 1e-3), rtol=1e-12)
