"""Picking: against analytic intersections, far from the origin, and fast on a million triangles."""

import time

import numpy as np
import pytest
import trimesh

from app.view.picker import Picker, nearest_to_ray
from planner.part import Part, Provenance
from planner.surface.inspection import InspectionSurface
from tests.view.memory import height, normal, panel


def part_of(mesh):
    return Part(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int32), Provenance("x.stl", "0" * 64, "mm"))


def test_a_ray_meets_a_box_exactly_even_fifty_metres_out():
    mesh = trimesh.creation.box([150.0, 100.0, 10.0])
    mesh.apply_translation([50_000.0, -20_000.0, 7_000.0])
    hit = Picker(part_of(mesh), None).cast(np.array([50_030.0, -20_010.0, 8_000.0]), np.array([0.0, 0.0, -1.0]))
    assert hit is not None
    assert np.abs(hit.point - [50_030.0, -20_010.0, 7_005.0]).max() < 1e-6
    assert hit.normal.tolist() == [0.0, 0.0, 1.0]


def test_a_miss_is_none():
    assert (
        Picker(part_of(trimesh.creation.box()), None).cast(np.array([9.0, 9.0, 9.0]), np.array([0.0, 0.0, 1.0])) is None
    )


def test_only_the_inspection_surface_counts_as_on_it():
    part, surface = panel()
    picker = Picker(part, surface)
    from_above = picker.cast(np.array([37.0, 11.0, 500.0]), np.array([0.0, 0.0, -1.0]))
    from_below = picker.cast(np.array([37.0, 11.0, -500.0]), np.array([0.0, 0.0, 1.0]))
    assert from_above.on_surface
    assert not from_below.on_surface
    assert abs(from_above.point[2] - height(np.array(37.0), np.array(11.0))) < 0.1
    assert from_above.normal @ normal(np.array(37.0), np.array(11.0)) > 0.9999
    picker.use(InspectionSurface(part, np.arange(0, dtype=np.int32)))
    assert not picker.cast(np.array([37.0, 11.0, 500.0]), np.array([0.0, 0.0, -1.0])).on_surface


def test_markers_are_hit_in_order_of_depth():
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 50.0], [30.0, 0.0, 0.0]])
    ray = (np.array([1.0, 0.0, 100.0]), np.array([0.0, 0.0, -1.0]))
    assert nearest_to_ray(points, *ray, radius_mm=5.0) == 1
    assert nearest_to_ray(points, np.array([31.0, 0.0, 100.0]), ray[1], radius_mm=5.0) == 2
    assert nearest_to_ray(points, np.array([15.0, 0.0, 100.0]), ray[1], radius_mm=5.0) is None
    assert nearest_to_ray(np.zeros((0, 3)), *ray, radius_mm=5.0) is None


@pytest.mark.slow
def test_a_million_triangles_answer_in_milliseconds():
    picker = Picker(part_of(trimesh.creation.icosphere(subdivisions=8, radius=500.0)), None)
    rng = np.random.default_rng(3)
    aims = rng.uniform(-250.0, 250.0, (200, 3)) * [1.0, 1.0, 0.0]
    started = time.perf_counter()
    hits = [picker.cast(np.array([0.0, 0.0, 2000.0]), aim - [0.0, 0.0, 2000.0]) for aim in aims]
    each = (time.perf_counter() - started) / len(aims)
    assert all(h is not None and abs(np.linalg.norm(h.point) - 500.0) < 0.05 for h in hits)
    assert each < 0.02
