"""Which triangles are chosen, and where they end: on shapes whose faces and edges are known."""

import numpy as np
import pytest
import trimesh

from planner.errors import EchoBaseError
from planner.surface.boundary import EdgeKind, boundary, distance_to_boundary, edge_distance_mm
from planner.surface.facing import facing_issues
from planner.surface.select import inspection_surface
from tests.surface.shapes import grid, part_of, whole

UP = np.array([0.0, 0, 1])


def box(size=(150.0, 100.0, 10.0)):
    mesh = trimesh.creation.box(size)
    return part_of(mesh.vertices, mesh.faces)


def test_without_seeds_the_largest_face_and_of_two_the_one_that_faces_up():
    top = inspection_surface(box())
    assert top.area_mm2 == pytest.approx(15000.0)
    assert top.mean_normal_part @ UP == pytest.approx(1.0)
    assert inspection_surface(box(), up_part=(0, 0, -2)).mean_normal_part @ UP == pytest.approx(-1.0)


def test_a_seed_chooses_the_face_it_lies_on():
    side = inspection_surface(box(), seeds_part=[75.0, 10.0, 1.0])
    assert side.mean_normal_part.round(9).tolist() == [1, 0, 0]
    assert inspection_surface(box(), seeds_part=[[75.0, 10, 1], [75.0, -40, -3]]).area_mm2 == pytest.approx(1000.0)


@pytest.mark.parametrize(
    "seeds, code",
    [
        ([[0, 0, 7.5]], "seed-off-part"),
        ([[0, 0, 5], [0, 0, -5]], "seeds-apart"),
        ([[np.nan, 0, 5]], "seed-invalid"),
    ],
)
def test_seeds_that_choose_nothing_say_why(seeds, code):
    with pytest.raises(EchoBaseError) as error:
        inspection_surface(box(), seeds_part=seeds)
    assert [issue.code for issue in error.value.issues] == [code]


def test_seeds_on_touching_faces_give_their_union():
    both = inspection_surface(box(), seeds_part=[[0, 0, 5], [75, 0, 0]])
    assert both.area_mm2 == pytest.approx(16000.0)


def test_unmerged_patches_double_vertices_and_slivers_do_not_stop_the_flood():
    vertices, faces = grid(np.linspace(0, 100, 11), np.linspace(0, 60, 7), lambda x, y: x * y / 2000.0)
    soup = vertices[faces].reshape(-1, 3) + np.random.default_rng(0).uniform(-2e-6, 2e-6, (faces.size, 3))
    split = part_of(soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(inspection_surface(split).part_faces) == len(faces)
    # A triangle as thin as rounding whose own normal points anywhere.
    quad = np.array([[0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0], [50, 0, 2e-6], [0, -100, 0], [100, -100, 0.0]])
    thin = part_of(quad, [[0, 4, 2], [4, 1, 2], [0, 2, 3], [0, 1, 4], [0, 5, 1], [5, 6, 1]])
    assert len(inspection_surface(thin).part_faces) == 6


def test_an_edge_of_three_faces_is_a_crease_and_no_crash():
    vertices, faces = grid(np.linspace(0, 100, 3), np.linspace(0, 100, 3), lambda x, y: 0 * x)
    vertices = np.vstack([vertices, [[50.0, 50, 40]]])
    part = part_of(vertices, np.vstack([faces, [[3, 4, 9]]]))
    surface = inspection_surface(part)
    assert 0 < len(surface.part_faces) < 9
    assert sum(len(c) for c in boundary(surface)) > 3


def test_a_flood_through_fillets_stops_where_asked():
    angle = np.linspace(0, np.pi / 2, 31)
    profile = np.vstack([[[-80.0, 0]], np.stack([5 * np.sin(angle), 5 * np.cos(angle) - 5], axis=1), [[5.0, -60]]])
    vertices = np.array([[x, y, z] for x, z in profile for y in (0.0, 50.0)])
    i = np.arange(len(profile) - 1) * 2
    faces = np.concatenate([np.stack([i, i + 2, i + 3], axis=1), np.stack([i, i + 3, i + 1], axis=1)])
    part = part_of(vertices, faces)
    assert len(inspection_surface(part).part_faces) == len(faces)
    # Facets of 3 deg each, the first turned by 1.5 deg: seven of them within 20 deg.
    stopped = inspection_surface(part, max_turn_deg=20.0)
    assert stopped.area_mm2 == pytest.approx(80 * 50 + 250 * np.radians(21), rel=1e-3)


def test_a_sheet_that_faces_down_is_turned_and_says_so():
    vertices, faces = grid(np.linspace(0, 100, 3), np.linspace(0, 60, 3), lambda x, y: 0 * x)
    down = part_of(vertices, faces[:, ::-1])
    surface = inspection_surface(down)
    assert surface.mean_normal_part @ UP == pytest.approx(1.0)
    assert [i.code for i in facing_issues(surface, UP)] == ["sheet-turned"]
    assert facing_issues(inspection_surface(part_of(vertices, faces)), UP) == []
    bottom = inspection_surface(box(), seeds_part=[[0, 0, -5]])
    assert bottom.mean_normal_part @ UP == pytest.approx(-1.0)
    assert [i.code for i in facing_issues(bottom, UP)] == ["surface-faces-down"]


def test_the_rim_of_a_plate_is_one_convex_curve_with_the_surface_on_its_left():
    surface = inspection_surface(box())
    (curve,) = boundary(surface)
    assert curve.outer
    assert curve.length_mm == pytest.approx(500.0)
    assert set(curve.kind.tolist()) == {EdgeKind.CONVEX}
    assert (np.einsum("ij,ij->i", curve.conormals, curve.points) > 0).all()
    x, y = curve.points[:, 0], curve.points[:, 1]
    assert 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) == pytest.approx(15000.0)


