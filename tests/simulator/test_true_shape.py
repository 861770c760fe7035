"""The smooth truth behind triangles, against surfaces with a formula."""

import numpy as np
import pytest

from alignment.simulator import Noise, Truth, simulate, spring_back_field
from alignment.simulator.body import true_body
from planner.setup import Setup
from tests.simulator.cells import NO_OFFSET, looking_down, one_pass, plate, program, sheet

R = 400.0
EXTENT = ((-200.0, 200.0), (-150.0, 150.0))


def cylinder(u, v):
    return np.stack([R * np.sin(u / R), v, R * np.cos(u / R)], axis=1)


def sphere(u, v):
    return np.stack([u, v, np.sqrt(R * R - u * u - v * v)], axis=1)


def saddle(u, v):
    return np.stack([u, v, (u * u - v * v) / 2000.0], axis=1)


def cylinder_normal(p):
    return p * [1, 0, 1] / R


def sphere_normal(p):
    return p / R


def saddle_normal(p):
    n = np.stack([-p[:, 0] / 1000.0, p[:, 1] / 1000.0, np.ones(len(p))], axis=1)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("point", "normal"), [(cylinder, cylinder_normal), (sphere, sphere_normal), (saddle, saddle_normal)]
)
@pytest.mark.parametrize(("nu", "nv", "jitter"), [(21, 16, 0.0), (41, 31, 0.3), (120, 90, 0.3)])
def test_distance_normal_and_foot_of_curved_sheets(point, normal, nu: int, nv: int, jitter: float) -> None:
    _, surface = sheet(point, nu, nv, *EXTENT, jitter)
    face = true_body(surface, None, None).face
    random = np.random.default_rng(1)
    foot = point(random.uniform(-170, 170, 20_000), random.uniform(-125, 125, 20_000))
    n = normal(foot)
    found, found_n = face.foot(foot + 15.0 * n)
    distance = np.einsum("ij,ij->i", foot + 15.0 * n - found, found_n)
    assert np.abs(distance - 15.0).max() < 2e-3
    assert np.degrees(np.linalg.norm(np.cross(found_n, n), axis=1)).max() < 0.06


def test_long_strips_of_a_cylinder_are_round() -> None:
    """STEP readers cut a cylinder into strips as long as the part."""
    _, surface = sheet(cylinder, 21, 2, *EXTENT)
    face = true_body(surface, None, None).face
    u = np.random.default_rng(1).uniform(-170, 170, 5_000)
    foot = cylinder(u, np.linspace(-140, 140, len(u)))
    found, _ = face.foot(foot + 15.0 * cylinder_normal(foot))
    assert np.abs(np.hypot(found[:, 0], found[:, 2]) - R).max() < 2e-3


def test_flat_stays_flat_and_creases_stay_sharp() -> None:
    _, surface = plate()
    body = true_body(surface, None, None)
    assert np.abs(body.face.corners[:, 2] - 5.0).max() == 0.0
    np.testing.assert_array_equal(body.face.normals, np.tile([0.0, 0.0, 1.0], (len(body.face.normals), 1)))
    assert np.isclose(np.abs(body.rest.normals).max(axis=1), 1.0).all()
    length = np.linalg.norm(body.face.rim_b - body.face.rim_a, axis=1).sum()
    assert length == pytest.approx(2 * (150 + 100))


def test_a_bent_plate_has_the_height_and_slope_of_its_field() -> None:
    _, surface = plate()
    field = spring_back_field(surface, "bend", 1.5)
    face = true_body(surface, field, None).face
    x = np.linspace(-70, 70, 500)
    above = np.stack([x, 0.3 * x, np.full_like(x, 20.0)], axis=1)
    found, normals = face.foot(above)
    np.testing.assert_allclose(found[:, 2], 5.0 + 1.5 * (found[:, 0] / 75.0) ** 2, atol=1e-4)
    np.testing.assert_allclose(-normals[:, 0] / normals[:, 2], 2 * 1.5 * found[:, 0] / 75.0**2, atol=1e-5)


@pytest.mark.parametrize("name", ["bend", "twist", "dent", "step", "bend-twist"])
def test_fields_reach_their_largest_displacement_and_no_more(name) -> None:
    _, surface = sheet(cylinder, 21, 16, *EXTENT)
    field = spring_back_field(surface, name, 2.0)
    random = np.random.default_rng(0)
    anywhere = cylinder(random.uniform(-200, 200, 20_000), random.uniform(-150, 150, 20_000))
    assert 1.9 < np.abs(field(anywhere)).max() < 2.005


def test_the_walls_follow_a_part_that_sprang_back() -> None:
    _, surface = plate()
    rest = true_body(surface, lambda p: np.full(len(p), 0.7), None).rest
    assert np.ptp(rest.corners[:, 2]) == pytest.approx(10.0)
    assert rest.corners[:, 2].max() == pytest.approx(5.7)


def test_the_spring_back_of_the_command_line_shows_in_the_distances() -> None:
    part, surface = plate()
    scan = simulate(part, surface, one_pass([-70, 0, 20], [70, 0, 20]), Setup(), Truth(NO_OFFSET, 1.0), Noise.none())
    flat = simulate(part, surface, one_pass([-70, 0, 20], [70, 0, 20]), Setup(), Truth(NO_OFFSET), Noise.none())
    change = (flat.tof_us - scan.tof_us) * 1.48238 / 2
    assert 0.5 < np.nanmax(np.abs(change)) <= 1.0


def test_an_analytic_surface_takes_the_place_of_the_triangles() -> None:
    class Ball:
        def foot(self, points):
            n = points / np.linalg.norm(points, axis=1, keepdims=True)
            return R * n, n

    part, surface = sheet(sphere, 11, 9, *EXTENT)
    poses = looking_down(np.array([[-2.0, 1, R + 15], [2.0, 1, R + 15]]), np.array([1.0, 0, 0]))
    scan = simulate(
        part, surface, program(poses, [False, True]), Setup(), Truth(NO_OFFSET, surface=Ball()), Noise.none()
    )
    tcp, x_k = scan.Ts_scan_tcp, (np.arange(1, 51) - 25.5) * 0.6
    origins = tcp.xyz_mm[:, None] + x_k[:, None] * tcp.rotation_matrix[:, None, :, 0]
    expected = np.linalg.norm(origins, axis=2) - R
    np.testing.assert_allclose(scan.tof_us.reshape(-1, 50) * 1.48237995 / 2, expected, rtol=1e-6)
