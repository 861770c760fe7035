"""The smooth surface behind the triangles against the analytic one the vertices were taken from."""

import numpy as np
import pytest

from planner.setup import Probe
from planner.surface.curved import CurvedSurface, footprint_mm
from sample_parts.make_samples import aerofoil_normal, aerofoil_point, aerofoil_uv
from tests.surface.shapes import angle_deg, grid, normals_of, panel, saddle, samples, whole

X, Y = np.linspace(-750, 750, 58), np.linspace(-250, 250, 20)


def sphere_cap(x, y):
    return np.sqrt(400.0**2 - x * x - y * y)


def uneven(n: int, low: float, high: float):
    """Stations dense at one end: the last step is 30 times the first."""
    t = np.linspace(0, 1, n)
    return low + (high - low) * (np.expm1(3.4 * t) / np.expm1(3.4))


@pytest.mark.parametrize(
    "name, height, x, y, jitter, normal_deg, point_mm",
    [
        # 2,166 triangles on 1.5 x 0.5 m: their own normals are 1.8 deg off (p99), up to 0.33 mm below the surface.
        ("coarse panel", panel, X, Y, 0.0, 0.1, 0.005),
        ("irregular coarse panel", panel, X, Y, 0.3, 0.1, 0.01),
        ("uneven panel", panel, uneven(140, -750, 750), uneven(60, -250, 250), 0.0, 0.1, 0.02),
        ("fine panel", panel, np.linspace(-750, 750, 200), np.linspace(-250, 250, 70), 0.0, 0.01, 0.0002),
        ("saddle", saddle, X, Y, 0.3, 0.001, 1e-4),
        ("sphere", sphere_cap, np.linspace(-200, 200, 40), np.linspace(-200, 200, 40), 0.2, 0.01, 1e-3),
    ],
)
def test_points_and_normals_are_those_of_the_true_surface_to_its_edges(
    name, height, x, y, jitter, normal_deg, point_mm
):
    surface = whole(*grid(x, y, height, jitter))
    curved = CurvedSurface(surface, 4.5)
    face, bary = samples(surface, 20_000)
    points, normals = curved.evaluate(face, bary)
    truth = normals_of(height, points[:, 0], points[:, 1])
    gap = np.abs(points[:, 2] - height(points[:, 0], points[:, 1])) * truth[:, 2]
    assert np.percentile(angle_deg(normals, truth), 99) <= normal_deg
    assert np.percentile(gap, 99) <= point_mm
    at_edge = np.abs(points[:, 0]) > np.abs(x).max() - 20
    assert at_edge.sum() > 50
    assert np.percentile(angle_deg(normals, truth)[at_edge], 95) <= 1.5 * normal_deg


def test_a_plane_stays_a_plane():
    for x, y in ((np.array([0.0, 150]), np.array([0.0, 100])), (uneven(30, 0, 150), np.linspace(0, 100, 9))):
        surface = whole(*grid(x, y, lambda a, b: 0.0 * a + 10.0))
        curved = CurvedSurface(surface, 4.5)
        points, normals = curved.evaluate(*samples(surface, 500))
        assert np.abs(points[:, 2] - 10.0).max() < 1e-12
        assert np.abs(normals - [0, 0, 1]).max() < 1e-12
        assert curved.chord_error_mm < 1e-12
        assert np.abs(curved.shape_operator(*samples(surface, 500))).max() < 1e-12


def test_a_hole_does_not_tilt_the_normals_around_it():
    vertices, faces = grid(np.linspace(-100, 100, 41), np.linspace(-100, 100, 41), lambda x, y: (x * x + y * y) / 400.0)
    centre = vertices[faces].mean(axis=1)
    surface = whole(vertices, faces[np.hypot(centre[:, 0] - 20, centre[:, 1]) > 25])
    curved = CurvedSurface(surface, 4.5)
    truth = normals_of(lambda x, y: (x * x + y * y) / 400.0, surface.vertices[:, 0], surface.vertices[:, 1])
    # A quadric is met exactly but for the height being counted along another axis.
    assert angle_deg(curved.vertex_fit.normals, truth).max() < 0.06


def cylinder(radius, length, around, along=1, turn=1.2):
    phi, z = np.meshgrid(np.linspace(-turn, turn, around), np.linspace(0, length, along + 1), indexing="ij")
    _, faces = grid(np.arange(around), np.arange(along + 1), lambda x, y: 0.0 * x)
    vertices = np.stack([radius * np.sin(phi).ravel(), z.ravel(), radius * np.cos(phi).ravel()], axis=1)
    return vertices, faces


