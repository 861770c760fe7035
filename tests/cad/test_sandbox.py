"""A reader that crashes, hangs or eats the memory is an answer, from wherever it is called."""

import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from planner.errors import EchoBaseError
from planner.sandbox import SandboxLimits, run_limited

HERE = Path(__file__)
SMALL = SandboxLimits(memory_mb=1500, cpu_s=1, wall_s=20.0)


def run(name: str, limits: SandboxLimits = SMALL):
    return run_limited(f"tests.cad.hostile:{name}", HERE, {"x": [1, "ä"]}, limits)


def test_arrays_and_json_come_back_as_they_were():
    arrays, meta = run("echo")
    assert arrays["a"].tolist() == [[0, 1, 2], [3, 4, 5]]
    assert arrays["b"].dtype == np.int32
    assert meta["options"] == {"x": [1, "ä"]}
    assert meta["console"] == "said on the console\n"
    assert not Path(meta["cwd"]).exists()


@pytest.mark.parametrize(
    "name, code, word",
    [
        ("complain", "bad-thing", "It is bad."),
        ("throw", "reader-failed", "of all things"),
        ("crash", "reader-crash", "SIGSEGV"),
        ("leave", "reader-crash", "exit code 3"),
        ("eat", "reader-memory", "1500 MB"),
        ("spin", "reader-time", "1 s of processor time"),
        ("smuggle", "reader-failed", "pickle"),
    ],
)
def test_what_goes_wrong_is_said(name, code, word):
    with pytest.raises(EchoBaseError) as error:
        run(name)
    assert [issue.code for issue in error.value.issues] == [code]
    assert word in str(error.value)


def test_a_reader_that_waits_is_ended():
    start = time.monotonic()
    with pytest.raises(EchoBaseError, match="longer than 1 s"):
        run("sleep", SandboxLimits(wall_s=1.0))
    assert time.monotonic() - start < 15


def test_it_works_from_threads_and_from_pool_workers():
    with ThreadPoolExecutor(4) as threads:
        assert [len(r[0]) for r in threads.map(run, ["echo"] * 4)] == [2] * 4
    with ProcessPoolExecutor(1) as pool:
        assert pool.submit(run, "echo").result()[0]["b"].tolist() == [1, 2]
