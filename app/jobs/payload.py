"""What travels to a worker and back: names, digests and plain JSON, never file contents."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from planner.issues import Issue

Progress = Callable[[float, str], None]


class Cancelled(BaseException):
    """Raised by `progress` inside a cancelled task. Not an Exception: nobody swallows it by accident."""


@dataclass(frozen=True)
class Payload:
    """One piece of work: which task, on which blobs (relative name -> SHA-256), with which options."""

    job_id: str
    task: str
    files: dict[str, str]
    options: dict[str, Any]
    store_url: str
    workflow: str


@dataclass(frozen=True)
class Outcome:
    """What came of it: new blobs (relative name -> (SHA-256, size)) and JSON, or issues; or it was cancelled."""

    files: dict[str, tuple[str, int]] = field(default_factory=dict)
    data: dict[str, Any] = field(default_factory=dict)
    issues: tuple[Issue, ...] = ()
    cancelled: bool = False
    failed: bool = False


@dataclass
class Report:
    """How far a running task is: 0..1 and a line for a person."""

    fraction: float = 0.0
    text: str = ""
