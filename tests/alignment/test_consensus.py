"""A quarter of the scan agrees on something that is not the part: the table behind it, a clamp before it."""

from dataclasses import replace

import numpy as np
import pytest

from alignment.estimate.map import MapFit, align_map
from planner.frames import Transform
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, normal_error_mm, scan
from tests.loop.surfaces import plane


@pytest.mark.parametrize("step_mm", [5.0, -3.0])
@pytest.mark.parametrize(("end", "seed"), [("left", 0), ("right", 1), ("corner", 2)])
def test_a_quarter_of_the_scan_off_the_part(step_mm, end, seed):
    surface, setup = plane(), Setup()
    T = part_from_correction(
        Transform.from_xyzabc("base", "basecorr", [1.1, -0.7, 1.0, 0.2, -0.8, 0.5]), setup.T_base_partnom
    )
    cloud = scan(surface, setup, T, np.random.default_rng(seed), (5, 145), [12.5 + 18.75 * k for k in range(5)])
    at = T.inv().points(cloud.origins_base)
    wrong = {"left": at[:, 0] < 38, "right": at[:, 0] > 112, "corner": (at[:, 0] > 75) & (at[:, 1] < 50)}[end]
    assert 0.2 < wrong.mean() < 0.3
    seen = replace(cloud, distance_mm=cloud.distance_mm + step_mm * wrong)
    found = align_map(seen, curved_of(surface), setup, edges=False)
    assert isinstance(found, MapFit)
    # As with the clean scan of DESIGN: 0.02 mm at the centre and 0.02 deg, here at the rim of a scan without one end.
    assert normal_error_mm(surface, T, found.T_base_part) < 0.03 + 50.0 * np.radians(0.02)
    assert not found.used[np.linalg.norm(found.rows.r[:, None], axis=1) > 2.0].any()
