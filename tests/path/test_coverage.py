"""Areas against closed forms."""

import numpy as np
import pytest

from benchmarks.planning.panels import cylinder, panels
from planner.path.coverage import coverage, swept_share
from planner.path.raster import raster
from planner.setup import Setup
from tests.path.shapes import crystal, curved_of, ell, plate, setup_of


@pytest.mark.parametrize("strategy", ["plane", "geodesic"])
def test_plate_of_two_triangles_is_swept_up_to_its_margin(strategy: str) -> None:
    setup = setup_of(strategy=strategy)
    curved = curved_of(plate())
    c = coverage(curved, raster(curved, setup), setup)
    assert c.area_mm2 == pytest.approx(15000.0)
    assert c.swept_mm2 == pytest.approx(140.0 * 90.0, rel=0.003)
    assert c.within_tolerance_mm2 == pytest.approx(140.0 * 90.0, rel=0.003)
    assert c.missed_mm2 == pytest.approx(15000.0 - 140.0 * 90.0, rel=0.02)
    assert c.margin_mm2 == pytest.approx(c.missed_mm2, rel=0.02)


def test_overlaps_count_once_and_a_gap_is_seen() -> None:
    """Swath 30 mm every 45 mm: two thirds of the strip between the outer edges of the swaths."""
    curved = curved_of(plate(300.0, 300.0))
    setup = setup_of(strategy="plane", step_mm=45.0, edge_margin_mm=0.0)
    path = raster(curved, setup)
    lines = path.passes
    c = coverage(curved, path, setup)
    assert c.swept_mm2 == pytest.approx(lines * 30.0 * 300.0, rel=0.01)
    assert c.missed_mm2 == pytest.approx(300.0**2 - lines * 30.0 * 300.0, rel=0.01)


def test_within_tolerance_on_a_cylinder_is_the_arc_of_the_tilt() -> None:
    """One pass along R 400 with 30 mm swath: laws within 400 x 1 deg of arc either side are inside 1 deg."""
    panel = cylinder(60, 90)
    curved = curved_of(panel)
    setup = setup_of(strategy="plane", step_mm=300.0, edge_margin_mm=0.0)
    path = raster(curved, setup)
    assert path.passes == 3
    centre = path.take(path.pass_id == 1)
    c = coverage(curved, centre, setup)
    length = 1500.0
    assert c.within_tolerance_mm2 == pytest.approx(2 * 400.0 * np.radians(1.0) * length, rel=0.01)
    assert c.swept_mm2 == pytest.approx(2 * 400.0 * np.arcsin(15.0 / 400.0) * length, rel=0.01)


def test_standoff_tolerance_limits_a_flat_array_too() -> None:
    """With 10 deg allowed, sag decides: 400 (1 - cos a) <= 0.1 mm."""
    curved = curved_of(cylinder(60, 180))
    setup = Setup.model_validate(
        {
            "tolerances": {"tilt_deg": 10.0, "standoff_mm": 0.1},
            "inspection": {"strategy": "plane", "step_mm": 300.0, "edge_margin_mm": 0.0},
        }
    )
    path = raster(curved, setup)
    assert path.passes == 3
    c = coverage(curved, path.take(path.pass_id == 1), setup)
    assert c.within_tolerance_mm2 == pytest.approx(2 * 400.0 * np.arccos(1 - 0.1 / 400.0) * 1500.0, rel=0.01)


@pytest.mark.parametrize("strategy", ["plane", "geodesic"])
@pytest.mark.parametrize("panel", panels(140, 50), ids=lambda p: p.name)
def test_nothing_is_missed_inside_the_margin(panel: object, strategy: str) -> None:
    """Single crystal, 2 mm of 3 mm beam: whatever is not within tolerance lies in the margin, but for slivers."""
    setup = crystal(strategy=strategy, step_mm=2.5, point_spacing_mm=4.0, direction_deg=panel.direction_deg)
    curved = curved_of(panel)
    c = coverage(curved, raster(curved, setup), setup)
    assert c.missed_mm2 - c.margin_mm2 <= 0.002 * c.area_mm2


def test_face_shares_add_up() -> None:
    curved = curved_of(ell())
    setup = setup_of(strategy="geodesic")
    c = coverage(curved, raster(curved, setup), setup)
    areas = curved.surface.face_areas_mm2
    assert c.face_share @ areas == pytest.approx(c.swept_mm2)
    assert c.face_within_share @ areas == pytest.approx(c.within_tolerance_mm2)
    assert c.share == pytest.approx(c.swept_mm2 / c.area_mm2)


def test_quick_share_agrees() -> None:
    curved = curved_of(ell())
    setup = setup_of(strategy="plane")
    path = raster(curved, setup)
    assert swept_share(curved, path, setup) == pytest.approx(coverage(curved, path, setup).share, abs=0.003)


def test_an_empty_path_covers_nothing() -> None:
    curved = curved_of(plate())
    path = raster(curved, Setup())
    c = coverage(curved, path.take(~path.is_data), Setup())
    assert (c.swept_mm2, c.missed_mm2) == (0.0, pytest.approx(15000.0))
