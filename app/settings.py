"""`ServerSettings`: what a person who runs the server may decide, from `ECHOBASE_*` variables or arguments."""

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

KIB, MIB, GIB = 1024, 1024**2, 1024**3
LOOPBACK = ("127.0.0.1", "localhost", "::1")


class ServerSettings(BaseSettings):
    """Settings of one server. Sizes are bytes, times seconds; every field can be set as `ECHOBASE_<FIELD>`."""

    model_config = SettingsConfigDict(
        env_prefix="ECHOBASE_", extra="ignore", frozen=True, use_attribute_docstrings=True
    )

    data: Path = Path("data")
    """Folder with the whole state of a server that was told nothing else."""
    db: str = ""
    """Database URL: sqlite:///file or postgresql+psycopg://...; empty: echobase.db in `data`."""
    store: str = ""
    """Where immutable files are kept: file:///folder or any fsspec URL (s3://bucket/prefix); empty: blobs/ in `data`."""
    scheduler: str = ""
    """Dask scheduler (tcp://host:port) that runs the jobs; empty: worker processes on this machine."""
    host: str = "127.0.0.1"
    """Address to listen on."""
    port: int = Field(8000, ge=0, le=65535)
    """Port to listen on; 0: any free one."""
    allowed_hosts: Annotated[tuple[str, ...], NoDecode] = ()
    """Exact host[:port] names, beside the loopback ones, under which browsers may reach the server; comma-separated."""
    allowed_origins: Annotated[tuple[str, ...], NoDecode] = ()
    """Exact origins (scheme://host[:port]), beside those of the hosts, from which browsers may call; comma-separated."""
    workers: int = Field(2, ge=1, le=64)
    """Jobs that run at the same time."""
    max_part_bytes: int = Field(2 * GIB, ge=1)
    """Largest CAD file."""
    max_scan_bytes: int = Field(16 * GIB, ge=1)
    """Largest scan file."""
    max_archive_bytes: int = Field(32 * GIB, ge=1)
    """Largest project archive, packed and unpacked."""
    max_body_bytes: int = Field(8 * MIB, ge=1)
    """Largest body of any other request."""
    min_free_bytes: int = Field(16 * MIB, ge=0)
    """Free space that uploads leave on the disk."""
    cancel_grace_s: float = Field(2.0, ge=0.0, le=60.0)
    """How long a cancelled job may take to stop by itself before its process is ended."""
    max_attempts: int = Field(3, ge=1, le=100)
    """How often a job is started that a killed server or worker left unfinished."""
    workflow: str = "app.workflow"
    """Module whose functions the jobs run."""

    @field_validator("allowed_hosts", "allowed_origins", mode="before")
    @classmethod
    def _comma_separated(cls, value: object) -> object:
        return tuple(part.strip() for part in value.split(",") if part.strip()) if isinstance(value, str) else value

    @model_validator(mode="after")
    def _names_are_exact(self) -> Self:
        for name in (*self.allowed_hosts, *self.allowed_origins):
            if "*" in name or "/" in name.removeprefix("http://").removeprefix("https://"):
                raise ValueError(f"'{name}' must be an exact name, without wildcard or path")
        return self

    @property
    def is_loopback(self) -> bool:
        """True if only this machine can reach the server."""
        return self.host in LOOPBACK

    def scratch(self) -> Path:
        """Return the folder of temporary files: only the server that holds the data folder uses it."""
        return self.data.resolve() / "tmp"

    def database_url(self) -> str:
        """Return the URL of the database."""
        return self.db or f"sqlite:///{self.data.resolve() / 'echobase.db'}"

    def store_url(self) -> str:
        """Return the URL of the blob store."""
        return self.store or (self.data.resolve() / "blobs").as_uri()
