"""What `plan` says an alignment will be worth, against the errors of alignments of simulated scans of a part of no sample."""

import numpy as np
import pytest

from alignment.estimate.map import align_map
from alignment.estimate.motion import motion_between
from alignment.point_cloud import point_cloud
from alignment.simulator import Noise, Truth, simulate
from app.plan import load_plan
from app.steps.plan import PlanRequest, run_plan
from app.steps.programs import read_folder
from planner.frames import Transform
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.loop.surfaces import plane, write_stl
from tests.non_rigid.test_chain import put, quiet

OFFSET = Transform.from_xyzabc("base", "basecorr", (0.5, 0.7, -0.6, -0.2, 0.3, 0.2))
SETUP = Setup.model_validate(
    {"base": {"x_mm": 1000, "y_mm": 0, "z_mm": 700, "number": 2}, "inspection": {"strategy": "plane"}}
)
SEEDS = 16


@pytest.mark.slow
def test_errors_are_as_large_as_predicted_along_each_axis(tmp_path):
    write_stl(tmp_path / "plate.stl", *plane(180.0, 260.0).mesh(7, 9))
    put(tmp_path, run_plan(PlanRequest(tmp_path / "plate.stl", "plate.stl", "mm", SETUP), quiet)[1])
    plan, reading = load_plan(tmp_path), read_folder(tmp_path, "alignment")
    predicted = np.array(plan.summary["prediction"]["covariance"])
    T_true = part_from_correction(OFFSET, plan.setup.T_base_partnom)
    xi = []
    for seed in range(SEEDS):
        scan = simulate(plan.part, plan.surface, reading.path, plan.setup, Truth(OFFSET), Noise(), seed)
        found = align_map(point_cloud([scan], plan.setup), plan.curved, plan.setup)
        xi.append(motion_between(found.T_base_part, T_true, found.centre_mm))
    rms, sigma = np.sqrt(np.mean(np.square(xi), axis=0)), np.sqrt(np.diag(predicted))
    # The rms of sixteen errors is within 0.55 to 1.5 times the truth 99 times in 100, six times over.
    assert (rms > 0.5 * sigma).all(), rms / sigma
    assert (rms < 1.5 * sigma).all(), rms / sigma
