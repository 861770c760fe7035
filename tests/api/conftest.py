"""One real server for the tests that do not hurt it, and a project to start from."""

import httpx
import pytest

from tests.api.server_process import finished, running


@pytest.fixture(scope="session")
def server(tmp_path_factory):
    with running(tmp_path_factory.mktemp("server"), cancel_grace_s=0.3, max_part_bytes=3_000_000) as process:
        yield process


@pytest.fixture(scope="session")
def client(server):
    with httpx.Client(base_url=server.url, timeout=60.0) as opened:
        yield opened


def new_project(client: httpx.Client, name: str = "Panel", part: str | None = "panel.stl") -> str:
    """Return the address of a new project with a part."""
    made = client.post("/api/v1/projects", json={"name": name})
    assert made.status_code == 201, made.text
    address = made.headers["Location"]
    if part is not None:
        sent = client.put(f"{address}/part", files={"file": (part, b"solid x")}, data={"unit": "mm"})
        assert sent.status_code == 200, sent.text
    return address


def planned(client: httpx.Client, address: str) -> dict:
    """Plan and return the job."""
    started = client.post(f"{address}/plan")
    assert started.status_code == 202, started.text
    return finished(client, started.json())


def aligned(client: httpx.Client, address: str, scan: bytes = b"x_mm\n1\n") -> dict:
    """Upload a scan, align, and return the job."""
    assert client.post(f"{address}/scans", files={"file": ("scan.csv", scan)}).status_code == 201
    started = client.post(f"{address}/alignments", json={})
    assert started.status_code == 202, started.text
    return finished(client, started.json())


def error_of(answer: httpx.Response, status: int) -> dict:
    """Return the error of an answer after checking that it has the one shape."""
    assert answer.status_code == status, answer.text
    error = answer.json()["error"]
    assert set(error) - {"issues"} == {"code", "message", "remedy", "where"}
    assert error["message"]
    assert error["message"][-1] == "."
    return error
