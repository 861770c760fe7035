"""What helps to state the cell: robots, BASE from touched points, and the samples with their offsets."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.api.conftest import error_of, new_project

CAD = np.array([[0.0, 0.0, 10.0], [150.0, 0.0, 10.0], [0.0, 100.0, 10.0], [150.0, 100.0, 0.0]])
BASE = {"x_mm": 1050.0, "y_mm": -80.0, "z_mm": 400.0, "a_deg": 12.0, "b_deg": 1.5, "c_deg": -2.5}
PLACEMENT = {"x_mm": 20.0, "y_mm": 15.0, "z_mm": 5.0, "a_deg": 30.0, "b_deg": 0.0, "c_deg": 0.0}


def moved(pose, points):
    """Apply a KUKA pose to points, written out independently of the product's transforms."""
    a, b, c = (pose[k] for k in ("a_deg", "b_deg", "c_deg"))
    turn = Rotation.from_euler("ZYX", [a, b, c], degrees=True).as_matrix()
    return points @ turn.T + [pose["x_mm"], pose["y_mm"], pose["z_mm"]]


def pairs(cad, touched):
    names = ("x_mm", "y_mm", "z_mm")
    points = [[dict(zip(names, map(float, p), strict=True)) for p in rows] for rows in (cad, touched)]
    return [{"cad": c, "touched": t} for c, t in zip(*points, strict=True)]


@pytest.fixture(scope="module")
def address(client):
    made = new_project(client, part=None)
    assert client.put(f"{made}/setup", json={"placement": PLACEMENT}).status_code == 200
    return made


def test_base_is_found_where_the_points_were_touched(client, address):
    touched = moved(BASE, moved(PLACEMENT, CAD))
    answer = client.post(f"{address}/base-fit", json={"pairs": pairs(CAD, touched)})
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert np.allclose([found["base"][k] for k in BASE], list(BASE.values()), atol=1e-8)
    assert found["rms_mm"] < 1e-9
    assert found["issues"] == []
    # Nothing is put in force by asking.
    assert client.get(f"{address}/setup").json()["base"]["x_mm"] == 0.0


def test_a_placement_given_with_the_pairs_counts(client, address):
    body = {"pairs": pairs(CAD, moved(BASE, CAD)), "placement": {}}
    found = client.post(f"{address}/base-fit", json=body).json()
    assert np.allclose([found["base"][k] for k in BASE], list(BASE.values()), atol=1e-8)


def test_a_bad_touch_is_named(client, address):
    cad = np.concatenate([CAD, [[75.0, 50.0, 10.0], [75.0, 0.0, 10.0], [0.0, 50.0, 10.0]]])
    touched = moved(BASE, moved(PLACEMENT, cad))
    touched[2] += [0.0, 0.0, 6.0]
    found = client.post(f"{address}/base-fit", json={"pairs": pairs(cad, touched)}).json()
    assert [i["where"] for i in found["issues"]] == ["pair 3"]
    assert found["pairs"][2]["left_out_mm"] > found["pairs"][2]["residual_mm"] > 1.0
    three = client.post(f"{address}/base-fit", json={"pairs": pairs(cad[:3], touched[:3])}).json()
    assert {p["left_out_mm"] for p in three["pairs"]} == {None}


def test_what_cannot_be_fitted_is_said(client, address):
    few = client.post(f"{address}/base-fit", json={"pairs": pairs(CAD[:2], CAD[:2])})
    assert error_of(few, 422)["code"] == "base-pairs"
    line = np.array([[0.0, 0, 0], [1, 1, 0], [2, 2, 0]]) * 50.0
    assert error_of(client.post(f"{address}/base-fit", json={"pairs": pairs(line, line)}), 422)["code"] == "base-line"
    error_of(client.post(f"{address}/base-fit", json={"pairs": [{"cad": {"x_mm": 1}}]}), 422)


def test_every_robot_offered_can_be_named_in_a_setup(client, address):
    robots = client.get("/api/v1/robots").json()
    assert {"kuka-kr16-l6-2", "kuka-kr10-r1100-2"} <= {r["name"] for r in robots}
    assert all(r["title"].startswith("KUKA") and r["reach_mm"] > 500.0 for r in robots)
    # The maker's figure for the KR 10 R1100-2 is 1101 mm.
    assert next(r for r in robots if r["name"] == "kuka-kr10-r1100-2")["reach_mm"] == pytest.approx(1101.0, abs=1.0)


def test_a_sample_is_known_by_its_file(client):
    folder = Path(__file__).parents[2] / "sample_parts"
    for sample in client.get("/api/v1/samples").json():
        [file] = (folder / sample["name"]).glob("*.step")
        assert sample["sha256"] == hashlib.sha256(file.read_bytes()).hexdigest()
        assert any(sample["hidden_offset"].values())
