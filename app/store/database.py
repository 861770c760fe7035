"""The database: SQLite that survives a power cut, or PostgreSQL, behind two kinds of transaction."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from sqlalchemy import Engine, create_engine, event, make_url
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session

from app.store.refusal import refuse


class Database:
    """One engine. `read()` sees a snapshot; `write()` is the only writer of this process and commits or does nothing."""

    def __init__(self, url: str) -> None:
        self.url = make_url(url)
        self.is_sqlite = self.url.get_backend_name() == "sqlite"
        if self.is_sqlite and self.url.database:
            Path(self.url.database).parent.mkdir(parents=True, exist_ok=True)
        self.engine = _sqlite(url) if self.is_sqlite else create_engine(url, pool_pre_ping=True)
        self._one_writer = threading.RLock()

    def migrate(self) -> None:
        """Bring the tables to the present version; does nothing if they are."""
        config = Config()
        config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
        with self.engine.execution_options(echobase_write=True).begin() as connection:
            config.attributes["connection"] = connection
            command.upgrade(config, "head")

    @contextmanager
    def read(self) -> Iterator[Session]:
        """Yield a session that sees one moment of the database."""
        with Session(self.engine, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """Yield a session; what was done in it is durable when the block ends, or undone if it raises."""
        with (
            self._one_writer,
            Session(self.engine.execution_options(echobase_write=True), expire_on_commit=False) as session,
        ):
            try:
                with session.begin():
                    yield session
            except OperationalError as error:
                raise _no_space(error) from error

    def close(self) -> None:
        """Close all connections; for SQLite this folds the write-ahead log into the file."""
        self.engine.dispose()


def _no_space(error: OperationalError) -> Exception:
    if "full" in str(error.orig).lower() or "No space" in str(error.orig):
        return refuse(507, "disk-full", "the disk is full; nothing was changed.", "Free some space and try again.")
    return error


def _sqlite(url: str) -> Engine:
    engine = create_engine(url, connect_args={"check_same_thread": False, "timeout": 30.0})

    @event.listens_for(engine, "connect")
    def _open(connection: Any, _record: Any) -> None:
        # The driver's own transaction handling starts transactions late and as readers; BEGIN is ours (below).
        connection.isolation_level = None
        for pragma in (
            "journal_mode=WAL",
            "synchronous=FULL",
            "foreign_keys=ON",
            "busy_timeout=30000",
            "trusted_schema=OFF",
        ):
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def _begin(connection: Any) -> None:
        # A writer takes its lock at once: a reader that turns writer half-way could only fail.
        writes = connection.get_execution_options().get("echobase_write", False)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine
