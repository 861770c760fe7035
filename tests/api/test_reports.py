"""Reports and the record over REST: what is written down later stands in the report that is downloaded then."""

import io
import json
import zipfile

from tests.api.conftest import aligned, error_of, new_project, planned


def ready(client, scan: bytes = b"x_mm\n1\n") -> str:
    address = new_project(client)
    planned(client, address)
    aligned(client, address, scan)
    return address


def test_the_record_is_guarded_like_every_input(client):
    address = new_project(client)
    empty = client.get(f"{address}/record")
    assert empty.json()["people"]["operator"] == ""
    sent = client.put(f"{address}/record", json={"people": {"operator": "A. Inspector"}})
    assert sent.status_code == 200, sent.text
    stale = client.put(f"{address}/record", json={}, headers={"If-Match": empty.headers["ETag"]})
    error_of(stale, 412)
    error_of(client.put(f"{address}/record", json={"people": {"nobody": 1}}), 422)
    error_of(client.put(f"{address}/record", json={"couplant": {"temperature_start_c": 300}}), 422)
    assert client.get(f"{address}/record").json()["people"]["operator"] == "A. Inspector"


def test_every_format_carries_the_record_and_the_acceptance_of_now(client):
    address = ready(client, b"x_mm\n1\n# want-partial\n")
    report = f"{address}/alignments/1/report"
    assert "A. Inspector" not in client.get(report).text
    client.put(f"{address}/record", json={"people": {"operator": "A. Inspector"}})
    accepted = client.post(
        f"{address}/alignments/1/accept", json={"name": "B. Reviewer", "reason": "gauge <b>agrees</b>"}
    )
    assert accepted.status_code == 200, accepted.text
    page = client.get(report)
    assert page.headers["content-type"].startswith("text/html")
    assert "sandbox" in page.headers["content-security-policy"]
    assert "A. Inspector" in page.text
    assert "Accepted by B. Reviewer" in page.text
    assert "gauge &lt;b&gt;agrees" in page.text
    found = client.get(report, params={"format": "json"}).json()
    assert found["record"]["people"]["operator"] == "A. Inspector"
    assert found["acceptance"]["name"] == "B. Reviewer"
    pdf = client.get(report, params={"format": "pdf", "download": True})
    assert pdf.headers["content-type"] == "application/pdf"
    assert pdf.headers["content-disposition"].startswith("attachment")
    assert pdf.content.startswith(b"%PDF-")
    assert "A. Inspector" in client.get(report, params={"format": "csv"}).text
    error_of(client.get(report, params={"format": "docx"}), 422)
    with zipfile.ZipFile(io.BytesIO(client.get(f"{address}/alignments/1/files").content)) as documents:
        assert "A. Inspector" in documents.read("correction/report.html").decode()
        assert json.loads(documents.read("correction/correction.json"))["verdict"] == "partial"


def test_a_drawing_by_its_name(client):
    address = ready(client)
    drawing = client.get(f"{address}/alignments/1/figures/field")
    assert drawing.headers["content-type"] == "image/svg+xml"
    assert drawing.text.startswith("<svg")
    error_of(client.get(f"{address}/alignments/1/figures/nothing"), 404)
    error_of(client.get(f"{address}/alignments/1/figures/NOT_A_NAME"), 422)


def test_an_earlier_alignment_can_be_put_in_force_again(client):
    address = ready(client)
    made = client.post(f"{address}/alignments", json={"non_rigid": True})
    assert made.status_code == 202
    again = aligned_number(client, address, 2)
    assert again["options"]["non_rigid"] is True
    assert client.get(f"{address}/alignments/1").json()["program"]["available"] is False
    used = client.post(f"{address}/alignments/1/use").json()
    assert used["number"] == 3
    assert used["options"]["non_rigid"] is False
    assert used["program"]["available"] is True
    # The one in force stays what it is.
    assert client.post(f"{address}/alignments/3/use").json()["number"] == 3
    assert client.get(f"{address}/programs/corrected").status_code == 200


