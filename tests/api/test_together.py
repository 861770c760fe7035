"""Scans of several projects of one part: one job, one alignment in each of them, each stale when another one moves on."""

import pytest

from tests.api.conftest import aligned, error_of, new_project, planned
from tests.api.server_process import finished


def project_of(address: str) -> str:
    return address.rsplit("/", 1)[-1]


def scanned(client, name, scan=b"x_mm\n1\n", part="panel.stl"):
    address = new_project(client, name, part)
    planned(client, address)
    assert client.post(f"{address}/scans", files={"file": ("scan.csv", scan)}).status_code == 201
    return address


def align(client, address, *others):
    body = {"together": [{"project": project_of(other)} for other in others]}
    started = client.post(f"{address}/alignments", json=body)
    assert started.status_code == 202, started.text
    return finished(client, started.json())


def test_every_project_gets_its_own_alignment(client):
    skin, flange = scanned(client, "Skin"), scanned(client, "Flange", b"x_mm\n2\n")
    aligned(client, flange)
    job = align(client, skin, flange)
    assert job["result"] == {
        "number": 1,
        "verdict": "pass",
        "together": [{"project": project_of(flange), "number": 2, "verdict": "pass"}],
    }
    for address, number, name, other in ((skin, 1, "Skin", "Flange"), (flange, 2, "Flange", "Skin")):
        found = client.get(f"{address}/alignments/{number}").json()
        assert found["called"] == name
        assert found["options"]["together"] == [other]
        assert found["stale"] is False
        assert client.get(f"{address}/programs/corrected").status_code == 200
        assert client.get(f"{address}/alignments/{number}/report").status_code == 200
        assert client.get(f"{address}/journal").json()["intact"] is True
    # The same question again is not computed again.
    assert align(client, skin, flange)["id"] == job["id"]


@pytest.mark.parametrize("change", ["scan", "plan"])
def test_what_changes_in_one_project_makes_the_others_stale(client, change):
    skin, flange = scanned(client, "Skin"), scanned(client, "Flange", b"x_mm\n2\n")
    align(client, skin, flange)
    if change == "scan":
        assert client.delete(f"{flange}/scans/1").status_code == 204
    else:
        client.put(f"{flange}/setup", json={"standoff_mm": 16.0})
    found = client.get(f"{skin}/alignments/1").json()
    assert found["stale_because"] == ["together"]
    assert "aligned together" in error_of(client.get(f"{skin}/programs/corrected"), 409)["message"]


def test_a_deleted_companion_changes_nothing_that_was_measured(client):
    skin, flange = scanned(client, "Skin"), scanned(client, "Flange", b"x_mm\n2\n")
    align(client, skin, flange)
    assert client.delete(flange).status_code == 204
    assert client.get(f"{skin}/alignments/1").json()["stale"] is False
    assert client.get(f"{skin}/programs/corrected").status_code == 200


def test_companions_are_listed_with_what_they_lack(client):
    skin = scanned(client, "Skin", part="only-here.stl")
    client.put(f"{skin}/part", files={"file": ("only-here.stl", b"solid of its own")}, data={"unit": "mm"})
    bare = new_project(client, "Bare", None)
    assert client.get(f"{skin}/together").json() == []
    assert client.get(f"{bare}/together").json() == []
    client.put(f"{bare}/part", files={"file": ("other-name.stl", b"solid of its own")}, data={"unit": "mm"})
    (found,) = client.get(f"{skin}/together").json()
    assert found["project"] == project_of(bare)
    assert "not planned" in found["missing"]
    planned(client, bare)
    assert "no alignment scan" in client.get(f"{skin}/together").json()[0]["missing"]
    client.post(f"{bare}/scans", files={"file": ("scan.csv", b"x_mm\n1\n")})
    (found,) = client.get(f"{skin}/together").json()
    assert (found["missing"], found["scans"], found["name"]) == ("", [1], "Bare")
    client.put(f"{bare}/setup", json={"standoff_mm": 16.0})
    assert "out of date" in client.get(f"{skin}/together").json()[0]["missing"]


def test_what_cannot_go_together_is_refused_before_the_work(client):
    skin = scanned(client, "Skin")
    other = new_project(client, "Other", None)
    client.put(f"{other}/part", files={"file": ("panel.stl", b"solid y")}, data={"unit": "mm"})

    def refused(body, status):
        return error_of(client.post(f"{skin}/alignments", json={"together": body}), status)["code"]

    assert refused([{"project": project_of(other)}], 422) == "parts-differ"
    assert refused([{"project": project_of(skin)}], 422) == "project-twice"
    assert refused([{"project": "0" * 20}], 404) == "project-unknown"
    same = new_project(client, "Not planned")
    assert refused([{"project": project_of(same)}], 409) == "plan-missing"
    answer = client.post(f"{skin}/alignments", json={"together": [{"project": project_of(same)}]})
    assert "'Not planned'" in answer.json()["error"]["message"]
