"""The inspection surface cut to a box and to paint: areas in closed form, truth of the new vertices, nothing torn."""

import numpy as np
import pytest
import trimesh

from planner.errors import EchoBaseError
from planner.setup import Setup
from planner.surface.choose import chosen_surface, clip_issues
from planner.surface.clip import is_chosen
from planner.surface.keepouts import PARENTS
from tests.surface.shapes import grid, part_of


def setup_of(**inspection):
    return Setup.model_validate({"inspection": inspection})


def block():
    """A solid of twelve triangles, 200 x 100 x 20 mm."""
    made = trimesh.creation.box(extents=[200.0, 100.0, 20.0])
    return part_of(made.vertices, made.faces)


def lens_mm2(r, s, d):
    """Area common to two circles of radii r, s with centres d apart."""
    a, b = (d * d + r * r - s * s) / (2 * d), (d * d + s * s - r * r) / (2 * d)
    return r * r * np.arccos(a / r) + s * s * np.arccos(b / s) - d * np.sqrt(r * r - a * a)


def test_a_box_cuts_twelve_triangles_exactly():
    box = {"min_mm": [-50.0, -20.0, 0.0], "max_mm": [30.0, 1000.0, 100.0]}
    surface = chosen_surface(block(), setup_of(box=box))
    assert surface.area_mm2 == pytest.approx(80.0 * 70.0, abs=1e-9)
    assert surface.mean_normal_part == pytest.approx([0.0, 0.0, 1.0])
    mesh = trimesh.Trimesh(surface.part.vertices, surface.part.faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4e5)


def test_without_a_seed_the_largest_surface_inside_the_box_is_meant():
    side = chosen_surface(block(), setup_of(box={"min_mm": [-90.0, -200.0, -8.0], "max_mm": [90.0, 0.0, 8.0]}))
    assert side.mean_normal_part == pytest.approx([0.0, -1.0, 0.0])
    assert side.area_mm2 == pytest.approx(180.0 * 16.0)


@pytest.mark.parametrize("shift", [0.0, 0.137])
def test_paint_on_two_triangles_has_the_area_of_its_circles(shift):
    paint = [
        {"centre_mm": [shift, 0.0, 10.0], "radius_mm": 30.0},
        {"centre_mm": [25.0 + shift, 0.0, 10.0], "radius_mm": 20.0},
        {"centre_mm": [0.0, shift, 10.0], "radius_mm": 5.0, "erase": True},
    ]
    surface = chosen_surface(block(), setup_of(paint=paint))
    truth = np.pi * (30.0**2 + 20.0**2) - lens_mm2(30.0, 20.0, 25.0) - np.pi * 5.0**2
    # Polygons with sides of a quarter radius lie inside their circles.
    assert surface.area_mm2 == pytest.approx(truth, rel=0.01)
    assert trimesh.Trimesh(surface.part.vertices, surface.part.faces, process=False).is_watertight


def test_new_vertices_lie_on_the_true_surface():
    def z(x, y):
        return -(x**2) / 4000.0 - y**2 / 1600.0

    part = part_of(*grid(np.linspace(-750, 750, 40), np.linspace(-250, 250, 16), z))
    box = {"min_mm": [-333.3, -111.1, -1000.0], "max_mm": [222.2, 177.7, 1000.0]}
    surface = chosen_surface(part, setup_of(box=box))
    v = surface.vertices
    sag = np.abs(
        part.vertices[part.faces].mean(axis=1)[:, 2] - z(*part.vertices[part.faces].mean(axis=1)[:, :2].T)
    ).max()
    assert sag > 0.2
    assert np.abs(v[:, 2] - z(v[:, 0], v[:, 1])).max() < 1e-3
    assert v[:, 0].min() == pytest.approx(-333.3, abs=0.06)
    assert v[:, 1].max() == pytest.approx(177.7, abs=0.06)


def test_the_same_choice_is_the_same_object_and_knows_where_its_triangles_come_from():
    part, setup = block(), setup_of(box={"min_mm": [-50.0, -20.0, 0.0], "max_mm": [30.0, 40.0, 100.0]})
    once, again = chosen_surface(part, setup), chosen_surface(part, setup)
    assert once is again
    parents = once.part.meta[PARENTS]
    assert (np.einsum("ij,ij->i", once.part.face_normals, part.face_normals[parents]) > 0.999).all()
    area = np.bincount(parents, once.part.face_areas_mm2)
    assert area == pytest.approx(part.face_areas_mm2)


def test_pieces_left_out_are_said_and_the_seed_chooses():
    paint = [{"centre_mm": [-60.0, 0.0, 10.0], "radius_mm": 20.0}, {"centre_mm": [60.0, 0.0, 10.0], "radius_mm": 25.0}]
    larger = chosen_surface(block(), setup_of(paint=paint))
    assert larger.centroid_part[0] == pytest.approx(60.0, abs=0.5)
    assert "surface-pieces" in {i.code for i in clip_issues(larger)}
    seeded = chosen_surface(block(), setup_of(paint=paint), [[-60.0, 0.0, 10.0]])
    assert seeded.centroid_part[0] == pytest.approx(-60.0, abs=0.5)


def test_a_box_beside_the_part_is_refused():
    with pytest.raises(EchoBaseError) as caught:
        chosen_surface(block(), setup_of(box={"min_mm": [500.0, 0.0, 0.0], "max_mm": [600.0, 1.0, 1.0]}))
    assert caught.value.issues[0].code == "surface-clipped"


def test_box_and_paint_say_of_any_point_whether_it_is_chosen():
    setup = setup_of(
        box={"min_mm": [0.0, 0.0, 0.0], "max_mm": [10.0, 10.0, 10.0]},
        paint=[{"centre_mm": [0.0, 0.0, 0.0], "radius_mm": 8.0}],
    )
    asked = np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [9.0, 1.0, 1.0]])
    assert is_chosen(setup.inspection, asked).tolist() == [True, False, False]
