"""Meshes for the screen, against shapes whose edges, groups and areas are known."""

import numpy as np
import trimesh

from app.view.glb import coloured_mesh
from app.view.meshes import creases, finer, lighter, split_smooth, vertex_normals


def arrays(mesh):
    return np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int32)


def test_a_box_has_twelve_edges_and_six_smooth_groups():
    found = creases(*arrays(trimesh.creation.box([150.0, 100.0, 10.0])))
    lengths = np.sort(np.linalg.norm(found.edges[:, 0] - found.edges[:, 1], axis=1))
    assert np.allclose(lengths, [10] * 4 + [100] * 4 + [150] * 4)
    assert len(set(found.smooth.tolist())) == 6


def test_a_sphere_has_no_edges_and_is_one_group():
    found = creases(*arrays(trimesh.creation.icosphere(subdivisions=3)))
    assert len(found.edges) == 0
    assert found.smooth.max() == 0


def test_an_open_sheet_shows_its_rim():
    v = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=float)
    found = creases(v, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    assert len(found.edges) == 4


def test_splitting_a_box_doubles_its_corners_and_keeps_its_area():
    vertices, faces = arrays(trimesh.creation.box([150.0, 100.0, 10.0]))
    v, f = split_smooth(vertices, faces, creases(vertices, faces).smooth)
    assert len(v) == 24
    assert np.isclose(trimesh.Trimesh(v, f, process=False).area, 2 * (150 * 100 + 150 * 10 + 100 * 10))
    # Shading then follows the faces: every vertex normal is an axis.
    assert np.allclose(np.abs(vertex_normals(v, f)).max(axis=1), 1.0)


def test_a_heavy_mesh_becomes_lighter_without_changing_its_shape():
    vertices, faces = arrays(trimesh.creation.icosphere(subdivisions=6, radius=100.0))
    v, f = lighter(vertices, faces, 20_000)
    assert 1000 < len(f) <= 20_000
    radius = np.linalg.norm(v, axis=1)
    assert radius.min() > 99.0
    assert radius.max() <= 100.0 + 1e-9


def test_a_coarse_face_becomes_fine_enough_for_a_map():
    v = np.array([[0, 0, 0], [150, 0, 0], [150, 100, 0], [0, 100, 0]], dtype=float)
    fine, faces = finer(v, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), cells=40)
    mesh = trimesh.Trimesh(fine, faces, process=False)
    assert mesh.edges_unique_length.max() <= 150 / 40 + 1e-9
    assert np.isclose(mesh.area, 150 * 100)


def test_the_glb_reads_back_with_another_reader():
    vertices, faces = arrays(trimesh.creation.icosphere(subdivisions=2))
    rgb = np.tile(np.array([[188, 0, 255]], dtype=np.uint8), (len(vertices), 1))
    import io  # noqa: PLC0415

    back = trimesh.load(io.BytesIO(coloured_mesh(vertices, faces, rgb)), file_type="glb", force="mesh", process=False)
    assert np.allclose(np.asarray(back.vertices), vertices, atol=1e-6)
    assert (np.asarray(back.faces) == faces).all()
