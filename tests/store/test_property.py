"""The store against a model of it: any sequence of uploads, edits and deletions, with a crash at any system call."""

import os
import shutil
import tempfile
from pathlib import Path
from unittest import mock

import pytest
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, invariant, rule

from app.settings import ServerSettings
from app.store import inputs, projects, scans
from app.store.content import get_bytes
from app.store.journal import first_broken, lines
from app.store.refusal import Refusal
from app.store.store import open_store

CONTENTS = st.sampled_from([b"", b"a", b"b", b"same", b"x" * 100_000])


class _Crash(BaseException):
    """The process ends here."""


class StoreMachine(RuleBasedStateMachine):
    """The model: project -> (name, scans as bytes, key point versions). The truth: what the reopened store says."""

    made = Bundle("made")

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.settings = ServerSettings(data=self.folder)
        self.store = open_store(self.settings)
        self.model: dict[str, dict] = {}

    def teardown(self) -> None:
        self.store.close()
        shutil.rmtree(self.folder)

    @rule(target=made, name=st.sampled_from(["a", "Ä", "..", "x" * 200]))
    def create(self, name: str) -> str:
        row = projects.create(self.store, name)
        self.model[row.id] = {"name": name, "scans": {}, "points": [[]]}
        return row.id

    def _add(self, pid: str, content: bytes) -> int:
        with self.store.busy():
            with self.store.writer(10**6) as writer:
                writer.write(content)
                blob = writer.finish()
            with self.store.db.write() as session:
                return scans.add(session, pid, {"s.csv": blob}, "uploaded", None, None, {}).number

    @rule(pid=made, content=CONTENTS)
    def upload(self, pid: str, content: bytes) -> None:
        if pid not in self.model:
            return
        self.model[pid]["scans"][self._add(pid, content)] = content

    @rule(pid=made, content=CONTENTS, calls=st.integers(0, 8))
    def upload_into_a_crash(self, pid: str, content: bytes, calls: int) -> None:
        """Crash at the n-th flush or rename; a crash before the answer may or may not have kept the scan, never half of it."""
        if pid not in self.model:
            return
        left = calls

        def dies(real):
            def call(*arguments):
                nonlocal left
                left -= 1
                if left < 0:
                    raise _Crash
                return real(*arguments)

            return call

        with mock.patch("os.fsync", dies(os.fsync)), mock.patch("os.replace", dies(os.replace)), \
                mock.patch("pathlib.Path.unlink", return_value=None):  # fmt: skip
            try:
                number = self._add(pid, content)
            except _Crash:
                number = None
        if number is not None:
            self.model[pid]["scans"][number] = content
        self.reopen()

    @rule(pid=made, count=st.integers(0, 3), stale=st.booleans())
    def edit(self, pid: str, count: int, stale: bool) -> None:
        if pid not in self.model:
            return
        versions = self.model[pid]["points"]
        points = [{"id": f"K{i}", "x_mm": float(i), "y_mm": 0.0, "z_mm": 0.0} for i in range(count)]
        if stale:
            with pytest.raises(Refusal) as refused:
                inputs.put(self.store, pid, "keypoints", points, len(versions) + 5)
            assert refused.value.status == 412
            return
        given = inputs.put(self.store, pid, "keypoints", points, len(versions) - 1)
        if versions[-1] != points or len(versions) == 1:
            versions.append(points)
        assert given.version == len(versions) - 1

    @rule(pid=made)
    def delete_a_scan(self, pid: str) -> None:
        if pid not in self.model or not self.model[pid]["scans"]:
            return
        number = max(self.model[pid]["scans"])
        with self.store.db.write() as session:
            scans.remove(session, pid, number)
        self.store.tidy()
        del self.model[pid]["scans"][number]

    @rule(pid=made)
    def delete(self, pid: str) -> None:
        if pid in self.model:
            projects.remove(self.store, pid)
            del self.model[pid]

    @rule()
    def reopen(self) -> None:
        self.store.close()
        self.store = open_store(self.settings)
        assert self.store.swept.missing == ()

    @invariant()
    def the_store_says_what_the_model_says(self) -> None:
        with self.store.db.read() as session:
            assert {p.id for p in projects.all_projects(session)} == set(self.model)
            for pid, wanted in self.model.items():
                assert projects.get(session, pid).name == wanted["name"]
                assert inputs.current(session, pid, "keypoints").content == wanted["points"][-1]
                found = {}
                for scan in scans.all_scans(session, pid):
                    file = inputs.files_of(session, pid, f"scan:{scan.number}")["s.csv"]
                    found[scan.number] = get_bytes(self.store.blobs, file.sha256)
                assert found == wanted["scans"]
                assert first_broken(lines(session, pid)) is None

    @invariant()
    def nothing_is_kept_that_nobody_names(self) -> None:
        named = {content for wanted in self.model.values() for content in wanted["scans"].values()}
        assert {get_bytes(self.store.blobs, sha) for sha in self.store.blobs.list()} == named


TestStore = StoreMachine.TestCase
TestStore.settings = hypothesis_settings(max_examples=12, stateful_step_count=15, deadline=None)
