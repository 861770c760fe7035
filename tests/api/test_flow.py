"""The engineer's day by REST, through a real server process."""

import io
import json
import zipfile

import pytest

from tests.api.conftest import aligned, error_of, new_project, planned
from tests.api.fake_workflow import PROGRAM
from tests.api.server_process import finished


def test_from_part_to_corrected_program(client):
    address = new_project(client)
    assert client.get(f"{address}/part").json()["size_if"]["inch"] == [254.0, 127.0, 0.0]
    assert planned(client, address)["result"] == {"number": 1, "verdict": "pass", "keypoints_set": True}
    assert [k["id"] for k in client.get(f"{address}/keypoints").json()] == ["K1", "K2", "K3"]
    assert client.get(f"{address}/plan").json()["stale"] is False
    program = client.get(f"{address}/programs/alignment")
    assert program.headers["Content-Type"] == "application/zip"
    assert "attachment" in program.headers["Content-Disposition"]
    with zipfile.ZipFile(io.BytesIO(program.content)) as archive:
        assert archive.namelist() == ["EB_TEST.src"]
        assert archive.read("EB_TEST.src").startswith(b"&ACCESS")
    rehearsal = client.post(f"{address}/simulate", json={"offset": {"x_mm": 1.25}, "seed": 7})
    assert finished(client, rehearsal.json())["result"] == {"number": 1}
    scan = client.get(f"{address}/scans/1").json()
    assert scan["origin"] == "simulated"
    assert client.get(f"{address}/scans/1/files/0").content.startswith(b"x_mm,tof_us\n1.25,7\n")
    job = finished(client, client.post(f"{address}/alignments", json={"scans": [1]}).json())
    assert job["result"] == {"number": 1, "verdict": "pass"}
    found = client.get(f"{address}/alignments/1").json()
    assert found["correction"]["x_mm"] == 1.0
    assert found["program"]["available"] is True
    corrected = client.get(f"{address}/programs/corrected")
    with zipfile.ZipFile(io.BytesIO(corrected.content)) as archive:
        assert archive.read("EB_TEST.src") == PROGRAM
    report = client.get(f"{address}/alignments/1/report")
    assert "sandbox" in report.headers["Content-Security-Policy"]
    client.post(f"{address}/scans", params={"name": "i.csv", "path": "inspection"}, content=b"x_mm\n2\n")
    judged = finished(client, client.post(f"{address}/assessments", json={}).json())
    assert client.get(f"{address}/assessments/1").json()["after"] == {"within_2db": 1.0}
    assert judged["state"] == "done"
    states = {s["name"]: s["state"] for s in client.get(f"{address}/state").json()["steps"]}
    assert set(states.values()) == {"done"}


@pytest.mark.parametrize("change", ["part", "setup", "surface", "keypoints"])
def test_a_changed_input_makes_everything_after_it_stale(client, change):
    address = new_project(client)
    planned(client, address)
    aligned(client, address)
    assert client.get(f"{address}/programs/corrected").status_code == 200
    if change == "part":
        client.put(f"{address}/part", params={"name": "other.stl", "unit": "mm"}, content=b"other")
    elif change == "setup":
        client.put(f"{address}/setup", json={"standoff_mm": 16.0})
    elif change == "surface":
        client.put(f"{address}/surface", json={"seeds": [{"x_mm": 1, "y_mm": 1, "z_mm": 0}]})
    else:
        client.put(f"{address}/keypoints", json=[{"id": "A", "x_mm": 1, "y_mm": 1, "z_mm": 0}])
    for which in ("alignment", "inspection", "corrected"):
        assert error_of(client.get(f"{address}/programs/{which}"), 409)["code"] == "program-stale"
    found = client.get(f"{address}/alignments/1").json()
    assert found["stale_because"] == [change]
    error_of(client.post(f"{address}/alignments/1/accept", json={"name": "A", "reason": "b"}), 409)
    error_of(client.post(f"{address}/alignments", json={}), 409)
    error_of(client.post(f"{address}/simulate", json={}), 409)
    # Planning again brings the plan's programs back, and not the corrected one of the old plan.
    planned(client, address)
    assert client.get(f"{address}/programs/alignment").status_code == 200
    error_of(client.get(f"{address}/programs/corrected"), 409)


def test_putting_the_same_input_back_makes_results_fresh_again(client):
    address = new_project(client)
    planned(client, address)
    setup = client.get(f"{address}/setup").json()
    client.put(f"{address}/setup", json=setup | {"standoff_mm": 16.0})
    error_of(client.get(f"{address}/programs/alignment"), 409)
    client.put(f"{address}/setup", json=setup)
    assert client.get(f"{address}/programs/alignment").status_code == 200


