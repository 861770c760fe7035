"""Calibrations over REST: files written from analytic truth come back as the truth, kept and never put in force."""

import hashlib
import threading
from xml.etree import ElementTree as ET

import httpx
import numpy as np
import pytest

from alignment.simulator.write import write_readings_csv
from tests.api.conftest import error_of, new_project
from tests.calibrate.test_calibrate_tcp import SHIFT, TURN, record, tool_setup, true_tool

SPEED, DELAY = 1471.5, 0.42


def tilt_csv(k_b=1.7, k_c=0.8) -> bytes:
    b, c = (v.ravel() for v in np.meshgrid(np.linspace(-2, 2, 17), np.linspace(-2, 2, 17)))
    amplitude = 52.0 * 10 ** (-(k_b * (b - 0.2) ** 2 + k_c * (c + 0.1) ** 2) / 20.0)
    return table("b_deg,c_deg,amplitude_pct", b, c, amplitude)


def couplant_csv(gaps=(5.0, 10.0, 15.0, 20.0)) -> bytes:
    gap, echo = np.repeat(gaps, 2), np.tile([1.0, 2.0], len(gaps))
    return table("tof_us,gap_mm,echo", DELAY + 2e3 * echo * gap / SPEED, gap, echo)


def table(header, *columns) -> bytes:
    rows = "\n".join(",".join(f"{v:.9g}" for v in row) for row in np.column_stack(columns))
    return f"{header}\n{rows}\n".encode()


def calibrated(client, address, kind, *files, **fields):
    sent = [("file", file) for file in files]
    return client.post(f"{address}/calibrations/{kind}", files=sent, data=fields)


@pytest.fixture(scope="module")
def address(client):
    made = new_project(client, part=None)
    setup = tool_setup().model_dump(mode="json")
    assert client.put(f"{made}/setup", json=setup).status_code == 200
    return made


@pytest.fixture(scope="module")
def plane_scan(tmp_path_factory):
    """A scan of a plane by a tool that is off by TURN and SHIFT, as CSV."""
    path = tmp_path_factory.mktemp("plane") / "plane.csv"
    write_readings_csv(record(tool_setup(), TURN, SHIFT, np.random.default_rng(5)), path)
    return path.read_bytes()


def test_tilt_loss_is_found_drawn_and_put_in_force_by_the_client(client, address):
    before = client.get(f"{address}/setup")
    sent = tilt_csv()
    answer = calibrated(client, address, "tilt", ("tilt.csv", sent))
    assert answer.status_code == 201, answer.text
    found = answer.json()
    assert found["ok"]
    assert found["kind"] == "tilt"
    assert found["estimates"]["k_b"]["value"] == pytest.approx(1.7, abs=1e-6)
    assert found["estimates"]["zero_c"]["value"] == pytest.approx(-0.1, abs=1e-6)
    assert {e["status"] for e in found["estimates"].values()} == {"measured"}
    assert found["patch"] == {"probe": {"tilt_loss_db_per_deg2": {"b": 1.7, "c": 0.8}}}
    assert found["inputs"] == [{"name": "tilt.csv", "sha256": hashlib.sha256(sent).hexdigest()}]
    assert answer.headers["Location"] + "/report" == found["report"]
    drawing = client.get(f"{answer.headers['Location']}/figures/tilt")
    assert ET.fromstring(drawing.text).tag.endswith("}svg")
    report = client.get(found["report"]).text
    assert report.startswith("<!doctype html>")
    assert found["inputs"][0]["sha256"] in report
    # Nothing is put in force by asking; the client merges the patch and says of which version it is.
    after = client.get(f"{address}/setup")
    assert (after.headers["ETag"], after.json()) == (before.headers["ETag"], before.json())
    assert before.headers["ETag"] == f'"{found["setup_version"]}"'
    merged = before.json()
    merged["probe"]["tilt_loss_db_per_deg2"] |= found["patch"]["probe"]["tilt_loss_db_per_deg2"]
    tag = {"If-Match": f'"{found["setup_version"]}"'}
    assert client.put(f"{address}/setup", json=merged, headers=tag).status_code == 200
    assert client.put(f"{address}/setup", json=merged, headers={"If-Match": '"999"'}).status_code == 412
    assert client.put(f"{address}/setup", json=before.json()).status_code == 200


def test_couplant_from_a_bare_body_and_from_two_files(client, address):
    bare = client.post(f"{address}/calibrations/couplant", params={"name": "gaps.csv"}, content=couplant_csv())
    two = calibrated(
        client, address, "couplant", ("a.csv", couplant_csv((5.0, 10.0))), ("b.csv", couplant_csv((15.0, 20.0)))
    )
    for answer in (bare, two):
        assert answer.status_code == 201, answer.text
        found = answer.json()
        assert found["estimates"]["sound_speed"]["value"] == pytest.approx(SPEED, abs=1e-3)
        assert found["estimates"]["delay"]["value"] == pytest.approx(DELAY, abs=1e-6)
        assert found["readings"] == 8
    assert [f["name"] for f in bare.json()["inputs"]] == ["gaps.csv"]
    assert [f["name"] for f in two.json()["inputs"]] == ["a.csv", "b.csv"]


