"""A clock that is late shifts every edge along the travel: the planned scan tells it from a shift of the part."""

import re

import numpy as np
import polars as pl
import pytest

from alignment.simulator import Noise, Truth, simulate, write_readings_csv
from app.plan import load_plan
from app.steps.align import AlignOptions, run_align
from app.steps.plan import PlanRequest, run_plan
from app.steps.programs import read_folder
from planner.frames import Transform
from planner.setup import Setup
from tests.loop.surfaces import plane, write_stl
from tests.non_rigid.test_chain import SIX, put, quiet

OFFSET = Transform.from_xyzabc("base", "basecorr", (0.8, -0.5, 0.4, 0.3, 0.1, -0.2))
SETUP = Setup.model_validate(
    {
        "base": {"x_mm": 1000, "y_mm": 0, "z_mm": 700, "number": 2},
        "placement": {"x_mm": 20},
        "inspection": {"strategy": "plane"},
        "alignment": {"scan_speed_mm_s": 60},
    }
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("late")
    write_stl(out / "plate.stl", *plane(230.0, 140.0).mesh(9, 7))
    put(out, run_plan(PlanRequest(out / "plate.stl", "plate.stl", "mm", SETUP), quiet)[1])
    return out


def test_opposite_edges_are_crossed_in_opposite_directions(folder):
    """Both outwards or both inwards, along each axis of the plate."""
    path = load_plan(folder).alignment
    data = path.take(path.is_data)
    senses = {axis: [] for axis in (0, 1)}
    for k in np.unique(data.pass_id):
        p = data.Ts_part_contact.xyz_mm[data.pass_id == k]
        for axis, size in ((0, 230.0), (1, 140.0)):
            for end, sign in ((0, -1.0), (-1, 1.0)):
                if p[end, axis] < 0.0 or p[end, axis] > size:
                    senses[axis].append((p[end, axis] > size, sign))
    for found in senses.values():
        beyond = {side: np.mean([s for b, s in found if b == side]) for side in (False, True)}
        assert beyond[False] == beyond[True]


@pytest.mark.parametrize("latency_ms", [-6.0, 15.0])
def test_the_delay_is_measured_and_the_part_stays_where_it_is(folder, latency_ms):
    plan, reading = load_plan(folder), read_folder(folder, "alignment")
    noise = Noise(latency_ms=latency_ms)
    write_readings_csv(
        simulate(plan.part, plan.surface, reading.path, plan.setup, Truth(OFFSET), noise, 4), folder / "scan.csv"
    )
    found = run_align(folder, [folder / "scan.csv"], AlignOptions(), quiet).correction
    error = np.array([found["correction"][k] for k in SIX]) - OFFSET.xyzabc
    sigma = np.array([found["dof"][k]["sigma"] for k in ("x", "y", "z", "a", "b", "c")])
    assert (np.abs(error) < 3.5 * sigma).all()
    assert (sigma < [0.1, 0.1, 0.1, 0.03, 0.03, 0.03]).all()
    said = next(i["message"] for i in found["issues"] if i["code"] == "edges-late")
    assert ("late" if latency_ms > 0 else "early") in said
    assert float(re.search(r"([\d.]+) ms at 60 mm/s", said)[1]) == pytest.approx(abs(latency_ms), abs=1.5)


@pytest.mark.parametrize("seed", [4, 5])
def test_laws_in_reverse_order_on_a_turned_plate_are_no_late_clock(folder, seed):
    """With the plate turned by 0.3 deg they put it 0.6 deg off, and nearly all of what is left looks like a delay."""
    plan, reading = load_plan(folder), read_folder(folder, "alignment")
    write_readings_csv(
        simulate(plan.part, plan.surface, reading.path, plan.setup, Truth(OFFSET), Noise(), seed), folder / "scan.csv"
    )
    table = pl.read_csv(folder / "scan.csv", comment_prefix="#")
    laws = plan.setup.probe.laws
    table.with_columns((laws + 1 - pl.col("law")).alias("law")).write_csv(folder / "reversed.csv")
    for name, wrong in (("scan", False), ("reversed", True)):
        found = run_align(folder, [folder / f"{name}.csv"], AlignOptions(), quiet).correction
        assert ("laws-reversed" in {i["code"] for i in found["issues"]}) == wrong
        assert (found["verdict"] == "fail") == wrong
