"""Archives: out and in again, and nothing in them is believed."""

import hashlib
import io
import json
import zipfile

import pytest

from app.store.content import canonical, digest_of
from tests.api.conftest import aligned, error_of, new_project, planned


@pytest.fixture(scope="module")
def archived(client):
    address = new_project(client, name="Träger / 7 ../..")
    planned(client, address)
    aligned(client, address, b"x_mm\n1\n# want-partial")
    client.post(f"{address}/alignments/1/accept", json={"name": "A", "reason": "b"})
    answer = client.get(f"{address}/archive")
    assert answer.status_code == 200
    return address, answer.content


def members(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None
        return {name: archive.read(name) for name in archive.namelist()}


def packed(files: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def sealed(manifest: dict) -> bytes:
    """Return a manifest with the digest an honest writer would give it."""
    body = {key: value for key, value in manifest.items() if key != "digest"}
    return canonical({**body, "digest": digest_of(body)}).encode()


def send(client, content: bytes):
    return client.post("/api/v1/projects/import", files={"file": ("p.zip", content)})


def test_round_trip(client, archived):
    address, content = archived
    made = send(client, content)
    assert made.status_code == 201, made.text
    copy = made.headers["Location"]
    assert copy != address
    for path in ("setup", "keypoints", "surface", "part", "scans", "alignments/1", "plan"):
        before, after = client.get(f"{address}/{path}").json(), client.get(f"{copy}/{path}").json()
        text = json.dumps(after).replace(copy, address)
        assert json.loads(text) == before, path
    for which in ("alignment", "inspection", "corrected"):
        assert client.get(f"{copy}/programs/{which}").content == client.get(f"{address}/programs/{which}").content
    journal = client.get(f"{copy}/journal").json()
    assert journal["intact"] is True
    assert journal["lines"][0]["action"] == "project-imported"
    # What comes out of the copy is the same again, but for names and times.
    again = members(client.get(f"{copy}/archive").content)
    first = members(content)
    assert {n: c for n, c in again.items() if n != "project.json"} == {
        n: c for n, c in first.items() if n != "project.json"
    }
    client.delete(copy)
    assert client.get(f"{address}/programs/corrected").status_code == 200


def test_names_inside_are_harmless(archived):
    _, content = archived
    for name in members(content):
        assert not name.startswith("/")
        assert ".." not in name
        assert name.isascii()
        assert "\\" not in name


def test_a_changed_file_is_found(client, archived):
    files = members(archived[1])
    name = next(n for n in files if n.endswith(".src"))
    files[name] = files[name].replace(b"END", b"HALT\r\nEND")
    assert error_of(send(client, packed(files)), 422)["code"] in ("archive-unusable", "file-too-large")


def test_a_changed_file_of_the_same_size_is_found(client, archived):
    files = members(archived[1])
    name = next(n for n in files if n.endswith(".src"))
    files[name] = files[name].replace(b"DEF", b"deF")
    assert error_of(send(client, packed(files)), 422)["code"] == "archive-unusable"


def test_a_forged_list_is_found(client, archived):
    files = members(archived[1])
    manifest = json.loads(files["project.json"])

    def forge(change) -> int:
        forged = json.loads(json.dumps(manifest))
        change(forged)
        return send(client, packed(files | {"project.json": sealed(forged)})).status_code

    def entry(kind: str) -> int:
        return next(i for i, f in enumerate(manifest["files"]) if f["owner"].startswith(kind))

    forgeries = [
        lambda m: m["results"][0].update(sha256="0" * 64),
        lambda m: m["inputs"][0].update(content="{}"),
        lambda m: m["inputs"][-1].update(content='[{"id": "K1", "x_mm": "a", "y_mm": 0, "z_mm": 0}]'),
        lambda m: m["scans"][0].update(base="corrected"),
        lambda m: m["journal"][0]["detail"].update(name="other"),
        lambda m: m["journal"].pop(),
        lambda m: m["results"][0].update(verdict="perfect"),
        lambda m: m["files"][entry("plan")].update(name="../../evil"),
        lambda m: m["files"][entry("plan")].update(name="/etc/passwd"),
        lambda m: m["files"][entry("scan")].update(name="a/b"),
        lambda m: m["files"][0].update(owner="project:../x"),
        lambda m: m["files"].append(dict(m["files"][0], name="twin", member="not-there")),
        lambda m: m["project"].update(name="a\nb"),
        lambda m: m.update(format=2),
        lambda m: m.update(more=1),
    ]
    # A journal cut at its end is whole in itself; everything else must be found.
    codes = [forge(change) for change in forgeries]
    assert [c for i, c in enumerate(codes) if i != 5] == [422] * (len(codes) - 1)


def hostile() -> dict[str, bytes]:
    """Return crafted archives by name."""
    link = zipfile.ZipInfo("plan-1/link")
    link.external_attr = 0o120777 << 16
    with_link = io.BytesIO()
    with zipfile.ZipFile(with_link, "w") as archive:
        archive.writestr(link, "/etc/passwd")
    bomb = packed({"project.json": b"{}", "plan-1/zeros": b"\0" * (64 * 2**20)})
    listed_bomb = packed({"project.json": b" " * (300 * 2**20)})
    return {
        "empty": b"", "text": b"not a zip", "no list": packed({"a": b"b"}),
        "list of nothing": packed({"project.json": b"[]"}),
        "list not JSON": packed({"project.json": b"{"}), "deep": packed({"project.json": b"[" * 200_000}),
        "climbing": packed({"project.json": b"{}", "../../evil": b"x"}),
        "absolute": packed({"project.json": b"{}", "/evil": b"x"}),
        "backslash": packed({"project.json": b"{}", "a\\..\\evil": b"x"}),
        "drive": packed({"project.json": b"{}", "C:evil": b"x"}),
        "link": with_link.getvalue(), "bomb": bomb, "bomb in the list": listed_bomb,
        "many": packed({f"f{i}": b"" for i in range(20_001)}, zipfile.ZIP_STORED),
    }  # fmt: skip


@pytest.fixture(scope="module")
def crafted():
    return hostile()


@pytest.mark.parametrize("name", [
    "empty", "text", "no list", "list of nothing", "list not JSON", "deep", "climbing", "absolute", "backslash", "drive",
    "link", "bomb", "bomb in the list", "many",
])  # fmt: skip
def test_hostile_archives_are_refused(client, crafted, name):
    error_of(send(client, crafted[name]), 422)


def test_truncated_archives_are_refused_and_leave_nothing(client, server, archived):
    content = archived[1]
    blobs = server.data / "blobs"
    client.post("/api/v1/projects/import", content=content[:-1])
    before = {p.name for p in blobs.glob("??/*")}
    for share in (0.1, 0.5, 0.9, 0.999):
        error_of(send(client, content[: int(len(content) * share)]), 422)
    after = {p.name for p in blobs.glob("??/*")}
    # The uploads themselves have no row; they go with the next sweep and name no project.
    assert all(hashlib.sha256((blobs / n[:2] / n).read_bytes()).hexdigest() == n for n in after)
    assert list((blobs / "tmp").iterdir()) == []
    assert len(after - before) <= 5
