"""Temporary files: in the data folder, gone after a stop, and cleared by the next start after a kill; never those of others."""

import os
import tempfile
from pathlib import Path

import httpx
import pytest

from app.scratch import clear
from tests.api.conftest import new_project
from tests.api.server_process import ServerProcess, events, finished


@pytest.fixture
def short_folder():
    with tempfile.TemporaryDirectory() as folder:
        yield folder


def busy(client: httpx.Client, part: str = "slow.stl") -> dict:
    """Start a job that takes until it is cancelled, and return it once it has reported."""
    job = client.post(f"{new_project(client, part=part)}/plan").json()
    for _, _, data in events(client, f"/api/v1/jobs/{job['id']}/events"):
        if data["state"] == "running" and data["fraction"] > 0.05:
            return job
    raise AssertionError("it ended")


def kinds(folder: Path) -> set[str]:
    """Return what kinds of folders of EchoBase lie there."""
    return {path.name.rsplit("-", 1)[0] for path in folder.iterdir() if path.name.startswith("echobase-")}


def test_a_killed_server_leaves_nothing_for_ever_and_touches_no_other(tmp_path, short_folder):
    system = tmp_path / "system"
    system.mkdir()
    # One path is longer than that of a socket may be; the other is as short as it can be.
    datas = [tmp_path / ("a" * 120), Path(short_folder)]
    first, second = (ServerProcess(data, workers=1) for data in datas)
    for server in (first, second):
        server.env["TMPDIR"] = str(system)
        server.start()
    with httpx.Client(base_url=first.url, timeout=60.0) as one, httpx.Client(base_url=second.url, timeout=60.0) as two:
        jobs = [busy(one), busy(two)]
        for data in datas:
            assert kinds(data / "tmp") == {"echobase-slot"}
            assert list((data / "tmp").glob("echobase-slot-*/work/echobase-job-*"))
        first.kill()
        left = {path.name for path in (datas[0] / "tmp").iterdir()}
        assert left
        others = {path.name for path in (datas[1] / "tmp").iterdir()}
        first.start()
        # Nothing of before is there any more; the other server's files are, and its job goes on.
        assert left & {path.name for path in (datas[0] / "tmp").iterdir()} == set()
        assert others <= {path.name for path in (datas[1] / "tmp").iterdir()}
        for client, job in zip((one, two), jobs, strict=True):
            client.delete(f"/api/v1/jobs/{job['id']}")
            assert finished(client, job)["state"] == "cancelled"
    for server, data in zip((first, second), datas, strict=True):
        server.stop()
        assert kinds(data / "tmp") == set()
    # Only what must have a short path lies in the system's folder, of the server whose own is long.
    assert {path.name.split("-")[0] for path in system.iterdir()} <= {"pymp"}
    assert kinds(system) == set()


def test_a_job_that_had_to_be_killed_leaves_nothing_in_a_server_that_lives_on(tmp_path):
    server = ServerProcess(tmp_path / "data", workers=1, cancel_grace_s=0.1).start()
    with httpx.Client(base_url=server.url, timeout=60.0) as client:
        job = busy(client, "deaf.stl")
        files = list((tmp_path / "data" / "tmp").glob("echobase-slot-*/work/*"))
        assert files
        client.delete(f"/api/v1/jobs/{job['id']}")
        assert finished(client, job)["state"] == "cancelled"
    assert [path for path in files if path.exists()] == []
    server.stop()


def test_clearing_removes_what_is_inside_and_follows_no_link(tmp_path):
    kept = tmp_path / "kept"
    kept.mkdir()
    (kept / "file").write_text("mine")
    scratch = tmp_path / "tmp"
    (scratch / "folder" / "deep").mkdir(parents=True)
    (scratch / "folder" / "deep" / "file").write_text("left")
    (scratch / "file").write_text("left")
    os.symlink(kept, scratch / "link")
    assert clear(scratch) == 3
    assert list(scratch.iterdir()) == []
    assert (kept / "file").read_text() == "mine"
    assert clear(tmp_path / "nowhere") == 0
