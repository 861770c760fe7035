"""A real server in a process of its own, and small clients for it."""

import atexit
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx

ROOT = Path(__file__).parents[2]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Nursery:
    """The process that forks servers; one for all tests."""

    _one: "Nursery | None" = None

    def __init__(self) -> None:
        env = {**os.environ, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-W", "ignore", "-m", "tests.api.nursery"]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, cwd=ROOT, env=env, stdin=pipe, stdout=pipe, stderr=None)
        self._early: list[bytes] = []
        atexit.register(self.close)

    @classmethod
    def get(cls) -> "Nursery":
        cls._one = cls._one or cls()
        return cls._one

    def ask(self, **order: object) -> dict[str, int]:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(order).encode() + b"\n")
        self._process.stdin.flush()
        return json.loads(self.line(b"{"))

    def line(self, wanted: bytes) -> bytes:
        """Return the next line with `wanted` in it; the servers write their addresses here too."""
        assert self._process.stdout is not None
        for place, line in enumerate(self._early):
            if wanted in line:
                return self._early.pop(place)
        while line := self._process.stdout.readline():
            if wanted in line:
                return line
            # A server may say its address before the nursery says that it was born.
            self._early.append(line)
        raise AssertionError("the nursery ended")

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(timeout=30)
        self._process.stdout.close()


class ServerProcess:
    """Starts, kills and restarts a server on one data folder."""

    def __init__(self, data: Path, workflow: str = "tests.api.fake_workflow", **settings: object) -> None:
        self.data, self.port = data, free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.env = {f"ECHOBASE_{key.upper()}": str(value) for key, value in {"workflow": workflow, **settings}.items()}
        self.pid: int | None = None

    def start(self) -> "ServerProcess":
        nursery = Nursery.get()
        self.pid = nursery.ask(do="start", port=self.port, data=str(self.data), env=self.env)["pid"]
        # The socket listens before the address is printed: the first request waits until it is served.
        nursery.line(self.url.encode())
        assert httpx.get(f"{self.url}/api/v1/health", timeout=60.0).status_code == 200
        return self

    def kill(self) -> None:
        """End it as a power cut would, as far as the process can tell."""
        self._end(signal.SIGKILL)

    def stop(self) -> int:
        """Ask it to end; return its status."""
        return self._end(signal.SIGTERM)

    def _end(self, how: signal.Signals) -> int:
        pid, self.pid = self.pid, None
        assert pid is not None
        os.kill(pid, how)
        return Nursery.get().ask(do="wait", pid=pid)["status"]


@contextmanager
def running(data: Path, **settings: object):
    server = ServerProcess(data, **settings).start()
    try:
        yield server
    finally:
        if server.pid is not None:
            server.stop()


def events(client: httpx.Client, address: str, last: int | None = None) -> Iterator[tuple[int, str, dict]]:
    """Yield (number, name, data) of a stream until the server ends it."""
    headers = {} if last is None else {"Last-Event-ID": str(last)}
    with client.stream("GET", address, headers=headers, timeout=60.0) as answer:
        assert answer.status_code == 200
        number, name = 0, ""
        for line in answer.iter_lines():
            key, _, value = line.partition(": ")
            if key == "id":
                number = int(value)
            elif key == "event":
                name = value
            elif key == "data":
                yield number, name, json.loads(value)


def finished(client: httpx.Client, job: dict) -> dict:
    """Return a job when it is over."""
    for _ in events(client, f"/api/v1/jobs/{job['id']}/events"):
        pass
    job = client.get(f"/api/v1/jobs/{job['id']}").json()
    assert job["state"] not in ("queued", "running")
    return job
