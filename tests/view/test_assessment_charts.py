"""Maps and histograms of an inspection scan, against a field that is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from app.view.assessment_charts import assessment_charts
from app.view.deviation import Deviation, less_shape

STANDOFF_MM = 15.0


def scan(slope, step_mm=2.0):
    """A raster over 300 x 120 mm of CAD X and Z, laws 0.6 mm apart, the front wall rising along X."""
    x, z = (v.ravel() for v in np.meshgrid(np.arange(0.0, 300.0, step_mm), np.arange(0.0, 120.0, 0.6)))
    feet = np.stack([x, np.full_like(x, 7.0), z], axis=1)
    on_part = z < 100.0
    db = np.where(np.arange(len(x)) % 50 == 0, np.nan, 0.01 * z)
    centre = np.isclose(z % 6.0, 0.0)
    return SimpleNamespace(
        feet_part=feet, distance_mm=STANDOFF_MM + slope * x, db=db, on_part=on_part, centre=centre, bubble=~on_part
    )


@pytest.fixture(scope="module")
def charts():
    return assessment_charts(scan(1e-4), scan(1e-2), STANDOFF_MM, 2.0)


def test_a_map_shows_the_field_at_its_place(charts):
    assert [(m["unit"], m["series"]) for m in charts["maps"]] == [
        ("mm", "before"),
        ("mm", "after"),
        ("dB", "before"),
        ("dB", "after"),
    ]
    before = charts["maps"][0]
    assert (before["x_title"], before["y_title"]) == ("X, mm", "Z, mm")
    z = np.array(before["z"], dtype=float)
    x = before["x0"] + before["cell_mm"] * np.arange(z.shape[1])
    # A cell holds the mean of what lies in it: at most half a cell off, in field values.
    assert np.nanmax(np.abs(z - 1e-2 * x)) <= 1e-2 * before["cell_mm"]
    assert before["y0"] + before["cell_mm"] * len(z) < 104.0, "what is off the part is not drawn"


def test_poses_farther_apart_than_a_cell_leave_no_stripes():
    for step_mm in (0.7, 2.0, 5.0):
        z = np.array(assessment_charts(scan(1e-3, step_mm), None, STANDOFF_MM, 2.0)["maps"][0]["z"], dtype=float)
        assert np.isfinite(z).mean() > 0.97


def test_before_and_after_share_their_scale(charts):
    assert charts["maps"][0]["limit"] == charts["maps"][1]["limit"] >= 2.9
    of_distance = charts["histograms"][0]["series"]
    assert of_distance["before"]["edges"] == of_distance["after"]["edges"]
    for name, slope in (("before", 1e-2), ("after", 1e-4)):
        x = np.arange(0.0, 300.0, 2.0)
        assert of_distance[name]["std"] == pytest.approx(np.std(slope * x), rel=1e-6)
        assert sum(of_distance[name]["counts"]) == of_distance[name]["n"]
    assert charts["histograms"][1]["tolerance"] == 2.0


def test_a_followed_shape_leaves_only_what_it_does_not_explain():
    rng = np.random.default_rng(4)
    feet = np.concatenate([rng.uniform(0.0, 200.0, (500, 2)), np.zeros((500, 1))], axis=1)
    bend = 0.5 * np.sin(feet[:, 0] / 60.0)
    left = rng.normal(0.0, 0.02, 500)
    places = np.stack(
        [*(v.ravel() for v in np.meshgrid(np.linspace(0, 200, 25), np.linspace(0, 200, 25))), np.zeros(625)], 1
    )
    found = less_shape(Deviation(feet, bend + left), (places, 0.5 * np.sin(places[:, 0] / 60.0)))
    # Linear between places 8 mm apart: h^2 / 8 times the curvature of the bend is 0.0012 mm.
    assert np.abs(found.values_mm - left).max() < 0.005
    assert less_shape(found, None) is found
