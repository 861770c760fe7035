"""`Store`: database, blobs and news of one server, opened together."""

import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any

from app.scratch import clear
from app.settings import ServerSettings
from app.store.blobs import BlobStore, BlobWriter, open_blobs
from app.store.database import Database
from app.store.events import Exchange
from app.store.refusal import refuse
from app.store.sweep import Swept, collect, sweep

VERSION = version("echobase")


@dataclass(eq=False)
class Store:
    """Everything that outlives a request. Safe to use from many threads."""

    settings: ServerSettings
    db: Database
    blobs: BlobStore
    exchange: Exchange
    swept: Swept
    _lock_file: IO[bytes] | None = None
    _gate: threading.Condition = field(default_factory=threading.Condition)
    _busy: int = 0
    _collecting: bool = False
    _litter: bool = False

    def writer(self, largest: int, what: str = "file") -> BlobWriter:
        """Return a writer of one blob; use it inside `busy()`."""
        return BlobWriter(self.blobs, largest, self.settings.min_free_bytes, what)

    @contextmanager
    def busy(self) -> Iterator[None]:
        """Hold off the removal of unused blobs while there are some that no row names yet."""
        self.hold()
        try:
            yield
        finally:
            self.release()

    def hold(self) -> None:
        """Begin what `busy` holds."""
        with self._gate:
            self._gate.wait_for(lambda: not self._collecting)
            self._busy += 1

    def release(self) -> None:
        """End what `hold` began; the last one out sweeps, if there is something to sweep."""
        with self._gate:
            self._busy -= 1
            if self._busy or not self._litter:
                return
            self._collecting, self._litter = True, False
        self._collect()

    def tidy(self) -> None:
        """Remove blobs that no row names: now, or as soon as nothing is being written."""
        with self._gate:
            if self._busy or self._collecting:
                self._litter = True
                return
            self._collecting = True
        self._collect()

    def _collect(self) -> None:
        try:
            collect(self.db, self.blobs)
        finally:
            with self._gate:
                self._collecting = False
                self._gate.notify_all()

    def tell(self, project_id: str, what: str, **data: Any) -> None:
        """Tell everybody who has the project open what changed; call it after the transaction."""
        self.exchange.publish(f"project:{project_id}", "changed", {"what": what, **data})

    def close(self) -> None:
        """Close the database and give the folder free."""
        self.db.close()
        if self._lock_file:
            self._lock_file.close()


def open_store(settings: ServerSettings) -> Store:
    """Open the store: lock it, migrate it, and remove what a killed server left half-done."""
    settings.data.mkdir(parents=True, exist_ok=True)
    lock = _lock(settings.data)
    if lock:
        clear(settings.scratch())
    db = Database(settings.database_url())
    db.migrate()
    blobs = open_blobs(settings.store_url())
    return Store(settings, db, blobs, Exchange(), sweep(db, blobs), lock)


def _lock(folder: Path) -> IO[bytes] | None:
    """Take the folder for this process; the system gives it free when the process ends, however it ends."""
    if os.name != "posix":
        return None
    import fcntl  # noqa: PLC0415 - not there on Windows

    file = (folder / "server.lock").open("ab")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.close()
        raise refuse(
            409,
            "data-in-use",
            "another server uses this data folder.",
            "Stop it, or choose another folder.",
            str(folder),
        ) from error
    return file


def free_bytes(store: Store) -> int:
    """Return the free space where files are made (bytes)."""
    return shutil.disk_usage(store.blobs.temporary).free
