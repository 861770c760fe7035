"""The surface laid flat: areas, places and values against shapes whose answer is known."""

import numpy as np
import pytest
import trimesh

from app.report.sheet import fill, sheet_of
from planner.part import Part, Provenance
from planner.surface.inspection import InspectionSurface


def surface_of(mesh: trimesh.Trimesh, keep) -> InspectionSurface:
    part = Part(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32), Provenance("x.stl", "0" * 64, "mm"))
    return InspectionSurface(part, np.flatnonzero(keep(mesh)).astype(np.int32))


def top_of_plate() -> InspectionSurface:
    return surface_of(trimesh.creation.box((150.0, 100.0, 10.0)), lambda m: m.face_normals[:, 2] > 0.9)


def tube(radius: float, height: float) -> InspectionSurface:
    mesh = trimesh.creation.cylinder(radius=radius, height=height, sections=180)
    return surface_of(mesh, lambda m: np.abs(m.face_normals[:, 2]) < 0.1)


def covered_mm2(sheet) -> float:
    return float(sheet.inside.sum()) * sheet.cell_mm**2


def test_a_plate_is_seen_from_above_in_its_own_size():
    sheet = sheet_of(top_of_plate())
    assert not sheet.unrolled
    assert covered_mm2(sheet) == pytest.approx(150.0 * 100.0, rel=0.01)
    np.testing.assert_allclose(sheet.uv(np.array([[10.0, -20.0, 5.0]])), [[10.0, -20.0]], atol=1e-9)
    assert sheet.title(0) == "CAD X (mm)"
    assert sheet.title(1) == "CAD Y (mm)"


def test_a_tube_is_unrolled_to_its_circumference():
    sheet = sheet_of(tube(60.0, 300.0))
    assert sheet.unrolled
    assert covered_mm2(sheet) == pytest.approx(2 * np.pi * 60.0 * 300.0, rel=0.02)
    # A quarter of a turn is a quarter of the circumference, wherever the seam is.
    angle = np.radians([10.0, 100.0])
    points = np.stack([60 * np.cos(angle), 60 * np.sin(angle), [0.0, 0.0]], axis=1)
    apart = abs(float(np.diff(sheet.uv(points)[:, 1])[0]))
    around = 2 * np.pi * 60.0
    assert min(apart, around - apart) == pytest.approx(around / 4, rel=0.01)


def test_a_hole_is_not_covered():
    ring = trimesh.creation.annulus(r_min=30.0, r_max=80.0, height=5.0, sections=240)
    sheet = sheet_of(surface_of(ring, lambda m: m.face_normals[:, 2] > 0.9))
    assert covered_mm2(sheet) == pytest.approx(np.pi * (80.0**2 - 30.0**2), rel=0.02)
    rows, columns = sheet.inside.shape
    assert not sheet.inside[rows // 2, columns // 2]


def test_values_stand_where_they_were_measured_and_nowhere_else():
    sheet = sheet_of(top_of_plate())
    x, y = (v.ravel() for v in np.meshgrid(np.arange(-70.0, 0.0, 2.0), np.arange(-45.0, 46.0, 2.0)))
    found = fill(sheet, np.stack([x, y, np.full_like(x, 5.0)], axis=1), 0.01 * x)
    columns = sheet.low[0] + sheet.cell_mm * (np.arange(found.shape[1]) + 0.5)
    known = np.isfinite(found)
    error = np.abs(found - 0.01 * columns)
    among = (columns > -69.0) & (columns < -3.0)
    assert np.nanmax(error[:, among]) < 0.01 * 1.0, "half the distance of the readings"
    # Beyond the last reading only one and a half times as far as the readings are apart, and a cell.
    assert columns[known.any(axis=0)].max() < -2.0 + 3.0 + sheet.cell_mm
    assert error[known].max() < 0.01 * (3.0 + sheet.cell_mm)
    assert known[:, columns < -5.0].mean() > 0.85


def test_the_same_surface_gives_the_same_sheet():
    a, b = sheet_of(tube(40.0, 90.0)), sheet_of(tube(40.0, 90.0))
    np.testing.assert_array_equal(a.inside, b.inside)
    np.testing.assert_array_equal(a.low, b.low)