def test_a_cylinder_of_long_slivers_has_its_radius_and_no_curvature_along():
    surface = whole(*cylinder(80.0, 300.0, 61))
    curved = CurvedSurface(surface, 4.5)
    face, bary = samples(surface, 4000)
    points, normals = curved.evaluate(face, bary)
    assert np.abs(np.hypot(points[:, 0], points[:, 2]) - 80.0).max() < 2e-3
    truth = points * [1, 0, 1] / np.hypot(points[:, 0], points[:, 2])[:, None]
    assert np.percentile(angle_deg(normals, truth), 99) < 0.02
    shape = curved.shape_operator(face, bary)
    assert np.abs(np.linalg.eigvalsh(shape)[:, 2] - 1 / 80.0).max() < 0.03 / 80.0
    assert np.abs(shape[:, 1, 1]).max() < 1e-5


def test_the_shape_operator_turns_the_normal_as_the_surface_does():
    surface = whole(*grid(np.linspace(-200, 200, 60), np.linspace(-200, 200, 60), sphere_cap, 0.2))
    curved = CurvedSurface(surface, 4.5)
    shape = curved.shape_operator(*samples(surface, 1000))
    values = np.linalg.eigvalsh(shape)
    assert np.abs(values[:, 0]).max() < 1e-12  # nothing along the normal
    assert np.abs(values[:, 1:] * 400.0 - 1.0).max() < 0.02
    assert np.abs(shape - shape.transpose(0, 2, 1)).max() < 1e-15


def test_a_measured_mesh_is_averaged_over_the_footprint():
    rng = np.random.default_rng(5)
    vertices, faces = grid(np.linspace(-60, 60, 201), np.linspace(-60, 60, 201), lambda x, y: x * x / 300.0)
    noisy = vertices + rng.normal(0, 0.01, len(vertices))[:, None] * [0, 0, 1]
    surface = whole(noisy, faces)
    curved = CurvedSurface(surface, 4.5)
    face, bary = samples(surface, 5000)
    points, normals = curved.evaluate(face, bary)
    truth = normals_of(lambda x, y: x * x / 300.0, points[:, 0], points[:, 1])
    raw = angle_deg(surface.face_normals[face], truth)
    assert np.sqrt(np.mean(angle_deg(normals, truth) ** 2)) < 0.1 * np.sqrt(np.mean(raw**2))
    assert np.std(points[:, 2] - points[:, 0] ** 2 / 300.0) < 0.005


@pytest.fixture(scope="module")
def aerofoil():
    u, v = np.linspace(0.06, 0.97, 80), np.linspace(0, 1, 40)
    _, faces = grid(v, u, lambda x, y: 0 * x)
    surface = whole(aerofoil_point(u[None, :], v[:, None]).reshape(-1, 3), faces)
    return CurvedSurface(surface, 4.5)


def test_feet_of_points_up_to_40_mm_off_the_aerofoil(aerofoil):
    rng = np.random.default_rng(2)
    u, v, height = rng.uniform(0.07, 0.96, 3000), rng.uniform(0.01, 0.99, 3000), rng.uniform(-40, 40, 3000)
    true, normal = aerofoil_point(u, v), aerofoil_normal(u, v)
    foot = aerofoil.closest(true + height[:, None] * normal)
    assert foot.interior.all()
    assert np.abs(foot.distance_mm - height).max() < 1e-3
    assert np.linalg.norm(foot.points - true, axis=1).max() < 0.02
    assert angle_deg(foot.normals, normal).max() < 0.03
    offset = true + height[:, None] * normal - foot.points
    along = offset - np.einsum("ij,ij->i", offset, foot.normals)[:, None] * foot.normals
    assert np.linalg.norm(along, axis=1).max() < 1e-4


def test_a_point_beyond_the_edge_has_no_foot_inside(aerofoil):
    edge, normal = aerofoil_point(0.06, 0.5), aerofoil_normal(0.06, 0.5)
    foot = aerofoil.closest(np.array([edge + 5 * normal + [0, -8.0, 0], edge + 5 * normal + [0, 8.0, 0]]))
    assert foot.interior.tolist() == [False, True]
    assert foot.distance_mm[0] > 8.0


