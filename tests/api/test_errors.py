"""One error shape, whatever goes wrong."""

import pytest

from tests.api.conftest import error_of, new_project, planned

UNKNOWN = "/api/v1/projects/" + "0" * 20


@pytest.mark.parametrize(("method", "path", "status"), [
    ("GET", "/nothing", 404), ("GET", "/api/v1/nothing", 404), ("PUT", "/api/v1/projects", 405), ("DELETE", "/docs", 405),
    ("GET", UNKNOWN, 404), ("GET", "/api/v1/projects/not-an-id", 404), ("GET", f"{UNKNOWN}/setup", 404),
    ("PUT", f"{UNKNOWN}/setup", 404), ("GET", f"{UNKNOWN}/state", 404), ("GET", f"{UNKNOWN}/archive", 404),
    ("POST", f"{UNKNOWN}/plan", 404), ("POST", f"{UNKNOWN}/scans", 404), ("PUT", f"{UNKNOWN}/part", 404),
    ("GET", f"{UNKNOWN}/programs/alignment", 404), ("GET", f"{UNKNOWN}/programs/other", 422),
    ("GET", f"{UNKNOWN}/alignments/0", 422), ("GET", f"{UNKNOWN}/alignments/99999999999999999999", 422),
    ("GET", "/api/v1/jobs/x", 404), ("DELETE", f"/api/v1/jobs/{'0' * 20}", 404),
    ("GET", f"/api/v1/jobs/{'0' * 20}/events", 404),
    ("GET", f"{UNKNOWN}/events", 404), ("POST", "/api/v1/projects/import", 422), ("GET", f"/view/{'0' * 20}/", 404),
])  # fmt: skip
def test_the_shape(client, method, path, status):
    body = {"json": {}} if path.endswith("setup") and method == "PUT" else {}
    answer = client.request(method, path, **body)
    error_of(answer, status)
    if status == 405:
        allowed = set(answer.headers["Allow"].split(", "))
        assert method not in allowed
        assert allowed


@pytest.mark.parametrize(("body", "where"), [
    (b"{", "body"), (b"[]", "body"), (b'{"name": 1}', "body.name"), (b'{"name": "a", "owner": "b"}', "body.owner"),
    (b'{"name": ""}', "name"), (b'{"name": "a\\u0000b"}', "name"), (b'{"name": "a\\u202eb"}', "name"),
    (b'{"name": "' + b"a" * 201 + b'"}', "name"), (b'{"name": "a", "sample": "../etc"}', "body.sample"), (b"\xff\xfe", "body"),
    (b'{"name": "\\ud800"}', "name"),
])  # fmt: skip
def test_bad_bodies_name_the_place(client, body, where):
    answer = client.post("/api/v1/projects", content=body, headers={"Content-Type": "application/json"})
    assert error_of(answer, 422)["where"].startswith(where)


def test_every_bad_field_of_a_setup_is_listed(client):
    address = new_project(client, part=None)
    bad = {"standoff_mm": -1, "probe": {"elements": 0, "colour": "red"}, "tolerances": {"tilt_deg": "x"}}
    issues = error_of(client.put(f"{address}/setup", json=bad), 422)["issues"]
    assert {i["where"] for i in issues} == {
        "body.standoff_mm", "body.probe.elements", "body.probe.colour", "body.tolerances.tilt_deg",
    }  # fmt: skip
    for number in ("NaN", "Infinity", "1e999"):
        raw = client.put(
            f"{address}/setup", content=f'{{"standoff_mm": {number}}}', headers={"Content-Type": "application/json"}
        )
        error_of(raw, 422)


def test_order_of_work_is_explained(client):
    address = new_project(client, part=None)
    assert error_of(client.post(f"{address}/plan"), 409)["code"] == "part-missing"
    assert error_of(client.post(f"{address}/keypoints/suggest"), 409)["code"] == "part-missing"
    assert error_of(client.post(f"{address}/simulate", json={}), 409)["code"] == "plan-missing"
    assert error_of(client.get(f"{address}/programs/corrected"), 409)["code"] == "alignment-missing"
    address = new_project(client)
    planned(client, address)
    assert error_of(client.post(f"{address}/alignments", json={}), 409)["code"] == "scan-missing"
    assert error_of(client.post(f"{address}/alignments", json={"scans": [3]}), 404)["code"] == "scan-unknown"
    error_of(client.post(f"{address}/alignments", json={"scans": [1, 1]}), 422)


def test_an_unreadable_or_unitless_part_changes_nothing(client):
    address = new_project(client)
    assert error_of(client.put(f"{address}/part", files={"file": ("a.stl", b"x")}), 422)["code"] == "unit-missing"
    assert (
        error_of(client.put(f"{address}/part", params={"name": "a.stp"}, content=b"broken"), 422)["code"]
        == "cad-broken"
    )
    assert error_of(client.put(f"{address}/part", params={"unit": "foot"}, content=b"x"), 422)["code"] == "unit-unknown"
    assert client.get(f"{address}/part").json()["version"] == 1


def test_limits(client):
    address = new_project(client)
    error_of(client.put(f"{address}/part", params={"unit": "mm"}, content=b"x" * 3_000_001), 413)

    def endless():
        for _ in range(1000):
            yield b"y" * 65536

    # Without a Content-Length the limit is found on the way.
    answer = client.put(f"{address}/part", params={"unit": "mm"}, content=endless())
    error_of(answer, 413)
    error_of(
        client.put(f"{address}/setup", content=b" " * (9 * 2**20), headers={"Content-Type": "application/json"}), 413
    )
    many = [{"id": f"K{i}", "x_mm": 0, "y_mm": 0, "z_mm": 0} for i in range(10_001)]
    error_of(client.put(f"{address}/keypoints", json=many), 422)
    doubled = [{"id": "K", "x_mm": 0, "y_mm": 0, "z_mm": 0}] * 2
    assert error_of(client.put(f"{address}/keypoints", json=doubled), 422)["code"] == "keypoint-doubled"
    assert client.get(f"{address}/part").json()["version"] == 1


@pytest.mark.parametrize("body", [
    b"", b"--x", b"--x\r\n", b"--x--\r\n", b"--x\r\n\r\nfile\r\n--x--\r\n",
    b'--x\r\nContent-Disposition: form-data; name="file"; filename="a.stl"\r\n\r\nabc',
    b'--x\r\nContent-Disposition: attachment; name="file"; filename="a.stl"\r\n\r\nabc\r\n--x--\r\n',
    b'--x\r\nContent-Disposition: form-data; filename="a.stl"\r\n\r\nabc\r\n--x--\r\n',
    b'--x\r\nContent-Disposition: form-data; name="a"\r\nContent-Disposition: form-data; name="b"\r\n\r\nz\r\n--x--\r\n',
    b'--x\r\nContent-Disposition: form-data; name="unit"\r\n\r\n' + b"m" * 5000 + b"\r\n--x--\r\n",
    b"".join(b'--x\r\nContent-Disposition: form-data; name="f%d"\r\n\r\nv\r\n' % i for i in range(20)) + b"--x--\r\n",
])  # fmt: skip
def test_crooked_forms_keep_nothing(client, body):
    address = new_project(client, part=None)
    answer = client.put(f"{address}/part", content=body, headers={"Content-Type": "multipart/form-data; boundary=x"})
    error_of(answer, 422)
    error_of(client.get(f"{address}/part"), 404)
    error_of(client.put(f"{address}/part", content=body, headers={"Content-Type": "multipart/form-data"}), 422)
