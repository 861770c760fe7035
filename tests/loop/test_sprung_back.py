"""A part that sprang back, with bubbles: the rigid estimate settles, blames nobody, and leaves no more than it must."""

import numpy as np
import pytest

from alignment.estimate.align import align
from alignment.point_cloud import point_cloud
from alignment.simulator import Noise, Truth, simulate
from alignment.simulator.fields import spring_back_field
from app.plan import load_plan
from app.steps.programs import read_folder
from planner.frames import Transform
from tests.loop.chain import echobase
from tests.loop.surfaces import wing, write_stl

APPLIED = [1.1, -0.7, 1.0, 0.2, -0.3, 0.5]


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sprung")
    write_stl(folder / "skin.stl", *wing(300, 140, 4.0, 0.8, 10).mesh(90, 40))
    assert echobase("plan", folder / "skin.stl", "--unit", "mm", "-o", folder / "out") == 0
    return load_plan(folder / "out"), read_folder(folder / "out", "alignment").path


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["bend", "dent", "step"])
def test_rigid_estimate_of_a_sprung_back_part(planned, kind):
    plan, program = planned
    truth = Truth(Transform.from_xyzabc("base", "basecorr", APPLIED), spring_back_field(plan.surface, kind, 1.5))
    cloud = point_cloud(
        [simulate(plan.part, plan.surface, program, plan.setup, truth, Noise(outliers=0.1))], plan.setup
    )
    found = align(cloud, plan.curved, plan.keypoints, plan.setup, plan.inspection)
    assert [i.code for i in found.issues if i.severity == "error"] == []
    assert found.T_base_basecorr is not None
    # The field itself has an rms of a third to a half of its 1.5 mm; a rigid motion takes most of a bend out of it.
    assert found.residual.rms_mm < 0.45
    # What a dent moves is part of the residual, although the estimate does not rest on it.
    assert found.residual.rms_mm > 0.1
    # Never worse than the paper's own method on the same readings, where it says anything.
    if found.baseline is not None:
        assert _left_mm(plan, cloud, found.T_base_basecorr) < 1.1 * _left_mm(plan, cloud, found.baseline) + 0.02


def _left_mm(plan, cloud, T_base_basecorr) -> float:
    """Spread (mm) of measured against expected distances; the middle 80 %, since a tenth of the echoes are false."""
    T_base_part = T_base_basecorr @ plan.setup.T_base_partnom.renamed("basecorr", "part")
    rows = np.arange(0, len(cloud), 7)
    foot = plan.curved.closest(T_base_part.inv().points(cloud.origins_base[rows]))
    off = (cloud.distance_mm[rows] - foot.distance_mm)[foot.interior]
    return float(np.diff(np.percentile(off, [10, 90]))[0])
