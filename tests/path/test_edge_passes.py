"""Passes along edges: what a raster leaves beside holes and at slanted edges is covered, or told exactly."""

import numpy as np
import pytest

from planner.checks.left import left_issues
from planner.path.coverage import coverage
from planner.path.mesh import PathMesh
from planner.path.raster import raster
from planner.toolpath import ToolPath
from tests.path.shapes import crystal, curved_of, drilled, plate, setup_of

SHAPES = {
    "small holes": drilled(300, 200, ((100, 80, 8), (220, 130, 8))),
    "holes": drilled(300, 200, ((100, 80, 20), (220, 130, 20))),
    "one large hole": drilled(300, 200, ((150, 100, 45),)),
    "bent, one large hole": drilled(300, 200, ((150, 100, 45),), radius=500.0),
    "trimmed corner": drilled(300, 200, trims=((45.0, 300.0),)),
    "slanted edge": drilled(300, 200, trims=((75.0, 240.0),)),
    "all of it": drilled(400, 300, ((80, 80, 6), (150, 200, 15), (300, 120, 30)), ((45.0, 420.0), (154.0, 10.0))),
}


def data_points(path: ToolPath) -> np.ndarray:
    return path.Ts_part_contact.xyz_mm[path.is_data]


@pytest.mark.parametrize("strategy", ["geodesic", "plane"])
@pytest.mark.parametrize("overlap", [0.0, 0.25])
@pytest.mark.parametrize("name", SHAPES)
def test_what_lies_outside_of_the_margin_is_reached_at_every_angle(name: str, overlap: float, strategy: str) -> None:
    """Without passes along edges up to 6 % are left, at 45 deg without overlap; with them no angle leaves 1 %."""
    for angle in (0.0, 20.0, 45.0, 70.0, 90.0):
        setup = setup_of(direction_deg=angle, overlap=overlap, strategy=strategy)
        curved = curved_of(SHAPES[name], setup)
        path = raster(curved, setup)
        found = coverage(curved, path, setup)
        assert found.unexplained_mm2 < 0.007 * found.area_mm2
        clear = PathMesh.of(curved.surface).boundary_distance(data_points(path), 10.0)
        # Between its ends a pass may run past a hole nearer than the margin, as before: its ends never stand nearer.
        ends = np.flatnonzero(path.is_data)
        ends = ends[~(path.is_data[ends - 1] & path.is_data[ends + 1])]
        rows = np.searchsorted(np.flatnonzero(path.is_data), ends)
        assert clear[rows].min() >= 5.0 - 0.02


def test_no_pass_is_added_where_nothing_is_left() -> None:
    """A plate along its edges, and a crystal whose neighbours meet: the raster alone."""
    every = (setup_of(), crystal(direction_deg=45.0, strategy="plane"), crystal(step_mm=20.0, strategy="plane"))
    for panel, setup in zip((plate(), SHAPES["holes"], SHAPES["holes"]), every, strict=True):
        path = raster(curved_of(panel, setup), setup)
        heading = path.Ts_part_contact.rotation_matrix[path.is_data][:, :, 0]
        assert np.abs(heading @ heading[0]).min() > 0.999


def test_arrays_turn_by_no_more_than_a_right_angle_from_the_raster() -> None:
    setup = setup_of(direction_deg=20.0)
    path = raster(curved_of(SHAPES["one large hole"], setup), setup)
    array = path.Ts_part_tcp.rotation_matrix[path.is_data][:, :, 0]
    raster_array = array[0]
    runs = path.pass_id[path.is_data]
    for k in np.unique(runs):
        mean = array[runs == k].mean(axis=0)
        assert mean @ raster_array > -1e-6
        assert np.degrees(np.arccos(np.clip((array[runs == k] @ array[runs == k][0]).min(), -1.0, 1.0))) < 101.0


def test_what_is_left_is_told_with_area_place_and_reason() -> None:
    setup = setup_of(direction_deg=45.0, strategy="plane")
    curved = curved_of(SHAPES["small holes"], setup)
    found = coverage(curved, raster(curved, setup), setup)
    (issue,) = left_issues(curved, found, setup)
    assert issue.code == "coverage-left"
    told = float(issue.message.split()[0])
    assert told == pytest.approx(found.unexplained_mm2, rel=0.03, abs=2.0)
    assert "slanted edges and beside holes" in issue.message
    # Half the swath as step leaves nothing, as the remedy says.
    closer = setup_of(direction_deg=45.0, strategy="plane", step_mm=15.0)
    less = coverage(curved, raster(curved, closer), closer)
    assert less.unexplained_mm2 < 0.3 * found.unexplained_mm2
