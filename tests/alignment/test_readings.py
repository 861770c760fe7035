"""Of a very dense scan some readings stand for all: the same placement and scatter, whatever the rhythm of laws and poses."""

import numpy as np
import pytest

from alignment.estimate.cells import cells_along_passes
from alignment.estimate.patches import condense
from alignment.estimate.pose_line import pose_line
from alignment.estimate.readings import look_at, sample_rows
from planner.frames import Transform
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, scan
from tests.loop.surfaces import plane

SETUP = Setup()


@pytest.mark.parametrize("laws", [16, 50, 64, 99, 128])
def test_no_law_and_no_stretch_is_favoured(laws):
    n, size = laws * 9_000, 40_000
    rows = sample_rows(n, size)
    assert size * 0.95 < len(rows) <= size
    assert np.all(np.diff(rows) > 0)
    per_law = np.bincount(rows % laws, minlength=laws)
    per_stretch = np.bincount(rows * 100 // n, minlength=100)
    assert per_law.min() > 0.8 * per_law.mean()
    assert np.ptp(per_stretch) < 0.05 * per_stretch.mean()


@pytest.mark.parametrize("outliers", [0.0, 0.1])
def test_a_fifth_of_the_readings_makes_the_patches_that_all_of_them_make(outliers):
    surface = plane()
    curved, rng = curved_of(surface), np.random.default_rng(4)
    T = part_from_correction(
        Transform.from_xyzabc("base", "basecorr", [1.0, -0.5, 0.8, 0.1, 0.2, -0.1]), SETUP.T_base_partnom
    )
    cloud = scan(surface, SETUP, T, rng, (5, 145), [20, 60, 100, 140], spacing_mm=0.5, outliers=outliers)
    line = pose_line(cloud, SETUP.probe)
    made = []
    for most in (len(cloud), len(cloud) // 5):
        readings = look_at(cloud, "perpendicular", most)
        cells = cells_along_passes(readings, line, SETUP.probe, 8.0)
        made.append(condense(readings, cells, curved, T))
    every, few = made
    assert len(few.kept) == pytest.approx(len(cloud) / 5, rel=0.03)
    assert few.total == every.total == len(cloud)
    assert few.kept.mean() == pytest.approx(every.kept.mean(), abs=0.01)
    assert few.sigma_mm == pytest.approx(every.sigma_mm, rel=0.05)
    # A cell that only a stray echo fell into may be without one. The part is flat: its height is what a patch measures.
    named = [{key: k for k, key in enumerate(zip(*_keys(p.cells), strict=True))} for p in (every, few)]
    pairs = np.array([(named[0][key], k) for key, k in named[1].items()])
    assert len(pairs) > 0.95 * len(every)
    height = [T.inv().points(p.origins_base)[:, 2] - p.distance_mm for p in (every, few)]
    off = height[1][pairs[:, 1]] - height[0][pairs[:, 0]]
    good = few.count[pairs[:, 1]] > 20
    assert good.sum() > 150
    # What the scatter of the readings leaves of the mean of a fifth of them.
    assert np.abs(off[good] * np.sqrt(few.count[pairs[good, 1]])).max() < 4.5 * few.sigma_mm
    assert np.std(off[good] * np.sqrt(few.count[pairs[good, 1]])) < 1.1 * few.sigma_mm


def _keys(cells):
    return cells.pass_id, np.round(cells.s_from_mm, 6), cells.across_mm
