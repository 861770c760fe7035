"""Where a part is that sprang back: a slide that explains its shape is not taken for its place."""

import numpy as np
import pytest

from alignment.estimate.align import align
from alignment.estimate.edge_rows import EdgeRows
from alignment.estimate.edge_shape import foot_shift_mm
from alignment.estimate.surface_rows import Rows
from planner.frames import Transform
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, scan
from tests.loop.surfaces import double_curved

SHELL = double_curved(400, 250, 1600, 750)
CELL = Setup.model_validate({"placement": {"x_mm": 40, "y_mm": 20, "a_deg": 10}})
TRUE = Transform.from_xyzabc("base", "basecorr", [1.5, -1.2, 1.1, 0.2, -0.3, 0.2])
SHAPES = {
    "bend": lambda p: 2.5 * (p[:, 0] / 200) ** 2 - 0.8,
    "twist": lambda p: 2.0 * (p[:, 0] / 200) * (p[:, 1] / 125),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_without_edges_the_fixture_outweighs_a_slide(shape):
    """Least is left by a slide of many sigmas of the fixture: 57 mm for such a bend, 6 deg for such a twist."""
    curved, T = curved_of(SHELL, 61, 41), part_from_correction(TRUE, CELL.T_base_partnom)
    lines = ((-190, 190), [-100, -50, 0, 50, 100])
    cloud = scan(SHELL, CELL, T, np.random.default_rng(2), *lines, field=SHAPES[shape])
    found = align(cloud, curved, [], CELL)
    codes = {i.code for i in found.issues}
    assert not codes & {"limit-displacement", "limit-rotation", "no-convergence"}
    assert "not-rigid" in codes
    assert found.verdict == "partial"
    error = np.array(found.T_base_basecorr.xyzabc) - TRUE.xyzabc
    sigma = np.array([a.sigma for a in found.axes])
    # In the plane; a bend raises and tilts the part as a whole, which is no error of the placement.
    assert (np.abs(error) < 3.0 * sigma)[[0, 1, 3]].all()
    assert (np.abs(error) < [4.0, 4.0, 2.0, 1.5, 0.6, 0.6]).all()


@pytest.mark.parametrize("slope", [0.02, -0.01])
def test_a_tilted_shape_shifts_the_foot_by_height_times_slope(slope):
    """Against the foot of a perpendicular on the tilted plane itself."""
    gx, gy = (v.ravel().astype(float) for v in np.meshgrid(np.arange(0, 101, 5), np.arange(0, 61, 5)))
    zero, n = np.zeros_like(gx), len(gx)
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    deviation = slope * (gy - 30.0)
    rows = Rows(-deviation, np.zeros((n, 6)), np.ones(n, dtype=bool), np.column_stack([gx, gy, zero]), up)
    # Laws 18 mm over the edge y = 60, outward is +y.
    x = np.array([20.0, 50.0, 80.0])
    point = np.column_stack([x, np.full(3, 60.0), np.zeros(3)])
    jacobian = np.tile([0.0, 0.0, 0.0, 0.0, 1.0, 0.0], (3, 1))
    crossings = EdgeRows(
        np.zeros(3), jacobian, np.zeros(3), np.ones(3), np.ones(3, dtype=bool), point, np.zeros(3, dtype=np.int64),
        np.full(3, 18.0),
    )  # fmt: skip
    # The plane z = slope (y - 30) and the law at (60, 18): foot = law - distance * normal.
    normal = np.array([-slope, 1.0]) / np.hypot(slope, 1.0)
    distance = (np.array([60.0, 18.0]) - [30.0, 0.0]) @ normal
    expected = -distance * normal[0]
    np.testing.assert_allclose(foot_shift_mm(rows, crossings), expected, rtol=0.06)