def test_a_partial_alignment_needs_a_name_and_a_reason(client):
    address = new_project(client)
    planned(client, address)
    assert aligned(client, address, b"x_mm\n1\n# want-partial")["result"]["verdict"] == "partial"
    assert error_of(client.get(f"{address}/programs/corrected"), 409)["code"] == "acceptance-missing"
    error_of(client.post(f"{address}/alignments/1/accept", json={"name": "  ", "reason": "x"}), 422)
    error_of(client.post(f"{address}/alignments/1/accept", json={"name": "A"}), 422)
    accepted = client.post(f"{address}/alignments/1/accept", json={"name": "A. Inspector", "reason": "gauge agrees"})
    assert accepted.json()["accepted"]["reason"] == "gauge agrees"
    assert client.get(f"{address}/programs/corrected").status_code == 200
    # A new alignment is a new decision.
    aligned(client, address, b"x_mm\n1\n# want-partial again")
    error_of(client.get(f"{address}/programs/corrected"), 409)


def test_a_failed_alignment_is_never_handed_out(client):
    address = new_project(client)
    planned(client, address)
    aligned(client, address)
    assert client.get(f"{address}/programs/corrected").status_code == 200
    aligned(client, address, b"x_mm\n1\n# want-fail")
    assert error_of(client.get(f"{address}/programs/corrected"), 409)["code"] == "alignment-failed"
    error_of(client.post(f"{address}/alignments/2/accept", json={"name": "A", "reason": "b"}), 409)
    assert client.get(f"{address}/alignments/1").json()["program"]["available"] is False
    assert client.get(f"{address}/alignments/2/report").status_code == 200


@pytest.mark.parametrize(("part", "which", "code"), [("unproven.stl", "alignment", "program-unproven"),
                                                     ("unreachable.stl", "inspection", "program-missing")])  # fmt: skip
def test_an_unproven_or_unwritten_program_is_never_handed_out(client, part, which, code):
    address = new_project(client, part=part)
    planned(client, address)
    assert error_of(client.get(f"{address}/programs/{which}"), 409)["code"] == code


def test_deleting_a_scan_makes_its_alignment_stale(client):
    address = new_project(client)
    planned(client, address)
    aligned(client, address)
    assert client.delete(f"{address}/scans/1").status_code == 204
    assert error_of(client.get(f"{address}/programs/corrected"), 409)["code"] == "program-stale"


def test_the_journal_tells_what_was_done(client):
    address = new_project(client)
    planned(client, address)
    client.get(f"{address}/programs/alignment")
    journal = client.get(f"{address}/journal").json()
    assert journal["intact"] is True
    actions = [line["action"] for line in journal["lines"]]
    assert actions == ["project-created", "part-set", "keypoints-set", "plan-made", "program-handed-out"]


def test_two_files_make_one_scan(client):
    address = new_project(client)
    files = [("file", ("poses.csv", b"t_s,x_mm\n")), ("file", ("readings.csv", b"t_s,law\n"))]
    made = client.post(f"{address}/scans", files=files, data={"base": "corrected"})
    assert made.status_code == 201
    assert [f["name"] for f in made.json()["files"]] == ["poses.csv", "readings.csv"]
    assert made.json()["base"] == "corrected"
    error_of(client.post(f"{address}/scans", files=[*files, ("file", ("third.csv", b"x"))]), 422)


def test_two_people_on_one_project(client):
    address = new_project(client)
    mine = client.get(f"{address}/keypoints").headers["ETag"]
    theirs = client.put(
        f"{address}/keypoints", json=[{"id": "A", "x_mm": 1, "y_mm": 1, "z_mm": 0}], headers={"If-Match": mine}
    )
    assert theirs.status_code == 200
    late = client.put(f"{address}/keypoints", json=[], headers={"If-Match": mine})
    assert error_of(late, 412)["code"] == "changed-meanwhile"
    assert client.put(f"{address}/keypoints", json=[], headers={"If-Match": theirs.headers["ETag"]}).status_code == 200
    assert client.get(f"{address}/keypoints", params={"version": 1}).json()[0]["id"] == "A"
    error_of(client.put(f"{address}/setup", json={}, headers={"If-Match": 'W/"0"'}), 412)
    assert client.put(f"{address}/setup", json={}, headers={"If-Match": "*"}).status_code == 200


def test_every_route_is_documented_with_its_errors(client):
    api = client.get("/openapi.json").json()
    assert len(api["paths"]) >= 30
    for path, methods in api["paths"].items():
        for operation in methods.values():
            assert operation.get("description"), path
            if "/view" in path or "/charts" in path:
                continue
            assert {"403", "422"} <= set(operation["responses"]), path
    page = client.get("/docs").text
    assert all(path in page for path in api["paths"])
    assert "http://" not in page.replace("http://127.0.0.1", "")
    assert json.dumps(api).count("examples") > 10
