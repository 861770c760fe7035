"""What the corrected inspection will see, against exact placements drawn from the same covariance; and locks that cannot be."""

import re

import numpy as np
import pytest

from alignment.estimate.align import align
from alignment.estimate.motion import moved
from alignment.estimate.outlook import after_correction
from alignment.metrics import expected
from planner.frames import Transform
from planner.path.raster import raster
from planner.placement import assume_nominal, part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, scan
from tests.loop.surfaces import double_curved, plane, wing

PLACED = {"placement": {"x_mm": 400, "y_mm": 50, "z_mm": 20, "a_deg": 20}, "inspection": {"step_mm": 60}}


@pytest.mark.parametrize("surface", [plane(150, 100), double_curved(300, 200, 600, 300)], ids=["plane", "curved"])
def test_prediction_is_the_mean_over_parts_that_the_uncertainty_allows(surface):
    setup = Setup.model_validate(PLACED)
    curved = curved_of(surface, 41, 31)
    path = raster(curved, setup)
    T_nominal = assume_nominal(setup.T_base_partnom)
    rng = np.random.default_rng(4)
    sigma = np.array([1e-3, 2e-3, 1e-3, 0.1, 0.2, 0.05])
    mix = np.linalg.qr(rng.standard_normal((6, 6)))[0]
    root = sigma[:, None] * mix * rng.uniform(0.3, 1.0, 6)
    # The estimate is somewhere else; the corrected program meets it where the nominal one was planned.
    T_found = part_from_correction(
        Transform.from_xyzabc("base", "basecorr", [1, -2, 1, 0.3, -0.4, 0.5]), setup.T_base_partnom
    )
    found = after_correction(curved, path, setup, T_found, root @ root.T)
    turn = (T_nominal @ T_found.inv()).rotation_matrix
    centre = T_nominal.points(curved.surface.centroid_part)
    std2, width, tilt, db = [], [], [], []
    for _ in range(150):
        xi = root @ rng.standard_normal(6)
        there = moved(T_nominal, np.r_[turn @ xi[:3], turn @ xi[3:]], centre)
        seen = expected(curved, path, setup, there).summary
        std2.append(seen.tof_std_mm**2)
        width.append(seen.tof_range_mm)
        tilt.append(seen.tilt_max_deg)
        db.append(seen.mean_abs_db)
    # Means of 64 and of 150 draws: each is good to about 60 % over the root of its number.
    assert found.tof_std_mm == pytest.approx(np.sqrt(np.mean(std2)), rel=0.2)
    assert found.tof_range_mm == pytest.approx(np.mean(width), rel=0.2)
    assert found.tilt_max_deg == pytest.approx(np.mean(tilt), rel=0.2)
    # It goes with the square of the tilt, and scatters twice as much.
    assert found.mean_abs_db == pytest.approx(np.mean(db), rel=0.4)


def test_without_uncertainty_the_corrected_program_sees_the_plan():
    setup = Setup.model_validate(PLACED)
    curved = curved_of(double_curved(300, 200, 600, 300), 41, 31)
    path = raster(curved, setup)
    T = assume_nominal(setup.T_base_partnom)
    planned = expected(curved, path, setup, T).summary
    found = after_correction(curved, path, setup, T, 1e-24 * np.eye(6))
    assert found.tof_std_mm == pytest.approx(planned.tof_std_mm, abs=1e-6)
    assert found.tilt_max_deg == pytest.approx(planned.tilt_max_deg, abs=1e-4)


def locked(surface, mesh, u_range, lines, lock, offset):
    setup = Setup.model_validate({**PLACED, "alignment": {"lock": lock, "edges": False}})
    T = part_from_correction(Transform.from_xyzabc("base", "basecorr", offset), setup.T_base_partnom)
    cloud = scan(surface, setup, T, np.random.default_rng(1), u_range, lines)
    found = align(cloud, curved_of(surface, *mesh), [], setup, edges=False)
    return found, {i.code: i for i in found.issues}


@pytest.mark.parametrize(
    ("lock", "offset", "named"),
    [
        (["z"], [0.5, 0.4, 3, 0.1, 0, 0.3], "z +3."),  # another placement fits, wrongly
        (["a", "b", "c"], [0.5, 0.4, 1, 0.3, 0.3, 0.6], "b +0.3"),  # none does
    ],
)
def test_a_lock_against_the_readings_fails_by_name(lock, offset, named):
    found, issues = locked(wing(600), (81, 41), (30, 570), [0.2, 0.5, 0.8], lock, offset)
    assert found.verdict == "fail"
    assert "no-convergence" not in issues
    assert named in issues["lock-contradicted"].message
    assert issues["lock-contradicted"].severity == "error"


def test_a_lock_off_by_little_asks_the_operator():
    found, issues = locked(plane(), (2, 2), (8, 142), [20, 50, 80], ["b"], [0, 0, 0, 0, 0.4, 0])
    assert found.verdict == "partial"
    said, sigma = re.search(r"b ([+-][\d.]+) deg \(sigma ([\d.]+)\)", issues["lock-contradicted"].message).groups()
    assert abs(float(said) - 0.4) < 4.0 * float(sigma) < 0.06


def test_a_lock_that_the_readings_bear_out_says_nothing():
    for lock in (["z", "b"], ["x", "a"]):
        found, issues = locked(plane(), (2, 2), (8, 142), [20, 50, 80], lock, [0, 0, 0, 0, 0, 0.4])
        assert found.verdict == "pass"
        assert "lock-contradicted" not in issues