def test_holes_are_curves_whose_conormals_point_into_them():
    mesh = trimesh.creation.annulus(20.0, 50.0, 10.0)
    surface = inspection_surface(part_of(mesh.vertices, mesh.faces), seeds_part=[[35.0, 0, 5]])
    outer, hole = boundary(surface)
    assert (outer.outer, hole.outer) == (True, False)
    assert (np.einsum("ij,ij->i", hole.conormals, hole.points) < -15).all()
    assert (np.einsum("ij,ij->i", outer.conormals, outer.points) > 45).all()


def test_a_step_up_is_concave_a_sheet_ends_free():
    vertices = np.array([[0, 0, 0], [0, 50, 0], [40, 0, 0], [40, 50, 0], [40, 0, 20], [40, 50, 20.0]])
    part = part_of(vertices, [[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]])
    surface = inspection_surface(part, seeds_part=[[10, 10, 0]])
    (curve,) = boundary(surface)
    middle = 0.5 * (curve.points + np.roll(curve.points, -1, axis=0))
    kinds = {tuple(np.round(m, 6)[:2].tolist()): int(k) for m, k in zip(middle, curve.kind, strict=True)}
    assert kinds == {
        (20.0, 0.0): EdgeKind.FREE,
        (40.0, 25.0): EdgeKind.CONCAVE,
        (20.0, 50.0): EdgeKind.FREE,
        (0.0, 25.0): EdgeKind.FREE,
    }


def test_closed_bodies_are_whole_and_have_no_boundary():
    mesh = trimesh.creation.icosphere(3, 50.0)
    surface = inspection_surface(part_of(mesh.vertices, mesh.faces))
    assert len(surface.part_faces) == len(mesh.faces)
    assert boundary(surface) == ()
    assert np.isinf(distance_to_boundary(surface)).all()
    assert np.isfinite(surface.mean_normal_part).all()


@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_distance_to_the_boundary_of_a_plate(jitter):
    x, y = np.linspace(0, 300, 61), np.linspace(0, 200, 41)
    surface = whole(*grid(x, y, lambda a, b: 0 * a, jitter))
    vx, vy = surface.vertices[:, 0], surface.vertices[:, 1]
    true = np.minimum(np.minimum(vx, 300 - vx), np.minimum(vy, 200 - vy))
    found = distance_to_boundary(surface)
    assert np.abs(found - true)[true < 20].max() < 1.0
    assert (found >= true - 1e-9).all()
    assert np.percentile(np.abs(found - true), 95) < 1.0
    assert np.abs(edge_distance_mm(boundary(surface), surface.vertices) - true).max() < 1e-9


def test_distance_runs_along_the_surface_not_across_a_gap():
    # A half pipe: its two long edges face each other 2R apart, the way around is pi R.
    phi, y = np.meshgrid(np.linspace(0, 1.9 * np.pi, 120), np.linspace(0, 400, 41), indexing="ij")
    _, faces = grid(np.arange(120), np.arange(41), lambda a, b: 0 * a)
    vertices = np.stack([-50 * np.cos(phi).ravel(), y.ravel(), 50 * np.sin(phi).ravel()], axis=1)
    surface = whole(vertices, faces)
    across = np.minimum(50 * phi, 50 * (1.9 * np.pi - phi)).ravel()
    true = np.minimum(across, np.minimum(y, 400 - y).ravel())
    found = distance_to_boundary(surface)
    assert np.abs(found - true).max() < 0.06 * true.max()
    assert np.abs(found - true)[true < 10].max() < 0.1


def test_of_two_plates_one_above_the_other_the_upper_is_meant():
    lower, upper = trimesh.creation.box(extents=[300, 80, 10]), trimesh.creation.box(extents=[300, 80, 10])
    upper.apply_translation([0, 0, 50])
    for pair in ((lower, upper), (upper, lower)):
        both = trimesh.util.concatenate(pair)
        surface = inspection_surface(part_of(both.vertices, both.faces))
        assert surface.centroid_part[2] == pytest.approx(55.0)
