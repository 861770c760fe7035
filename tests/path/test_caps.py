"""Caps over holes: on the surface that would be there, and passes that do not notice the hole."""

import numpy as np
import pytest

from benchmarks.planning.panels import double_slope, double_z, height_panel, with_holes
from planner.path.decimate import decimate
from planner.path.holes import fill_holes
from planner.path.mesh import PathMesh
from planner.path.raster import raster
from tests.path.shapes import crystal, curved_of, plate


def holed(nu: int = 140, nv: int = 60):
    dome = height_panel("dome", double_z, double_slope, np.linspace(0, 1, nu), np.linspace(0, 1, nv))
    return with_holes(dome, ((-300.0, 50.0, 60.0), (400.0, -80.0, 90.0)), "two holes")


def test_a_cap_lies_on_the_surface_that_was_cut_away():
    mesh = PathMesh.of(holed().surface())
    filled = fill_holes(mesh)
    new = filled.vertices[len(mesh.vertices) :]
    assert len(new) > 100
    # A flat cap would be 6 mm off.
    assert np.abs(new[:, 2] - double_z(new[:, 0], new[:, 1])).max() < 0.05
    assert len(filled.boundary_edges) < len(mesh.boundary_edges)
    up = filled.face_normals[len(mesh.faces) :, 2]
    assert up.min() > 0.7
    whole = height_panel("dome", double_z, double_slope, np.linspace(0, 1, 140), np.linspace(0, 1, 60))
    assert filled.areas_mm2.sum() == pytest.approx(PathMesh.of(whole.surface()).areas_mm2.sum(), rel=1e-3)


def test_passes_beyond_a_hole_run_on_as_if_there_were_none():
    setup = crystal(strategy="geodesic", step_mm=5.0)
    path = raster(curved_of(holed()), setup)
    poses = len(decimate(path))
    length = np.bincount(path.take(path.is_data).pass_id).sum() * 2.0
    # One pose per 14 mm and six per pass; bent lines in the shadow of the holes took a third more.
    assert poses < 1.04 * (length / 14.0 + 6.0 * path.passes)


def test_a_sheet_without_holes_is_left_alone():
    mesh = PathMesh.of(plate().surface())
    assert len(fill_holes(mesh).faces) == len(mesh.faces)
