"""A real server in a process of its own, and small clients for it."""

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


class ServerProcess:
    """Starts, kills and restarts a server on one data folder."""

    def __init__(self, data: Path, workflow: str = "tests.api.fake_workflow", **settings: object) -> None:
        self.data, self.port = data, free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.env = {**os.environ, "ECHOBASE_WORKFLOW": workflow, "PYTHONPATH": str(ROOT)}
        self.env |= {f"ECHOBASE_{key.upper()}": str(value) for key, value in settings.items()}
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> "ServerProcess":
        code = "import sys; from pathlib import Path; from app.server import serve; "
        code += f"sys.exit(serve('127.0.0.1', {self.port}, Path({str(self.data)!r})))"
        self.process = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, env=self.env, stdout=subprocess.PIPE)
        assert self.process.stdout is not None
        # The socket listens before the address is printed: the first request waits until it is served.
        line = self.process.stdout.readline().decode()
        assert self.url in line, f"the server did not start: {line!r}"
        assert httpx.get(f"{self.url}/api/v1/health", timeout=60.0).status_code == 200
        return self

    def kill(self) -> None:
        """End it as a power cut would, as far as the process can tell."""
        self._end(signal.SIGKILL)

    def stop(self) -> int:
        """Ask it to end; return its status."""
        return self._end(signal.SIGTERM)

    def _end(self, how: signal.Signals) -> int:
        assert self.process is not None
        self.process.send_signal(how)
        status = self.process.wait(timeout=30)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return status


@contextmanager
def running(data: Path, **settings: object):
    server = ServerProcess(data, **settings).start()
    try:
        yield server
    finally:
        if server.process is not None and server.process.poll() is None:
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
