"""A client that hangs up during a calibration ends its work: nothing computes on for nobody, and nothing is kept."""

import os
import select
import signal
import socket
import time
from pathlib import Path

import pytest

from tests.api.conftest import new_project
from tests.api.test_calibrations import calibrated, couplant_csv, tilt_csv
from tests.api.test_jobs import children_of

LONG_S = 60.0


def calibrating(server_pid: int) -> list[int]:
    """Return the processes that calibrate."""
    found = []
    for pid in children_of(server_pid):
        try:
            command = Path(f"/proc/{pid}/cmdline").read_bytes()
        except OSError:
            continue
        if b"planner.sandbox_child" in command:
            found.append(pid)
    return found


def send(server, address: str, name: str, content: bytes) -> tuple[socket.socket, int]:
    """Send readings, and return the connection that waits for the answer and the process that computes it."""
    others = set(calibrating(server.pid))
    line = socket.create_connection(("127.0.0.1", server.port), timeout=LONG_S)
    head = f"POST {address}/calibrations/{name}?name={name}.csv HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
    line.sendall(f"{head}Content-Length: {len(content)}\r\n\r\n".encode() + content)
    deadline = time.monotonic() + LONG_S
    while time.monotonic() < deadline:
        if new := set(calibrating(server.pid)) - others:
            return line, new.pop()
    raise AssertionError("nothing calibrates")


@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="how the end of a process is waited for")
def test_hanging_up_ends_the_calibration(client, server):
    address = new_project(client, part=None)
    blobs = server.data / "blobs"
    before = {p for p in blobs.rglob("*") if p.is_file()}
    # Two are computed at once; a third waits for its turn. Held, they would be there for ever.
    held = []
    for k in (1.1, 1.2):
        line, pid = send(server, address, "tilt", tilt_csv(k))
        os.kill(pid, signal.SIGSTOP)
        held.append((line, os.pidfd_open(pid)))
    line, end = held.pop()
    line.close()
    ended, _, _ = select.select([end], [], [], LONG_S)
    assert ended == [end]
    # Its place is free again: others calibrate, while the first is still held.
    answer = calibrated(client, address, "couplant", ("gaps.csv", couplant_csv()))
    assert answer.status_code == 201, answer.text
    line, first = held.pop()
    assert select.select([first], [], [], 0.0)[0] == []
    line.close()
    assert select.select([first], [], [], LONG_S)[0] == [first]
    os.close(first)
    os.close(end)
    # Of those nothing is kept.
    assert [c["kind"] for c in client.get(f"{address}/calibrations").json()] == ["couplant"]
    assert client.delete(answer.headers["Location"]).status_code == 204
    deadline = time.monotonic() + LONG_S
    while {p for p in blobs.rglob("*") if p.is_file()} - before and time.monotonic() < deadline:
        client.get(f"{address}/calibrations")
    assert {p for p in blobs.rglob("*") if p.is_file()} == before
