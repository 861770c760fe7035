"""Jobs: progress, cancellation, crashes, restarts. Nothing a worker does takes the server with it."""

import os
import signal
from pathlib import Path

import httpx
import pytest

from tests.api.conftest import error_of, new_project, planned
from tests.api.server_process import ServerProcess, events, finished


def test_progress_is_streamed_and_ends(client):
    address = new_project(client, part="slow.stl")
    job = client.post(f"{address}/plan").json()
    seen = []
    for number, name, data in events(client, f"/api/v1/jobs/{job['id']}/events"):
        seen.append((number, name, data["state"], data["fraction"]))
        if data["state"] == "running" and data["fraction"] > 0.1:
            assert client.delete(f"/api/v1/jobs/{job['id']}").status_code == 200
    assert {name for _, name, _, _ in seen} == {"job"}
    assert seen[-1][2] == "cancelled"
    numbers = [number for number, *_ in seen if number]
    assert numbers == sorted(set(numbers))
    fractions = [f for _, _, state, f in seen if state == "running"]
    assert fractions == sorted(fractions)
    # Who was away gets what was missed, once; who missed nothing gets the end again, not silence.
    again = [n for n, _, _ in events(client, f"/api/v1/jobs/{job['id']}/events", last=numbers[0])]
    assert again == numbers[1:]
    assert len(list(events(client, f"/api/v1/jobs/{job['id']}/events", last=1))) == 1


def test_a_deaf_worker_is_ended_and_the_slot_works_again(client):
    address = new_project(client, part="deaf.stl")
    job = client.post(f"{address}/plan").json()
    for _, _, data in events(client, f"/api/v1/jobs/{job['id']}/events"):
        if data["state"] == "running" and data["fraction"] > 0:
            client.post(f"/api/v1/jobs/{job['id']}/cancel")
    assert client.get(f"/api/v1/jobs/{job['id']}").json()["state"] == "cancelled"
    for _ in range(3):
        assert planned(client, new_project(client))["state"] == "done"


@pytest.mark.parametrize(("part", "code"), [
    ("crash.stl", "worker-crashed"), ("fault.stl", "internal"), ("refused.stl", "no-surface"),
])  # fmt: skip
def test_a_failed_worker_is_an_answer(client, part, code):
    address = new_project(client, part=part)
    job = planned(client, address)
    assert job["state"] == "failed"
    assert job["error"]["code"] == code
    assert "Traceback" not in str(job)
    step = next(s for s in client.get(f"{address}/state").json()["steps"] if s["name"] == "paths")
    assert step["state"] == "failed"
    assert planned(client, new_project(client))["state"] == "done"


def test_the_same_work_is_done_once(client):
    address = new_project(client, part="slow.stl")
    first = client.post(f"{address}/plan").json()
    assert client.post(f"{address}/plan").json()["id"] == first["id"]
    # Changed inputs make the running plan pointless: it is ended, the new one begins.
    client.put(f"{address}/setup", json={"standoff_mm": 17.0})
    second = client.post(f"{address}/plan").json()
    assert second["id"] != first["id"]
    assert finished(client, first)["state"] == "cancelled"
    client.delete(f"/api/v1/jobs/{second['id']}")
    assert finished(client, second)["state"] == "cancelled"
    quick = new_project(client)
    client.post(f"{quick}/keypoints/suggest")
    done = planned(client, quick)
    assert planned(client, quick)["id"] == done["id"]
    assert client.get(f"{quick}/plan").json()["number"] == 1


def test_deleting_a_project_ends_its_jobs(client):
    address = new_project(client, part="slow.stl")
    job = client.post(f"{address}/plan").json()
    assert client.delete(address).status_code == 204
    error_of(client.get(f"/api/v1/jobs/{job['id']}"), 404)
    assert planned(client, new_project(client))["state"] == "done"


def test_two_browsers_hear_of_each_other(client):
    address = new_project(client)
    heard = []
    for _, name, data in events(client, f"{address}/events"):
        heard.append((name, data.get("what"), data.get("version")))
        if data.get("what") == "all":
            client.put(f"{address}/keypoints", json=[{"id": "A", "x_mm": 1, "y_mm": 1, "z_mm": 0}])
        if data.get("what") == "keypoints":
            break
    assert heard == [("changed", "all", None), ("changed", "keypoints", 1)]


def test_jobs_of_a_killed_server_run_again_and_orphans_end(tmp_path):
    server = ServerProcess(tmp_path, workers=1).start()
    with httpx.Client(base_url=server.url, timeout=60.0) as client:
        address = new_project(client, part="slow.stl")
        quick = new_project(client)
        running = client.post(f"{address}/plan").json()
        queued = client.post(f"{quick}/plan").json()
        for _, _, data in events(client, f"/api/v1/jobs/{running['id']}/events"):
            if data["fraction"] > 0.1:
                break
        workers = children_of(server.pid)
        assert workers
        server.kill()
    server.start()
    with httpx.Client(base_url=server.url, timeout=60.0) as client:
        for _, _, data in events(client, f"/api/v1/jobs/{running['id']}/events"):
            if data["fraction"] > 0.1:
                break
        client.delete(f"/api/v1/jobs/{running['id']}")
        assert finished(client, queued)["state"] == "done"
    assert [pid for pid in workers if is_alive(pid)] == []
    # A server that is asked to end, ends, whatever it is doing.
    with httpx.Client(base_url=server.url, timeout=60.0) as client:
        client.put(f"{address}/setup", json={"standoff_mm": 18.0})
        job = client.post(f"{address}/plan").json()
        for _, _, data in events(client, f"/api/v1/jobs/{job['id']}/events"):
            if data["state"] == "running" and data["fraction"] > 0:
                break
    assert server.stop() in (0, -signal.SIGTERM)


def test_work_that_kills_the_server_again_and_again_is_given_up(tmp_path):
    server = ServerProcess(tmp_path, workers=1, max_attempts=1).start()
    with httpx.Client(base_url=server.url, timeout=60.0) as client:
        address = new_project(client, part="slow.stl")
        job = client.post(f"{address}/plan").json()
        for _, _, data in events(client, f"/api/v1/jobs/{job['id']}/events"):
            if data["state"] == "running" and data["fraction"] > 0:
                break
        server.kill()
    server.start()
    try:
        again = httpx.get(f"{server.url}/api/v1/jobs/{job['id']}").json()
        assert again["error"]["code"] == "job-given-up"
    finally:
        server.stop()


def children_of(pid: int) -> list[int]:
    """Return the descendants of a process."""
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parents[int(entry.name)] = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            except OSError:
                continue
    found, frontier = [], {pid}
    while frontier := {child for child, parent in parents.items() if parent in frontier}:
        found += frontier
    return found


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
