"""Nearest triangles and followed feet against libigl's tree and against feet asked afresh."""

import igl
import numpy as np
import pytest

from planner.surface.follow import Follower
from planner.surface.nearest import Triangles
from tests.alignment.clouds import curved_of
from tests.loop.surfaces import ParamSurface, cylinder, wing

GROOVE = ParamSurface(
    lambda u, v: np.stack([u, v, 25.0 * np.cos(u / 9.0)], 1), (-90.0, 90.0), (-40.0, 40.0)
)  # walls closer to each other than a standoff


def slivers(rng):
    """A height field over scattered points with a coarse and a fine half, cut into any triangles."""
    from scipy.spatial import Delaunay  # noqa: PLC0415

    fine, coarse = rng.uniform([0, 0], [50, 100], (4000, 2)), rng.uniform([50, 0], [150, 100], (60, 2))
    xy = np.vstack([fine, coarse])
    return np.column_stack([xy, 6.0 * np.sin(xy[:, 0] / 12.0)]), Delaunay(xy).simplices.astype(np.int64)


def meshes():
    rng = np.random.default_rng(3)
    yield "wing", *wing(300).mesh(121, 61)
    yield "groove", *GROOVE.mesh(181, 81)
    yield "slivers", *slivers(rng)


@pytest.mark.parametrize(("vertices", "faces"), [m[1:] for m in meshes()], ids=[m[0] for m in meshes()])
@pytest.mark.parametrize("off_mm", [0.0, 1.0, 15.0, 60.0])
def test_nearest_triangles_are_those_of_a_tree_over_boxes(vertices, faces, off_mm):
    faces = np.ascontiguousarray(faces, dtype=np.int64)
    rng = np.random.default_rng(int(off_mm))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    # Over the surface, beside it and under it.
    query = vertices[rng.integers(0, len(vertices), 800)] + rng.normal(0, 1, (800, 3)) * off_mm
    query = np.vstack([query, rng.uniform(low - off_mm, high + off_mm, (400, 3))])
    found = Triangles(vertices, faces, fine_faces=1).nearest(query)
    tree = igl.AABB()
    tree.init(vertices, faces)
    squared, _, _ = tree.squared_distance(vertices, faces, query)
    at = np.einsum("nk,nkj->nj", found.bary, vertices[faces[found.face]])
    assert np.linalg.norm(query - at, axis=1) == pytest.approx(np.sqrt(squared), abs=1e-9)


@pytest.mark.parametrize("surface", [wing(300), cylinder(60, 200, 80), GROOVE], ids=["wing", "cylinder", "groove"])
def test_followed_feet_are_the_feet_asked_afresh(surface):
    curved = curved_of(surface, 201, 101)
    assert curved.triangles.is_fine
    rng = np.random.default_rng(7)
    u, v = rng.uniform(*surface.u, 600), rng.uniform(*surface.v, 600)
    start = surface.point(u, v) + 12.0 * surface.normal(u, v)
    follower = Follower(curved)
    for k in range(6):
        moved = start + 0.03 * k**2 * np.array([1.0, -0.7, 0.4])
        followed, asked = follower.closest(moved), curved.closest(moved)
        assert followed.distance_mm == pytest.approx(asked.distance_mm, abs=1e-6)
        assert (followed.interior == asked.interior).all()
        assert np.linalg.norm(followed.points - asked.points, axis=1).max() < 1e-4


def test_steps_to_a_foot_die_out_on_a_coarse_mesh():
    # Against the analytic cylinder: the foot of a point at radius 40 + 15 is on its own radius.
    surface = cylinder(40, 400, 30)
    curved = curved_of(surface, 41, 21)
    u, v = np.full(50, 200.0), np.linspace(surface.v[0] * 0.8, surface.v[1] * 0.8, 50)
    query = surface.point(u, v) + 15.0 * surface.normal(u, v)
    near = curved.triangles.nearest(query)
    foot, settled = curved.foot_from(query, near.face, near.bary)
    assert settled.all()
    offset = query - foot.points
    along = np.linalg.norm(np.cross(offset, foot.normals), axis=1)
    assert along.max() < 2e-5
    assert foot.distance_mm == pytest.approx(15.0, abs=2e-3)