def test_the_tcp_from_a_plane_uses_the_setup_in_force(client, address, plane_scan):
    answer = calibrated(client, address, "tcp", ("plane.csv", plane_scan), target="plane")
    assert answer.status_code == 201, answer.text
    found = answer.json()
    assert found["estimates"]["z"]["status"] == "held"
    for axis, truth in zip("cbaxy", [*TURN, *SHIFT[:2]], strict=True):
        estimate = found["estimates"][axis]
        assert abs(estimate["value"] - truth) <= 1.5 * estimate["half_95"], axis
    # The patch is of the project's own tool, which is not that of an empty setup.
    real = true_tool(tool_setup(), TURN, SHIFT)
    tcp = found["patch"]["tool"]["tcp"]
    assert np.allclose([tcp["x_mm"], tcp["y_mm"], tcp["z_mm"]], real.xyz_mm, atol=0.3)
    assert found["simulated"]
    assert "SIMULATED" in client.get(found["report"]).text  # the simulator's own writer says so in the file
    other = calibrated(client, new_project(client, part=None), "tcp", ("plane.csv", plane_scan))
    assert other.json().get("patch") != found["patch"]


def test_what_cannot_be_calibrated_is_said_in_words(client, address, plane_scan):
    tilt = ("tilt.csv", tilt_csv())
    wrong = error_of(calibrated(client, address, "couplant", tilt), 422)
    assert wrong["code"] == "calibration-file"
    assert wrong["where"] == "tilt.csv"
    assert "tof_us" in wrong["message"]
    assert error_of(calibrated(client, address, "tilt", ("empty.csv", b"")), 422)["where"] == "empty.csv"
    assert error_of(calibrated(client, address, "temperature", tilt), 422)["code"] == "field-invalid"
    assert error_of(client.post(f"{address}/calibrations/tilt"), 422)["code"] == "file-missing"
    three = calibrated(client, address, "tcp", *[(f"{i}.csv", plane_scan) for i in range(3)])
    assert error_of(three, 422)["code"] == "scan-files"
    two = error_of(calibrated(client, address, "tcp", ("a.csv", plane_scan), ("b.csv", plane_scan)), 422)
    assert "a.csv" in two["where"]
    lacking = error_of(
        calibrated(client, address, "couplant", ("a.csv", couplant_csv()), ("b.csv", b"tof_us\n1\n")), 422
    )
    assert lacking["where"] == "b.csv"
    many = calibrated(client, address, "tilt", *[(f"{i}.csv", b"x") for i in range(9)])
    assert error_of(many, 422)["code"] == "files-too-many"


def test_target_and_radius_are_checked(client, address, plane_scan):
    tilt, scan = ("tilt.csv", tilt_csv()), ("plane.csv", plane_scan)
    assert error_of(calibrated(client, address, "tilt", tilt, target="sphere"), 422)["code"] == "calibration-target"
    assert error_of(calibrated(client, address, "tcp", scan, target="cube"), 422)["code"] == "target-unknown"
    for radius in ("-1", "0", "nan", "inf", "big", "1e9"):
        assert error_of(calibrated(client, address, "tcp", scan, radius_mm=radius), 422)["code"] == "radius_mm-invalid"
    # A plane is no ball: asked for a sphere, the answer is a sentence.
    ball = error_of(calibrated(client, address, "tcp", scan, target="sphere", radius_mm="20"), 422)
    assert ball["code"] == "tcp-readings"
    assert error_of(client.post("/api/v1/projects/nobody/calibrations/tilt", content=b"x"), 404)


def test_of_what_is_refused_or_deleted_nothing_stays(client, server):
    address = new_project(client, part=None)
    blobs = server.data / "blobs"
    before = {p for p in blobs.rglob("*") if p.is_file()}
    error_of(calibrated(client, address, "tilt", ("c.csv", b"no,columns\n1,2\n")), 422)
    assert client.get(f"{address}/calibrations").json() == []
    assert {p for p in blobs.rglob("*") if p.is_file()} == before
    made = calibrated(client, address, "couplant", ("c.csv", couplant_csv((6.0, 11.0)))).headers["Location"]
    assert {p for p in blobs.rglob("*") if p.is_file()} > before
    assert client.delete(made).status_code == 204
    assert {p for p in blobs.rglob("*") if p.is_file()} == before
    for gone in (made, f"{made}/report", f"{made}/readings/0", f"{made}/files"):
        assert error_of(client.get(gone), 404)["code"]
    assert error_of(client.delete(made), 404)["code"] == "calibration-unknown"


def test_the_server_answers_others_meanwhile(client, server, address, tmp_path):
    # A scan of its own: one that is known already is answered at once.
    write_readings_csv(record(tool_setup(), TURN, SHIFT, np.random.default_rng(6)), tmp_path / "other.csv")
    scan, answers = (tmp_path / "other.csv").read_bytes(), []

    def ask():
        with httpx.Client(base_url=server.url, timeout=60.0) as own:
            answers.append(calibrated(own, address, "tcp", ("other.csv", scan)).status_code)

    thread = threading.Thread(target=ask)
    thread.start()
    meanwhile = 0
    while thread.is_alive():
        assert client.get("/api/v1/health").status_code == 200
        meanwhile += thread.is_alive()
    thread.join()
    assert answers == [201]
    # Held up by the calibration, one could come before it and one with its end.
    assert meanwhile > 2
