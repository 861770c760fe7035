"""What is acknowledged is on the disk: the order of system calls, full disks, sweeps, migrations."""

import hashlib
import os
import sqlite3
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy.exc import DatabaseError

from app.settings import ServerSettings
from app.store import inputs, projects, scans
from app.store.blobs import open_blobs
from app.store.content import get_bytes, put_bytes
from app.store.database import Database
from app.store.journal import first_broken, lines, note
from app.store.names import is_id, is_relative_name, safe_member
from app.store.refusal import Refusal
from app.store.store import open_store
from app.store.tables import Base, JournalRow


def test_a_blob_is_flushed_named_and_its_folder_flushed_in_this_order(store, monkeypatch):
    calls = []
    real_sync, real_replace = os.fsync, os.replace

    def sync(handle: int) -> None:
        calls.append(("sync", os.readlink(f"/proc/self/fd/{handle}")))
        real_sync(handle)

    def replace(source, target) -> None:
        calls.append(("name", str(target)))
        real_replace(source, target)

    monkeypatch.setattr(os, "fsync", sync)
    monkeypatch.setattr(os, "replace", replace)
    blob = put_bytes(store.blobs, b"scan")
    target = store.blobs.path(blob.sha256)
    assert blob.sha256 == hashlib.sha256(b"scan").hexdigest()
    assert [kind for kind, _ in calls] == ["sync", "sync", "name", "sync"]
    assert "/tmp/new-" in calls[0][1]
    assert Path(calls[1][1]) == store.blobs.root  # the new folder is named durably before anything is put in it
    assert calls[2] == ("name", str(target))
    assert Path(calls[3][1]) == target.parent


def test_the_database_is_set_to_survive(store):
    with store.db.engine.connect() as connection:
        read = {
            name: connection.exec_driver_sql(f"PRAGMA {name}").scalar()
            for name in ("journal_mode", "synchronous", "foreign_keys")
        }
    assert read == {"journal_mode": "wal", "synchronous": 2, "foreign_keys": 1}


def test_migrations_lead_to_the_tables(store):
    with store.db.engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
    store.db.migrate()


def test_the_journal_cannot_be_rewritten(store):
    project = projects.create(store, "a")
    with store.db.write() as session:
        note(session, project.id, "something", value=1.5)
    for statement in ("UPDATE journal SET action = 'x'", "DELETE FROM journal"):
        with pytest.raises(DatabaseError, match="append-only"), store.db.write() as session:
            session.connection().exec_driver_sql(statement)
    with store.db.read() as session:
        rows = lines(session, project.id)
    assert first_broken(rows) is None
    assert first_broken(rows[1:]) == 1
    # Whoever goes round the trigger is found by the seals.
    with sqlite3.connect(store.db.url.database) as raw:
        raw.execute("DROP TRIGGER journal_no_update")
        raw.execute("UPDATE journal SET detail = '{\"value\":2.5}' WHERE action = 'something'")
    raw.close()
    with store.db.read() as session:
        assert first_broken(lines(session, project.id)) == 2


def test_the_journal_outlives_its_project(store):
    project = projects.create(store, "a")
    projects.remove(store, project.id)
    with store.db.read() as session:
        assert [row.action for row in lines(session, project.id)] == ["project-created", "project-deleted"]
        assert session.query(JournalRow).count() == 2


def test_a_full_disk_keeps_nothing(tmp_path):
    store = open_store(ServerSettings(data=tmp_path, min_free_bytes=10**18))
    with pytest.raises(Refusal) as refused, store.writer(100) as writer:
        writer.write(b"x")
    assert refused.value.status == 507
    assert list(store.blobs.temporary.iterdir()) == []
    store.close()


def test_an_error_while_flushing_keeps_nothing(store, monkeypatch):
    def full(_handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(Refusal) as refused:
        put_bytes(store.blobs, b"x")
    assert refused.value.status == 507
    assert list(store.blobs.temporary.iterdir()) == []
    assert list(store.blobs.list()) == []


def test_a_start_removes_what_nobody_names_and_reports_what_is_gone(tmp_path):
    settings = ServerSettings(data=tmp_path)
    store = open_store(settings)
    project = projects.create(store, "a")
    kept, lost, orphan = (put_bytes(store.blobs, name) for name in (b"kept", b"lost", b"orphan"))
    with store.db.write() as session:
        scans.add(session, project.id, {"a.csv": kept, "b.csv": lost}, "uploaded", None, None, {})
    (store.blobs.temporary / "new-half").write_bytes(b"half")
    store.blobs.delete(lost.sha256)
    store.close()
    store = open_store(settings)
    assert (store.swept.temporary, store.swept.unnamed, store.swept.missing) == (1, 1, (lost.sha256,))
    assert get_bytes(store.blobs, kept.sha256) == b"kept"
    assert not store.blobs.exists(orphan.sha256)
    store.close()


def test_a_damaged_blob_is_noticed(store):
    blob = put_bytes(store.blobs, b"program")
    store.blobs.path(blob.sha256).write_bytes(b"Program")
    with pytest.raises(Refusal, match="damaged"):
        get_bytes(store.blobs, blob.sha256)


def test_one_folder_one_server(store, tmp_path):
    with pytest.raises(Refusal, match="another server"):
        open_store(ServerSettings(data=tmp_path))


def test_blobs_of_running_work_are_not_swept(store):
    project = projects.create(store, "a")
    with store.busy():
        fresh = put_bytes(store.blobs, b"in the making")
        projects.remove(store, project.id)
        assert store.blobs.exists(fresh.sha256)
    assert not store.blobs.exists(fresh.sha256)


def test_a_failed_transaction_changes_nothing(store):
    project = projects.create(store, "a")

    def edit_and_fail() -> None:
        with store.db.write() as session:
            inputs.put_in(session, project.id, "keypoints", [], None)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        edit_and_fail()
    with store.db.read() as session:
        assert inputs.current(session, project.id, "keypoints").version == 0


def test_an_object_store_does_the_same(tmp_path):
    blobs = open_blobs("memory://echobase-test/blobs")
    blob = put_bytes(blobs, b"far away")
    assert get_bytes(blobs, blob.sha256) == b"far away"
    assert list(blobs.list()) == [blob.sha256]
    blobs.copy_to(blob.sha256, tmp_path / "copy")
    assert (tmp_path / "copy").read_bytes() == b"far away"
    blobs.delete(blob.sha256)
    assert not blobs.exists(blob.sha256)
    with pytest.raises(Refusal, match="missing"):
        blobs.open(blob.sha256)


@pytest.mark.parametrize(
    "name", ["../a", "/a", "a/../b", "a//b", "", ".hidden", "a/.b", "a\\b", "a\n", "a" * 200, "a/b/c/d/e/f"]
)
def test_results_cannot_name_places(name):
    assert not is_relative_name(name)
    assert not is_id(name)
    member = safe_member(name)
    assert member == safe_member(member)
    assert not set(member) & set("/\\\n")
    assert not member.startswith(".")


def test_the_settings_move_database_and_store(tmp_path):
    url = f"sqlite:///{tmp_path}/elsewhere/e.db"
    settings = ServerSettings(data=tmp_path / "data", db=url, store=(tmp_path / "files").as_uri())
    store = open_store(settings)
    projects.create(store, "a")
    put_bytes(store.blobs, b"x")
    store.close()
    assert (tmp_path / "elsewhere" / "e.db").exists()
    assert len(list((tmp_path / "files").glob("??/*"))) == 1
    assert Database(url).is_sqlite
