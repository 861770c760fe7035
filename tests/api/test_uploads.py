"""Uploads of any size: bounded memory, nothing lost by a kill, nothing kept of what failed."""

import hashlib
import random
import threading
from pathlib import Path

import httpx
import pytest

from tests.api.conftest import error_of, new_project
from tests.api.server_process import ServerProcess, running

HDF5 = b"\x89HDF\r\n\x1a\n"
MIB = 2**20


def resident_mb(pid: int) -> tuple[float, float]:
    """Return the resident memory of a process, now and at its peak (MB)."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    values = {
        line.split(":")[0]: float(line.split()[1]) / 1024 for line in lines if line.startswith(("VmRSS", "VmHWM"))
    }
    return values["VmRSS"], values["VmHWM"]


def pattern(size: int) -> list[bytes]:
    """Return `size` bytes of noise in pieces."""
    piece = random.Random(4).randbytes(MIB)
    # It begins like a format whose content is anything.
    return [HDF5 + piece[len(HDF5) :], *[piece] * (size // MIB - 1)]


@pytest.mark.parametrize("how", ["raw", "form"])
def test_200_mb_do_not_stay_in_memory(client, server, how):
    address = new_project(client, part=None)
    pieces = pattern(200 * MIB)
    whole = hashlib.sha256()
    for piece in pieces:
        whole.update(piece)
    before, _ = resident_mb(server.pid)
    Path(f"/proc/{server.pid}/clear_refs").write_text("5")  # forget the peak so far
    head = b'--b\r\nContent-Disposition: form-data; name="file"; filename="big.h5"\r\n\r\n'
    body = [head, *pieces, b"\r\n--b--\r\n"] if how == "form" else pieces
    headers = {"Content-Type": "multipart/form-data; boundary=b"} if how == "form" else {}
    made = client.post(f"{address}/scans", params={"name": "big.h5"}, content=iter(body), headers=headers)
    assert made.status_code == 201, made.text
    assert made.json()["files"][0]["sha256"] == whole.hexdigest()
    _, peak = resident_mb(server.pid)
    assert peak - before < 64
    client.delete(address)


def test_an_interrupted_upload_leaves_nothing(client, server):
    address = new_project(client, part=None)

    def broken():
        yield b"x" * MIB
        raise ConnectionAbortedError

    with pytest.raises(ConnectionAbortedError):
        client.post(f"{address}/scans", params={"name": "a.csv"}, content=broken())
    # The server notices when it next reads; a request that it answers afterwards was served by the same loop.
    for _ in range(200):
        client.get("/api/v1/health")
        if not list((server.data / "blobs" / "tmp").iterdir()):
            break
    assert list((server.data / "blobs" / "tmp").iterdir()) == []
    assert client.get(f"{address}/scans").json() == []


def test_a_disk_without_room_says_so(tmp_path):
    with running(tmp_path, min_free_bytes=10**18) as server, httpx.Client(base_url=server.url) as client:
        address = client.post("/api/v1/projects", json={"name": "x"}).headers["Location"]
        assert error_of(client.post(f"{address}/scans", content=b"x" * 100), 507)["code"] == "disk-full"
        assert list((tmp_path / "blobs" / "tmp").iterdir()) == []
        assert client.get("/api/v1/health").status_code == 200


@pytest.mark.slow
def test_nothing_acknowledged_is_lost_by_kills(tmp_path):
    """Uploads and edits under SIGKILL: after every restart, all that was answered is there, whole."""
    server = ServerProcess(tmp_path)
    dice = random.Random(11)
    acknowledged: list[tuple[str, int, str]] = []
    versions: dict[str, int] = {}
    for _ in range(15):
        server.start()
        with httpx.Client(base_url=server.url, timeout=30.0) as client:
            address = client.post("/api/v1/projects", json={"name": "k"}).headers["Location"]
        stop, answered = threading.Event(), threading.Semaphore(0)
        threads = [
            threading.Thread(target=_upload, args=(server.url, address, n, stop, answered, acknowledged, versions))
            for n in range(3)
        ]
        for thread in threads:
            thread.start()
        for _ in range(dice.randrange(1, 8)):
            assert answered.acquire(timeout=30)
        stop.wait(dice.uniform(0.0, 0.02))
        server.kill()
        stop.set()
        for thread in threads:
            thread.join()
    server.start()
    try:
        with httpx.Client(base_url=server.url, timeout=30.0) as client:
            assert client.get("/api/v1/health").json()["missing_files"] == 0
            assert list((tmp_path / "blobs" / "tmp").iterdir()) == []
            for address, number, digest in acknowledged:
                content = client.get(f"{address}/scans/{number}/files/0")
                assert hashlib.sha256(content.content).hexdigest() == digest
            for address, version in versions.items():
                assert int(client.get(f"{address}/setup").headers["ETag"].strip('"')) >= version
                assert client.get(f"{address}/journal").json()["intact"] is True
            named = {
                f["sha256"]
                for a in {a for a, _, _ in acknowledged}
                for s in client.get(f"{a}/scans").json()
                for f in s["files"]
            }
        assert {p.name for p in (tmp_path / "blobs").glob("??/*")} == named
        assert len(acknowledged) > 20
    finally:
        server.stop()


def _upload(url, address, seed, stop, answered, acknowledged, versions) -> None:
    dice = random.Random(seed + len(acknowledged))
    with httpx.Client(base_url=url, timeout=10.0) as client:
        while not stop.is_set():
            data = HDF5 + dice.randbytes(dice.randrange(1, 300_000))
            try:
                made = client.post(f"{address}/scans", params={"name": "s.h5"}, content=data)
                if made.status_code == 201:
                    acknowledged.append((address, made.json()["number"], hashlib.sha256(data).hexdigest()))
                    answered.release()
                put = client.put(f"{address}/setup", json={"standoff_mm": dice.uniform(5.0, 50.0)})
                if put.status_code == 200:
                    version = int(put.headers["ETag"].strip('"'))
                    versions[address] = max(versions.get(address, 0), version)
            except httpx.TransportError:
                return
