"""What the 3D view asks of a project: one small protocol between the view and whatever keeps the project.

The view draws what the model holds and sends back what people do; it keeps no truth of its own. All coordinates are mm.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.keypoint import KeyPoint
from planner.part import Part
from planner.setup import Inspection, Setup
from planner.surface.inspection import InspectionSurface
from planner.toolpath import PathKind, ToolPath

Topic = Literal["part", "surface", "setup", "keypoints", "plan", "scan", "alignment"]
"""What changed. A listener that hears a topic asks the model again for what it draws of it."""
TOPICS: tuple[Topic, ...] = ("part", "surface", "setup", "keypoints", "plan", "scan", "alignment")


@dataclass(frozen=True)
class KeyPointSet:
    """Key points as they stand, with the number that changes at every edit."""

    points: tuple[KeyPoint, ...] = ()
    version: int = 0


@dataclass(frozen=True, eq=False)
class Insight:
    """What the key points are worth, computed before any robot moves.

    version: of the key points it was computed for. issues: verdicts, `where` = the id of a key point for its own.
    coverage: share of the inspection surface the alignment scan sweeps (0..1), None if there is no path yet.
    path: the alignment path through the points, None if there is none. covered (k,): share of each triangle of the
    surface that is swept, 0..1, None if unknown. normal_error_mm: predicted largest normal error over the surface at
    one sigma. sigma: predicted one sigma of x y z (mm) a b c (deg). status: measured, weak or held, of the same six.
    """

    version: int
    issues: tuple[Issue, ...] = ()
    coverage: float | None = None
    path: ToolPath | None = None
    covered: Array | None = None
    normal_error_mm: float | None = None
    sigma: dict[str, float] = field(default_factory=dict)
    status: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Found:
    """Where an alignment found the part.

    T_base_part: the real part in the nominal base. keypoint_status: id -> (status, reason). shape: the displacement
    along the normal that adapted poses follow, as places (m, 3), part, mm, and values (m,), mm; None for a rigid result.
    verdict: pass, partial or fail.
    """

    T_base_part: Transform
    verdict: str
    keypoint_status: dict[str, tuple[str, str | None]] = field(default_factory=dict)
    shape: tuple[Array, Array] | None = None


@runtime_checkable
class ProjectModel(Protocol):
    """One project, read and edited by several views at once. Every method may be called from any thread.

    Readers return None for what does not exist yet. Writers raise `EchoBaseError` for what cannot be done.
    """

    @property
    def project_id(self) -> str:
        """Identifier of the project."""
        ...

    def setup(self) -> Setup:
        """Return the settings in force."""
        ...

    def part(self) -> Part | None:
        """Return the part."""
        ...

    def surface(self) -> InspectionSurface | None:
        """Return the inspection surface."""
        ...

    def keypoints(self) -> KeyPointSet:
        """Return the key points and their version."""
        ...

    def keypoint_history(self, limit: int) -> list[tuple[KeyPoint, ...]]:
        """Return up to `limit` sets that were in force (and the empty one before all), oldest first, the present last."""
        ...

    def set_keypoints(self, points: tuple[KeyPoint, ...], version: int | None, who: str) -> int:
        """Replace the key points if `version` is still theirs (None: whatever it is); return the new version.

        Raises EchoBaseError `keypoints-changed` if somebody else was faster.
        """
        ...

    def select_surface(self, seeds_part: Array, who: str, more: bool = False) -> None:
        """Choose the inspection surface by flooding from seed points (n, 3) in `part`; `more`: besides those there are."""
        ...

    def edit_inspection(self, change: Callable[[Inspection], Inspection], who: str) -> None:
        """Replace the inspection part of the settings by what `change` makes of the one in force."""
        ...

    def insight(self) -> Insight | None:
        """Compute what the key points of now are worth. May take a second: never called from an event loop."""
        ...

    def path(self, kind: PathKind) -> ToolPath | None:
        """Return a planned path: alignment, inspection, or corrected."""
        ...

    def cloud(self) -> PointCloud | None:
        """Return the readings of the alignment scan, in the nominal base."""
        ...

    def found(self) -> Found | None:
        """Return the last alignment, unless it failed or is stale."""
        ...

    def subscribe(self, callback: Callable[[Topic], None]) -> Callable[[], None]:
        """Call back at every change, from any thread, quickly; return the function that ends it."""
        ...

    def publish(self, event: str, data: dict[str, object]) -> None:
        """Send an event to every page that has the project open (`GET /projects/{id}/events`)."""
        ...


def covered_share(insight: Insight | None, surface: InspectionSurface) -> NDArray[np.float64]:
    """Return the swept share of every triangle (k,), zero where it is not known."""
    k = len(surface.part_faces)
    if insight is None or insight.covered is None or len(insight.covered) != k:
        return np.zeros(k)
    return np.clip(insight.covered, 0.0, 1.0)
