"""A batch over REST: which alignments it is of, what it says, and what it refuses."""

import asyncio
import hashlib
import json
from types import SimpleNamespace

import httpx
import numpy as np
import pytest
from fastapi import FastAPI

from app import workflow
from app.api import batch_routes, errors
from app.settings import ServerSettings
from app.store import projects, results, scans
from app.store.content import put_bytes
from app.store.store import open_store
from planner.setup import Setup
from tests.api.conftest import error_of
from tests.batch.serial_parts import EDGES, correction
from tests.loop.surfaces import plane, write_stl

OFFSET = np.r_[np.radians([0.3, -0.2, 0.4]), 1.1, -0.7, 0.9]


class Client:
    """Asks an app in this process."""

    def __init__(self, app: FastAPI) -> None:
        self.transport = httpx.ASGITransport(app)

    def get(self, address: str, **more) -> httpx.Response:
        async def ask() -> httpx.Response:
            async with httpx.AsyncClient(transport=self.transport, base_url="http://cell") as client:
                return await client.get(address, **more)

        return asyncio.run(ask())


@pytest.fixture(scope="module")
def artifacts(tmp_path_factory):
    part = write_stl(tmp_path_factory.mktemp("plan") / "plate.stl", *plane().mesh(3, 3))
    setup = Setup.model_validate({"base": {"x_mm": 1050, "z_mm": 400}, "tool": {"tcp": {"z_mm": 180}}})
    return workflow.plan(workflow.PlanRequest(part, "plate.stl", "mm", setup, (), ()))[1]


@pytest.fixture
def project(artifacts, tmp_path):
    """A server of this route alone, with a plan and seven alignments: 6 failed, 3 and 7 of one scan."""
    store = open_store(ServerSettings(data=tmp_path / "data"))
    app = FastAPI()
    errors.install(app)
    app.state.context = SimpleNamespace(store=store)
    app.include_router(batch_routes.router, prefix="/api/v1")
    rng = np.random.default_rng(1)
    pid = projects.create(store, "Plates").id
    with store.db.write() as session:
        files = {name: put_bytes(store.blobs, data) for name, data in artifacts.items()}
        plan = results.add(session, pid, "plan", files, {}, {}, "pass", {})
        sha256 = hashlib.sha256(artifacts["plan.json"]).hexdigest()
        for number in range(1, 9):
            scan = 3 if number == 8 else number
            if number != 8:
                file = {f"s{number}.csv": put_bytes(store.blobs, b"%d" % number)}
                scans.add(session, pid, file, "simulated" if number == 1 else "uploaded", None, "alignment", {})
            place = OFFSET + 0.2 * EDGES * rng.standard_normal(6)
            place[4] += 1.6 if number == 4 else 0.0
            content = correction(place, EDGES, rng)
            content["inputs"] = {"plan_sha256": sha256, "scan_sha256": [f"s{scan}"]}
            content["verdict"] = "fail" if number == 6 else "pass"
            blob = put_bytes(store.blobs, json.dumps(content).encode())
            made_from = {"plan": plan.sha256, "scans": [f"s{scan}"], "version": "x"}
            results.add(
                session, pid, "alignment", {results.CORRECTION: blob}, made_from, {"scans": [scan]},
                content["verdict"], content,
            )  # fmt: skip
    yield Client(app), f"/api/v1/projects/{pid}"
    store.close()


def test_the_newest_usable_alignment_of_each_scan(project):
    client, address = project
    said = client.get(f"{address}/batch").json()
    assert said["alignments"] == [1, 2, 4, 5, 7, 8]
    assert [p["name"] for p in said["parts"]] == [
        f"{n}: s{s}.csv" for n, s in ((1, 1), (2, 2), (4, 4), (5, 5), (7, 7), (8, 3))
    ]
    assert [p["simulated"] for p in said["inputs"]["parts"]] == [True] + [False] * 5
    assert [i["where"] for i in said["issues"] if i["code"] == "batch-outlier"] == ["4: s4.csv"]
    along = {d["name"]: d for d in said["directions"]}
    assert abs(along["x"]["mean"] - 1.1) <= along["x"]["half_95"] * 1.5
    assert set(said["patch"]) == {"base", "fixture"}
    assert said["setup_version"] is None  # that plan is of no setup in this store


def test_chosen_alignments_and_what_is_left_out(project):
    client, address = project
    said = client.get(f"{address}/batch", params={"alignments": [1, 2, 3, 5, 6, 8]}).json()
    assert [p["name"] for p in said["parts"]] == ["1: s1.csv", "2: s2.csv", "3: s3.csv", "5: s5.csv"]
    assert {i["where"] for i in said["issues"] if i["code"] == "batch-left-out"} == {"6: s6.csv", "8: s3.csv"}
    assert "batch-few" in {i["code"] for i in said["issues"]}


def test_refusals_have_the_one_shape(project):
    client, address = project
    assert error_of(client.get(f"{address}/batch", params={"alignments": [1]}), 422)["code"] == "batch-parts"
    assert error_of(client.get(f"{address}/batch", params={"alignments": [1, 99]}), 404)["code"] == "alignment-unknown"
    error_of(client.get("/api/v1/projects/nobody/batch"), 404)


@pytest.mark.parametrize("form", ["html", "pdf", "json", "csv"])
def test_the_report_of_a_batch(project, form):
    client, address = project
    answer = client.get(f"{address}/batch/report", params={"format": form, "alignments": [1, 2, 4, 5, 7, 8]})
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith(batch_routes.MEDIA[form].split(";")[0])
    if form == "pdf":
        assert answer.content.startswith(b"%PDF")
    else:
        assert "further along y than the other 5" in answer.text
