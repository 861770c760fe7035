"""The deviation of a scanned panel, against where it was put."""

import numpy as np
import pytest

from app.view.charts import deviation_chart
from app.view.deviation import deviation, spread, symmetric_limit
from app.view.draw_paths import swept
from planner.frames import Transform
from planner.placement import assume_nominal
from tests.view.memory import TRUTH, MemoryModel, normal, raster


@pytest.fixture(scope="module")
def scanned():
    model = MemoryModel()
    model.plan()
    model.scan()
    return model


def test_before_the_correction_the_deviation_is_the_offset_along_the_normal(scanned):
    model = scanned
    T_base_partnom = assume_nominal(model.setup().T_base_partnom)
    found = deviation(model.cloud(), model.surface(), T_base_partnom)
    # First order: a surface point moves by (T - 1) p, and its deviation is the part of that along the normal.
    moved = Transform.from_xyzabc("base", "base", TRUTH) @ T_base_partnom
    in_part = T_base_partnom.inv().points(moved.points(found.feet))
    n = normal(found.feet[:, 0], found.feet[:, 1])
    expected = np.einsum("ij,ij->i", in_part - found.feet, n)
    assert len(found.feet) > 3000
    assert np.abs(expected).max() > 1.0
    # The rest: the facets of the CAD (0.06 mm), and what is of second order.
    assert np.abs(found.values_mm - expected).max() < 0.15


def test_after_the_correction_only_the_facets_are_left(scanned):
    model = scanned
    T_base_part = Transform.from_xyzabc("base", "base", TRUTH) @ assume_nominal(model.setup().T_base_partnom)
    found = deviation(model.cloud(), model.surface(), T_base_part)
    assert np.abs(found.values_mm).max() < 0.08


def test_spreading_keeps_to_what_was_measured(scanned):
    model = scanned
    found = deviation(model.cloud(), model.surface(), assume_nominal(model.setup().T_base_partnom))
    vertices = model.surface().vertices
    values = spread(found, vertices, 12.0)
    known = np.isfinite(values)
    assert 0.2 < known.mean() < 0.8
    assert values[known].min() >= found.values_mm.min() - 1e-9
    assert values[known].max() <= found.values_mm.max() + 1e-9
    far = np.abs(np.abs(vertices[:, 1]) - 40.0) < 5.0
    assert not np.isfinite(values[far]).any()


def test_limits_are_round():
    assert symmetric_limit(np.array([0.31, -0.2])) == pytest.approx(0.5)
    assert symmetric_limit(np.array([1.4, np.nan])) == pytest.approx(2.0)
    assert symmetric_limit(np.zeros(0)) == pytest.approx(0.05)


def test_the_swept_share_is_the_swath_over_the_width():
    model = MemoryModel()
    y = np.linspace(-100.0, 100.0, 401)
    x = np.full_like(y, 12.3)
    from tests.view.memory import height  # noqa: PLC0415

    hit = swept(raster("alignment", np.array([0.0])), np.stack([x, y, height(x, y)], axis=1), model.setup())
    # 50 laws of 0.6 mm: 30 mm across, measured along a surface that rises by less than a per cent.
    assert hit.mean() * 200.5 == pytest.approx(30.0, abs=1.0)
    assert np.abs(y[hit]).max() < 15.5


def test_the_chart_counts_every_reading(scanned):
    chart = deviation_chart(scanned)
    before = chart["series"]["before"]
    assert sum(before["counts"]) == before["n"] > 3000
    assert "after" not in chart["series"]
