"""`Correction`: the noun behind `correction.json`. What was found, how well, and whether a robot may trust it."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from alignment.estimate.directions import Direction, Status
from alignment.estimate.keypoint_method import KeyPointMatch
from alignment.metrics.figures import Prediction
from planner.frames import AXES, Array, Transform
from planner.issues import Issue
from planner.placement import corrected_base
from planner.setup import Base, Setup

Verdict = Literal["pass", "partial", "fail"]
Method = Literal["map", "keypoints"]


@dataclass(frozen=True)
class Residual:
    """Measured minus expected distances of the readings used, mm."""

    rms_mm: float
    p95_mm: float
    max_mm: float
    readings: int


@dataclass(frozen=True)
class AxisResult:
    """One named axis of the correction about the BASE origin: sigma in mm (x, y, z) or deg (a, b, c)."""

    status: Status
    sigma: float


@dataclass(frozen=True, eq=False)
class Correction:
    """The outcome of an alignment.

    T_base_basecorr: the correction; None where nothing could be estimated (then the verdict is fail). covariance (6, 6)
    of xi = (rx, ry, rz, x, y, z), rad and mm, axes of base: T_true = Tr(c) Exp(xi) Tr(-c) T_estimated about c =
    `centroid_mm` (3,). `points_base` (p, 3) and `deviation_mm` (p,): residual of each patch used, for maps.
    baseline: the key-point method's T_base_basecorr beside it, where it gives one. surfaces: of scans of several plans
    aligned together, how far the readings of each stand off the part where all of them put it.
    """

    method: Method
    verdict: Verdict
    setup: Setup
    T_base_basecorr: Transform | None
    covariance: Array | None
    centroid_mm: Array | None
    axes: tuple[AxisResult, ...]
    directions: tuple[Direction, ...]
    keypoints: tuple[KeyPointMatch, ...]
    residual: Residual | None
    before: Prediction | None
    after: Prediction | None
    issues: tuple[Issue, ...]
    baseline: Transform | None = None
    noise: dict[str, float] = field(default_factory=dict)
    edges: dict[str, Any] | None = None
    non_rigid: dict[str, Any] | None = None
    surfaces: list[dict[str, Any]] | None = None
    points_base: Array = field(default_factory=lambda: np.zeros((0, 3)))
    deviation_mm: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def failed(self) -> bool:
        """True if no program may be written."""
        return self.verdict == "fail"

    @property
    def T_world_basecorr(self) -> Transform | None:
        """The corrected base: the numbers of BASE_DATA[n]."""
        found = self.T_base_basecorr
        return None if found is None else corrected_base(self.setup.T_world_base, found)

    @property
    def baseline_xyzabc(self) -> tuple[float, ...] | None:
        """The key-point method's correction, mm and deg."""
        return None if self.baseline is None else tuple(float(v) for v in self.baseline.xyzabc)

    def to_json(self) -> dict[str, Any]:
        """Return the content of correction.json: JSON types only, null where there is no number."""
        base: Base = self.setup.base
        number = base.number if base.corrected_number is None else base.corrected_number
        world = self.T_world_basecorr
        content = {
            "method": self.method,
            "verdict": self.verdict,
            "correction": _pose(self.T_base_basecorr),
            "base": None if world is None else {"number": number, **(_pose(world) or {})},
            "dof": {name: {"status": a.status, "sigma": a.sigma} for name, a in zip(AXES, self.axes, strict=False)},
            "covariance": None if self.covariance is None else self.covariance.tolist(),
            "centroid_mm": None if self.centroid_mm is None else self.centroid_mm.tolist(),
            "directions": [d.to_json() for d in self.directions],
            "keypoints": [_keypoint(k) for k in self.keypoints],
            "residual": None if self.residual is None else vars(self.residual),
            "prediction": {
                "before": None if self.before is None else self.before.to_json(),
                "after": None if self.after is None else self.after.to_json(),
            },
            "baseline": _pose(self.baseline),
            "noise": self.noise,
            "edges": self.edges,
            "non_rigid": self.non_rigid,
            "surfaces": self.surfaces,
            "issues": [i.to_json() for i in self.issues],
            "inputs": {},
        }
        return _plain(content)


def _pose(transform: Transform | None) -> dict[str, float] | None:
    if transform is None:
        return None
    names = (f"{k}_mm" if k in "xyz" else f"{k}_deg" for k in AXES)
    return dict(zip(names, (float(v) for v in transform.xyzabc), strict=True))


def _keypoint(k: KeyPointMatch) -> dict[str, Any]:
    x, y, z = k.point_base if k.point_base is not None else (None, None, None)
    return {
        "id": k.id,
        "status": k.status,
        "reason": k.reason,
        "residual_mm": k.residual_mm,
        "normal_angle_deg": k.normal_angle_deg,
        "readings": k.readings,
        "amplitude_pct": k.amplitude_pct,
        "tof_us": k.tof_us,
        "x_mm": x,
        "y_mm": y,
        "z_mm": z,
    }


def _plain(value: Any) -> Any:
    """Replace numpy scalars by Python's and what is not finite by null."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