def test_rays_end_on_the_true_surface(aerofoil):
    rng = np.random.default_rng(3)
    true = aerofoil_point(rng.uniform(0.1, 0.9, 2000), rng.uniform(0.05, 0.95, 2000))
    direction = np.stack([rng.uniform(-0.1, 0.1, 2000), rng.uniform(-0.1, 0.1, 2000), -np.ones(2000)], axis=1)
    face, bary, t = aerofoil.raycast(true - 25.0 * direction, direction)
    assert (face >= 0).all()
    assert np.abs(t - 25.0).max() < 1e-3
    points, _ = aerofoil.evaluate(face, bary)
    u, v = aerofoil_uv(points[:, 0], points[:, 1])
    assert np.abs(points - aerofoil_point(u, v)).max() < 1e-3
    missed = aerofoil.raycast(true[:3] + np.array([0, 0, 50.0]), np.array([[0.0, 0, 1]] * 3))
    assert missed[0].tolist() == [-1, -1, -1]
    assert np.isinf(missed[2]).all()


def test_unmerged_patches_give_the_same_surface():
    vertices, faces = grid(X, Y, panel)
    soup = vertices[faces].reshape(-1, 3)
    apart = CurvedSurface(whole(soup, np.arange(len(soup)).reshape(-1, 3)), 4.5)
    joined = CurvedSurface(whole(vertices, faces), 4.5)
    face, bary = samples(joined.surface, 500)
    assert np.abs(apart.evaluate(face, bary)[1] - joined.evaluate(face, bary)[1]).max() < 1e-9


def test_chord_error_is_the_gap_of_the_triangles():
    surface = whole(*cylinder(80.0, 50.0, 41, 4))
    half = 1.2 / 40
    assert CurvedSurface(surface, 4.5).chord_error_mm == pytest.approx(80.0 * (1 - np.cos(half)), rel=0.05)
    assert CurvedSurface(surface, 4.5).chord_angle_deg == pytest.approx(np.degrees(half), rel=0.1)


def test_footprint_of_the_papers_probe():
    assert footprint_mm(Probe()) == 4.5


@pytest.mark.parametrize("taper", [0.0, 0.12])
@pytest.mark.parametrize("sections", [24, 64])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("single", [False, True])
def test_a_tube_or_cone_of_two_rims_alone_has_its_normals_wherever_it_stands(taper, sections, turned, single):
    """CAD tessellations put no vertices between the rims: 400 mm long triangles, a few degrees round."""
    angle = np.linspace(0, 2 * np.pi, sections, endpoint=False)
    length = 400.0
    rims = [(80.0, 0.0), (80.0 - taper * length, length)]
    vertices = np.concatenate([np.stack([r * np.cos(angle), r * np.sin(angle), 0 * angle + z], 1) for r, z in rims])
    i, j = np.arange(sections), np.roll(np.arange(sections), -1)
    faces = np.concatenate([np.stack([i, j, j + sections], 1), np.stack([i, j + sections, i + sections], 1)])
    turn = np.eye(3)
    if turned:
        turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
    placed = vertices @ turn.T
    if single:
        placed = placed.astype(np.float32).astype(np.float64)  # as an STL holds it
    curved = CurvedSurface(whole(placed, faces), 4.5)
    points, normals = curved.evaluate(*samples(curved.surface, 5000))
    at = points @ turn
    radius = np.hypot(at[:, 0], at[:, 1])
    truth = np.stack([at[:, 0] / radius, at[:, 1] / radius, np.full(len(at), taper)], axis=1)
    truth /= np.linalg.norm(truth, axis=1, keepdims=True)
    # Triangles turn by 360 / sections; inside those of a cone, whose ends bend differently, a tenth to a quarter is left.
    left = 0.05 if taper == 0.0 else 0.25 * 360.0 / sections
    sag = 80.0 * (1.0 - np.cos(np.pi / sections))
    assert np.abs(radius - (80.0 - taper * at[:, 2])).max() < (0.1 if taper == 0.0 else 0.8) * sag + 0.005
    assert angle_deg(normals @ turn, truth).max() < left
    ends = np.concatenate([[0.0], np.full(2 * sections, taper)])[1:]
    rim = np.column_stack([np.tile(np.cos(angle), 2), np.tile(np.sin(angle), 2), ends])
    rim /= np.linalg.norm(rim, axis=1, keepdims=True)
    assert angle_deg(curved.vertex_fit.normals @ turn, rim).max() < 0.06 * 360.0 / sections