def test_what_was_judged_or_reported_of_another_correction_says_so(client):
    address = ready(client)
    sent = client.post(f"{address}/scans", files={"file": ("s.csv", b"x_mm\n2\n")}, data={"base": "corrected"})
    assert sent.status_code == 201
    assert client.post(f"{address}/assessments", json={"scans": [2]}).status_code == 202
    assert aligned_number(client, address, 1, "assessments")["stale"] is False
    made = client.get(f"{address}/alignments/1").json()["created"]
    assert client.post(f"{address}/alignments", json={"non_rigid": True}).status_code == 202
    aligned_number(client, address, 2)
    # Another program is in force: the proof of the first is none of it, and its report is not the one that counts.
    judged = client.get(f"{address}/assessments/1").json()
    assert judged["stale_because"] == ["correction"]
    assert "OUT OF DATE" in client.get(f"{address}/alignments/1/report").text
    assert "OUT OF DATE" not in client.get(f"{address}/alignments/2/report").text
    used = client.post(f"{address}/alignments/1/use").json()
    assert used["created"] == made
    assert client.get(f"{address}/assessments/1").json()["stale"] is False
    assert "OUT OF DATE" not in client.get(f"{address}/alignments/1/report").text
    setup = client.get(f"{address}/setup").json()
    client.put(f"{address}/setup", json={**setup, "standoff_mm": 17.0})
    assert "OUT OF DATE" in client.get(f"{address}/alignments/{used['number']}/report").text
    error_of(client.post(f"{address}/alignments/2/use"), 409)


def test_a_scan_in_the_corrected_base_remembers_which_correction_that_was(client):
    address = ready(client)
    sent = client.post(f"{address}/scans", files={"file": ("s.csv", b"x_mm\n2\n")}, data={"base": "corrected"})
    known = sent.json()["detail"]["correction"]
    assert len(known) == 64
    # The file's second alignment reads it in the BASE that it was taken in, not in that of the first.
    for number in (2, 3):
        assert client.post(f"{address}/alignments", json={"scans": [2], "non_rigid": number == 3}).status_code == 202
        aligned_number(client, address, number)
        files = zipfile.ZipFile(io.BytesIO(client.get(f"{address}/alignments/{number}/files").content))
        assert json.loads(files.read("correction/correction.json"))["stood_in"] == known


def test_a_failed_alignment_cannot_be_put_in_force(client):
    address = ready(client, b"x_mm\n1\n# want-fail\n")
    aligned(client, address)
    assert error_of(client.post(f"{address}/alignments/1/use"), 409)["code"] == "alignment-failed"


def test_an_inspection_of_several_scans(client):
    address = ready(client)
    for text in (b"x_mm\n2\n", b"x_mm\n3\n"):
        sent = client.post(
            f"{address}/scans", files={"file": ("s.csv", text)}, data={"path": "corrected", "base": "corrected"}
        )
        assert sent.status_code == 201
    body = {"scans": [2, 3], "before": [1]}
    started = client.post(f"{address}/assessments", json=body)
    assert started.status_code == 202, started.text
    aligned_number(client, address, 1, "assessments")
    options = client.get(f"{address}/assessments/1").json()["options"]
    assert options["scans"] == [2, 3]
    assert options["before"] == [1]
    # As said with the upload, not what the person at the page remembers.
    assert options["base"] == "corrected"
    error_of(client.post(f"{address}/assessments", json={"scan": 1, "scans": [2]}), 422)
    error_of(client.post(f"{address}/assessments", json={"scans": [2, 2]}), 422)


def test_the_record_travels_in_the_archive(client):
    address = ready(client)
    client.put(f"{address}/record", json={"part": {"serial": "SN 77"}})
    archive = client.get(f"{address}/archive").content
    made = client.post("/api/v1/projects/import", files={"file": ("p.zip", archive)})
    assert made.status_code == 201, made.text
    other = made.headers["Location"]
    assert client.get(f"{other}/record").json()["part"]["serial"] == "SN 77"
    assert "SN 77" in client.get(f"{other}/alignments/1/report").text


def aligned_number(client, address: str, number: int, kind: str = "alignments") -> dict:
    """Wait for a result by its number."""
    from tests.api.server_process import finished  # noqa: PLC0415

    jobs = client.get(f"{address}/jobs").json()
    for job in jobs:
        finished(client, job)
    answer = client.get(f"{address}/{kind}/{number}")
    assert answer.status_code == 200, answer.text
    return answer.json()
