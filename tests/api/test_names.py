"""Names are data: whatever people call their things, it is shown, downloaded, and never used as a path."""

import io
import zipfile

import pytest

from tests.api.conftest import new_project, planned

NAMES = [
    "../../etc/passwd", "..\\..\\boot.ini", "C:\\evil.stl", "/etc/shadow", "a/b/c", "con", "NUL.txt", ".htaccess", "-rf *",
    '"; rm -rf / #', "<script>alert(1)</script>", "'; DROP TABLE projects; --", "%2e%2e%2f", "${jndi:x}", "{{7*7}}", "a;b=c",
    "Flügelschale Ä", "翼の外板", "🛠 part", "x" * 200, "name\twith", "é" * 100, "~", "...", "=cmd|' /C calc'!A0",
]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_project_names(client, name):
    made = client.post("/api/v1/projects", json={"name": name})
    if "\t" in name:
        assert made.status_code == 422
        return
    assert made.status_code == 201
    address = made.headers["Location"]
    assert client.get(address).json()["name"]
    archive = client.get(f"{address}/archive")
    header = archive.headers["Content-Disposition"]
    assert header.startswith('attachment; filename="')
    ascii_name = header.split('"')[1]
    assert ascii_name.isascii()
    assert not set(ascii_name) & set('/\\":;<>|*?% ')
    assert header.count('"') == 2
    assert client.delete(address).status_code == 204


@pytest.mark.parametrize("name", NAMES)
def test_part_and_scan_names(client, server, name):
    address = new_project(client, part=None)
    sent = client.put(f"{address}/part", params={"unit": "mm", "name": name}, content=b"solid")
    assert sent.status_code == 200, sent.text
    shown = sent.json()["name"]
    assert "/" not in shown
    assert "\\" not in shown
    # What is sent as a form may say more than a query can; the same rule holds.
    form = client.post(f"{address}/scans", files={"file": (name + ".csv", b"x_mm\n1\n")})
    assert form.status_code == 201
    stored = form.json()["files"][0]["name"]
    assert "/" not in stored
    download = client.get(f"{address}/scans/1/files/0")
    assert download.headers["Content-Disposition"].startswith("attachment")
    assert download.headers["Content-Type"] == "application/octet-stream"
    with zipfile.ZipFile(io.BytesIO(client.get(f"{address}/archive").content)) as archive:
        assert all(".." not in n.split("/") and not n.startswith("/") and n.isascii() for n in archive.namelist())
    outside = {p for p in server.data.rglob("*") if p.is_file() and not p.name.startswith("echobase.db")}
    # Beside the blobs only what the server makes under names of its own.
    outside = {p for p in outside if server.data / "tmp" not in p.parents}
    assert all(p.parent.parent.name == "blobs" or p.name == "server.lock" for p in outside)


def test_a_part_called_like_a_place_can_be_planned(client):
    address = new_project(client, part="../../../tmp/evil.stl")
    assert planned(client, address)["state"] == "done"
    assert client.get(f"{address}/part").json()["name"] == "evil.stl"
