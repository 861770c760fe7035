"""A real server in a process of its own, and small clients for it."""

import os
import signal
import socket
import subprocess
import sys
import time
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
        self.process = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, env=self.env)
        self.wait_ready()
        return self

    def wait_ready(self, longest_s: float = 60.0) -> None:
        end = time.monotonic() + longest_s
        while time.monotonic() < end:
            assert self.process is not None
            if self.process.poll() is not None:
                raise AssertionError(f"the server ended with {self.process.returncode}")
            try:
                if httpx.get(f"{self.url}/api/v1/health", timeout=2.0).status_code == 200:
                    return
            except httpx.TransportError:
                pass
            time.sleep(0.02)
        raise AssertionError("the server did not start")

    def kill(self) -> None:
        assert self.process is not None
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self) -> int:
        assert self.process is not None
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=30)


@contextmanager
def running(data: Path, **settings: object):
    server = ServerProcess(data, **settings).start()
    try:
        yield server
    finally:
        if server.process is not None and server.process.poll() is None:
            server.stop()


def finished(client: httpx.Client, job: dict, longest_s: float = 60.0) -> dict:
    """Return a job when it is over."""
    end = time.monotonic() + longest_s
    while time.monotonic() < end:
        job = client.get(f"/api/v1/jobs/{job['id']}").json()
        if job["state"] not in ("queued", "running"):
            return job
        time.sleep(0.03)
    raise AssertionError(f"the job is still {job['state']}")
