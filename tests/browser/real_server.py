"""The real server, as a process of its own that can be killed and started again on the same data."""

import json
import os
import re
import subprocess
import sys
import threading
import urllib.request
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
START = """
import sys
from pathlib import Path
from app.server import serve
sys.exit(serve("127.0.0.1", int(sys.argv[1]), Path(sys.argv[2])))
"""


class RealServer:
    """`echobase serve` on a free port; `restart` keeps the port."""

    def __init__(self, data: Path) -> None:
        self.data, self.port, self.lines = data, 0, []
        self._start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def _start(self) -> None:
        self._up = threading.Event()
        env = {**os.environ, "PYTHONUNBUFFERED": "1"}
        command = [sys.executable, "-c", START, str(self.port), str(self.data)]
        self.process = subprocess.Popen(
            command, cwd=ROOT, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self._reader = threading.Thread(target=self._read, args=(self.process,), daemon=True)
        self._reader.start()
        assert self._up.wait(90), "\n".join(self.lines)

    def _read(self, process: subprocess.Popen) -> None:
        for line in process.stdout:
            self.lines.append(line.rstrip())
            if found := re.search(r"http://127\.0\.0\.1:(\d+)/", line):
                self.port = int(found[1])
                self._up.set()

    def rest(self, path: str, method: str = "GET", body: Any = None) -> Any:
        """Send JSON to an address below /api/v1; return what is answered."""
        sent = None if body is None else json.dumps(body).encode()
        headers = {"Content-Type": "application/json"}
        request = urllib.request.Request(f"{self.url}/api/v1{path}", sent, headers, method=method)
        with urllib.request.urlopen(request) as answer:
            text = answer.read()
        return json.loads(text) if text else None

    def worked(self, path: str, body: Any) -> None:
        """Start a job and wait until it is done."""
        job = self.rest(path, "POST", body)
        with urllib.request.urlopen(f"{self.url}/api/v1/jobs/{job['id']}/events") as events:
            events.read()
        assert self.rest(f"/jobs/{job['id']}")["state"] == "done"

    def kill(self) -> None:
        """End it without a word, as a power cut would."""
        self.process.kill()
        self.process.wait()
        self._reader.join(timeout=10)
        self.process.stdout.close()

    def restart(self) -> None:
        self._start()

    def stop(self) -> None:
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(timeout=30)
        self._reader.join(timeout=10)
        self.process.stdout.close()
