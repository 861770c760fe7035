"""Coverage within tolerance against the law of the bend: a law at offset x sees asin(x / R), convex and concave."""

import numpy as np
import pytest

from benchmarks.planning.panels import Panel
from planner.path.coverage import coverage
from planner.path.raster import raster
from planner.path.swath import effective_half_mm
from tests.path.shapes import curved_of, setup_of
from tests.surface.shapes import grid

LONG, WIDE = 300.0, 160.0


def arc(radius: float, concave: bool) -> Panel:
    v, f = grid(np.linspace(0, LONG, 30), np.linspace(-WIDE / 2, WIDE / 2, 60), lambda x, y: 0.0 * x)
    a = v[:, 1] / radius
    bent = np.stack([v[:, 0], radius * np.sin(a), radius * np.cos(a)], axis=1)
    return Panel("arc", bent, f[:, ::-1] if concave else f, lambda p: p)


@pytest.mark.parametrize("radius", [120.0, 400.0])
@pytest.mark.parametrize("concave", [False, True])
def test_half_swath_and_step_follow_the_radius(radius, concave):
    curved = curved_of(arc(radius, concave))
    face, bary = np.arange(200, dtype=np.int32), np.full((200, 3), 1 / 3)
    _, n = curved.evaluate(face, bary)
    shape = curved.shape_operator(face, bary)
    round_it = np.cross(n, [1.0, 0.0, 0.0])
    half = effective_half_mm(shape, round_it, setup_of())
    # Where the beam of a law at x meets the bend, its normal is turned by asin(x / R).
    assert half == pytest.approx(radius * np.sin(np.radians(1.0)), rel=0.02)
    along = effective_half_mm(shape, np.tile([1.0, 0.0, 0.0], (200, 1)), setup_of())
    assert along == pytest.approx(15.0)


@pytest.mark.parametrize("concave", [False, True])
@pytest.mark.parametrize(("direction_deg", "width"), [(0.0, None), (90.0, 30.0)])
def test_one_pass_sees_within_tolerance_what_the_bend_allows(concave, direction_deg, width):
    radius = 120.0
    curved = curved_of(arc(radius, concave))
    setup = setup_of(direction_deg=direction_deg, strategy="plane")
    path = raster(curved, setup)
    one = path.take(path.pass_id == path.passes // 2)
    covered = coverage(curved, one, setup)
    length = (LONG if direction_deg == 0.0 else WIDE) - 10.0
    seen = width if width is not None else 2.0 * radius * np.radians(1.0)
    assert covered.within_tolerance_mm2 == pytest.approx(length * seen, rel=0.03)
    # Swept is wider: the outer laws see the part, but out of tolerance, and that is said.
    assert covered.beyond_mm2 == pytest.approx(length * (30.0 - seen), rel=0.06, abs=60.0)
    whole = coverage(curved, path, setup)
    assert whole.unexplained_mm2 + whole.beyond_mm2 < 0.002 * whole.area_mm2
