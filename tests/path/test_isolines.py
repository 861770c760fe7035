"""The cutter against closed forms and against trimesh."""

import numpy as np
import pytest
import trimesh

from planner.path.isolines import Chains, isolines, neighbours


def ends(chains: Chains, vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    corner = vertices[faces[chains.face]]
    return tuple(np.einsum("mk,mkj->mj", b, corner) for b in (chains.bary_in, chains.bary_out))


def test_sphere_sections_are_closed_circles_of_the_right_length() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=50.0)
    levels = np.array([-40.0, -7.5, 0.0, 30.0])
    cut = isolines(ball.vertices[:, 2].copy(), ball.faces, neighbours(ball.faces), levels)
    assert cut.closed.all()
    assert cut.level.tolist() == [0, 1, 2, 3]
    a, b = ends(cut, ball.vertices, ball.faces)
    length = np.bincount(cut.chain, np.linalg.norm(b - a, axis=1))
    assert length == pytest.approx(2 * np.pi * np.sqrt(50.0**2 - levels**2), rel=2e-3)


def test_chains_are_walked_end_to_end_with_higher_values_on_the_left() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=50.0)
    cut = isolines(ball.vertices[:, 2].copy(), ball.faces, neighbours(ball.faces), np.linspace(-45, 45, 31))
    a, b = ends(cut, ball.vertices, ball.faces)
    same = cut.chain[1:] == cut.chain[:-1]
    assert np.abs(a[1:] - b[:-1])[same].max() < 1e-9
    left = np.cross((a + b) / 2.0, b - a)  # outward x travel
    assert (left[:, 2] > -1e-9).all()


def test_levels_through_vertices_lose_nothing() -> None:
    """Levels that hit grid vertices and whole edges exactly: each line still runs from side to side, once."""
    n = 21
    x, y = np.meshgrid(np.arange(n, dtype=float), np.arange(n, dtype=float), indexing="ij")
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    cut = isolines(vertices[:, 1].copy(), faces, neighbours(faces), np.arange(1.0, n))
    p, q = ends(cut, vertices, faces)
    length = np.bincount(cut.chain, np.linalg.norm(q - p, axis=1))
    assert length == pytest.approx(np.full(n - 1, n - 1.0))


def test_total_length_agrees_with_trimesh_on_a_torus() -> None:
    """Sections of a torus are two loops or one, some re-entrant."""
    ring = trimesh.creation.torus(60.0, 20.0, major_sections=90, minor_sections=40)
    heights = np.array([-75.0, -39.3, 1.7, 50.1])
    cut = isolines(ring.vertices[:, 0].copy(), ring.faces, neighbours(ring.faces), heights)
    a, b = ends(cut, ring.vertices, ring.faces)
    ours = np.bincount(cut.level[cut.chain], np.linalg.norm(b - a, axis=1))
    theirs = [ring.section(plane_origin=[h, 0, 0], plane_normal=[1, 0, 0]).length for h in heights]
    assert ours == pytest.approx(theirs, rel=1e-9)
    assert cut.closed.all()
    assert np.bincount(cut.level).tolist() == [1, 2, 2, 1] or np.bincount(cut.level).tolist() == [1, 1, 2, 1]


def test_edges_shared_by_three_triangles_end_the_walk() -> None:
    vertices = np.array([[0, 0, 0], [0, 10, 0], [5, 5, 0], [-5, 5, 0], [0, 5, 5.0]])
    faces = np.array([[0, 1, 3], [1, 0, 2], [0, 1, 4]])
    cut = isolines(vertices[:, 1].copy(), faces, neighbours(faces), np.array([4.0]))
    assert len(cut.level) == 3
    assert not cut.closed.any()
