"""One record per result: what is written down for the next piece does not reach the report of this one."""

import pytest

from tests.api.conftest import aligned, error_of, new_project, planned
from tests.api.server_process import finished


def serial(text: str) -> dict:
    return {"part": {"serial": text}}


def report(client, address: str, number: int) -> str:
    return client.get(f"{address}/alignments/{number}/report").text


@pytest.fixture
def piece(client):
    address = new_project(client)
    planned(client, address)
    client.put(f"{address}/record", json=serial("SN-ONE"))
    aligned(client, address)
    return address


def test_the_next_piece_leaves_the_reports_before_as_they_are(client, piece):
    client.put(f"{piece}/record", json=serial("SN-TWO"))
    aligned(client, piece, b"x_mm\n2\n")
    client.put(f"{piece}/record", json=serial("SN-THREE"))
    for number, own, others in ((1, "SN-ONE", ("SN-TWO", "SN-THREE")), (2, "SN-TWO", ("SN-ONE", "SN-THREE"))):
        text = report(client, piece, number)
        assert own in text
        assert not any(other in text for other in others)
        assert client.get(f"{piece}/alignments/{number}/record").json()["part"]["serial"] == own


def test_editing_a_result_changes_its_report_and_no_other(client, piece):
    aligned(client, piece, b"x_mm\n2\n")
    first = f"{piece}/alignments/1/record"
    read = client.get(first)
    assert read.headers["ETag"] == '"0"'
    sent = client.put(first, json=serial("SN-1-CORRECTED"), headers={"If-Match": read.headers["ETag"]})
    assert sent.headers["ETag"] == '"1"'
    error_of(client.put(first, json=serial("late"), headers={"If-Match": read.headers["ETag"]}), 412)
    assert "SN-1-CORRECTED" in report(client, piece, 1)
    assert "CORRECTED" not in report(client, piece, 2)
    assert client.get(f"{piece}/record").json()["part"]["serial"] == "SN-ONE"
    error_of(client.put(first, json={"part": {"nobody": 1}}), 422)
    error_of(client.get(f"{piece}/alignments/9/record"), 404)
    journal = client.get(f"{piece}/journal").json()
    assert journal["intact"]
    assert "record-al-1-set" in [line["action"] for line in journal["lines"]]


def test_a_result_without_a_record_takes_the_first_and_keeps_it(client):
    address = new_project(client)
    planned(client, address)
    aligned(client, address)
    assert client.get(f"{address}/alignments/1/record").json()["part"]["serial"] == ""
    client.put(f"{address}/record", json=serial("SN-ONE"))
    client.put(f"{address}/record", json=serial("SN-TWO"))
    assert client.get(f"{address}/alignments/1/record").json()["part"]["serial"] == "SN-ONE"


def test_assessments_have_their_own(client, piece):
    client.post(f"{piece}/scans", params={"name": "i.csv", "path": "inspection"}, content=b"x_mm\n2\n")
    finished(client, client.post(f"{piece}/assessments", json={}).json())
    client.put(f"{piece}/record", json=serial("SN-TWO"))
    client.put(f"{piece}/assessments/1/record", json=serial("SN-ONE-AFTER"))
    assert client.get(f"{piece}/assessments/1/record").json()["part"]["serial"] == "SN-ONE-AFTER"
    assert client.get(f"{piece}/alignments/1/record").json()["part"]["serial"] == "SN-ONE"
    assert client.get(f"{piece}/record").json()["part"]["serial"] == "SN-TWO"


def test_an_alignment_used_again_is_still_about_its_piece(client, piece):
    client.put(f"{piece}/alignments/1/record", json=serial("SN-ONE-B"))
    client.put(f"{piece}/record", json=serial("SN-TWO"))
    aligned(client, piece, b"x_mm\n2\n")
    again = client.post(f"{piece}/alignments/1/use").json()
    assert again["number"] == 3
    assert client.get(f"{piece}/alignments/3/record").json()["part"]["serial"] == "SN-ONE-B"
    # Without an edit of its own, too.
    third = client.post(f"{piece}/alignments/2/use").json()["number"]
    client.put(f"{piece}/record", json=serial("SN-THREE"))
    assert client.get(f"{piece}/alignments/{third}/record").json()["part"]["serial"] == "SN-TWO"


def test_records_of_results_travel_in_the_archive(client, piece):
    client.put(f"{piece}/alignments/1/record", json=serial("SN-ONE-B"))
    client.put(f"{piece}/record", json=serial("SN-TWO"))
    made = client.post("/api/v1/projects/import", files={"file": ("p.zip", client.get(f"{piece}/archive").content)})
    assert made.status_code == 201, made.text
    other = made.headers["Location"]
    assert client.get(f"{other}/alignments/1/record").json()["part"]["serial"] == "SN-ONE-B"
    assert client.get(f"{other}/record").json()["part"]["serial"] == "SN-TWO"
