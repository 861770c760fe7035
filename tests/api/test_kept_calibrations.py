"""Calibrations are results: listed, downloaded, found in force or not, kept through a kill and an archive."""

import csv
import io
import json
import zipfile

import httpx
import pytest

from tests.api.conftest import error_of, new_project
from tests.api.server_process import running
from tests.api.test_calibrations import calibrated, couplant_csv, tilt_csv


def use(client, address, found, old=None):
    """Merge a patch of the probe into the setup in force, as a client would."""
    setup = client.get(f"{address}/setup").json()
    setup["probe"]["tilt_loss_db_per_deg2"] |= old or found["patch"]["probe"]["tilt_loss_db_per_deg2"]
    assert client.put(f"{address}/setup", json=setup).status_code == 200


def test_whether_it_is_in_force_follows_the_setup(client):
    address = new_project(client, part=None)
    made = calibrated(client, address, "tilt", ("tilt.csv", tilt_csv())).json()
    before = client.get(f"{address}/setup").json()["probe"]["tilt_loss_db_per_deg2"]

    def state():
        (row,) = client.get(f"{address}/calibrations").json()
        assert row == client.get(f"{address}/calibrations/1").json()
        return row["applied"], row["current"]

    assert (made["applied"], made["current"]) == state() == ("never", True)
    use(client, address, made)
    assert state() == ("now", False)
    use(client, address, made, before)
    # Taken back: the patch fits the cell again, and that it was in force once is not forgotten.
    assert state() == ("earlier", True)
    client.delete(f"{address}/calibrations/1")
    assert client.get(f"{address}/calibrations").json() == []
    assert client.get(f"{address}/setup").json()["probe"]["tilt_loss_db_per_deg2"] == before


def test_the_same_readings_in_the_same_cell_are_the_same_calibration(client):
    address = new_project(client, part=None)
    first = calibrated(client, address, "tilt", ("tilt.csv", tilt_csv())).json()
    assert calibrated(client, address, "tilt", ("tilt.csv", tilt_csv())).json() == first
    other = calibrated(client, address, "tilt", ("tilt.csv", tilt_csv(k_b=1.9))).json()
    use(client, address, other)
    # Another cell: what the same readings change of it is another question.
    again = calibrated(client, address, "tilt", ("tilt.csv", tilt_csv())).json()
    assert [first["number"], other["number"], again["number"]] == [1, 2, 3]
    assert again["setup_version"] > first["setup_version"]


def test_readings_reports_and_documents_are_downloaded(client):
    address = new_project(client, part=None)
    sent = [couplant_csv((5.0, 10.0)), couplant_csv((15.0, 20.0))]
    # Two files of one name stay two.
    calibrated(client, address, "couplant", ("Spalt ü.csv", sent[0]), ("Spalt ü.csv", sent[1]))
    at = f"{address}/calibrations/1"
    found = client.get(at).json()
    assert found["name"] == "Spalt ü.csv + Spalt ü.csv"
    assert [client.get(f"{at}/readings/{i}").content for i in (0, 1)] == sent
    error_of(client.get(f"{at}/readings/2"), 404)
    assert client.get(f"{at}/report", params={"format": "pdf"}).content.startswith(b"%PDF-")
    rows = list(csv.DictReader(io.StringIO(client.get(f"{at}/report", params={"format": "csv"}).text)))
    value = next(r for r in rows if r["row"] == "Speed of sound" and r["column"] == "value")
    assert float(value["value"]) == pytest.approx(found["estimates"]["sound_speed"]["value"])
    with zipfile.ZipFile(io.BytesIO(client.get(f"{at}/files").content)) as documents:
        assert json.loads(documents.read("calibration/patch.json")) == found["patch"]
        assert not [n for n in documents.namelist() if n.startswith("readings")]
    # What a result of a part has and a calibration has not.
    error_of(client.get(f"{at}/record"), 422)
    for wrong in ("0", "x", "-1"):
        error_of(client.get(f"{address}/calibrations/{wrong}"), 422)


def test_it_outlives_a_kill_and_travels_in_the_archive(tmp_path):
    with running(tmp_path / "data") as server:
        with httpx.Client(base_url=server.url, timeout=60.0) as client:
            address = new_project(client, part=None)
            made = calibrated(client, address, "tilt", ("tilt.csv", tilt_csv())).json()
            use(client, address, made)
            server.kill()
        server.start()
        with httpx.Client(base_url=server.url, timeout=60.0) as client:
            kept = client.get(f"{address}/calibrations").json()
            assert kept == [made | {"applied": "now", "current": False}]
            content = client.get(f"{address}/archive").content
            sent = client.post("/api/v1/projects/import", files={"file": ("p.zip", content)})
            assert sent.status_code == 201, sent.text
            copy = sent.headers["Location"]
            (arrived,) = client.get(f"{copy}/calibrations").json()
            assert arrived == kept[0] | {"report": f"{copy}/calibrations/1/report"}
            assert client.get(arrived["report"]).content == client.get(made["report"]).content
            assert client.get(f"{copy}/calibrations/1/readings/0").content == tilt_csv()
            assert client.get(f"{copy}/journal").json()["intact"] is True
