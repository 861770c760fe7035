"""`Calibration`: what a calibration found, how well, and the patch of `setup.json` that applies it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from scipy.special import stdtrit

from planner.frames import Array
from planner.issues import Issue

Status = Literal["measured", "weak", "held"]
Kind = Literal["tilt", "couplant", "tcp"]
Target = Literal["plane", "sphere"]


@dataclass(frozen=True)
class Estimate:
    """One value with its standard deviation and the half width of its 95 % region, in `unit`.

    status: `measured`; `weak` (applied, but said); `held` (the data do not show it: the value is what it was before).
    """

    value: float
    sigma: float
    half_95: float
    unit: str
    status: Status

    def to_json(self) -> dict[str, float | str | None]:
        """Return the estimate as JSON fields; null where a number is not finite."""
        numbers = {"value": self.value, "sigma": self.sigma, "half_95": self.half_95}
        finite = {name: float(v) if np.isfinite(v) else None for name, v in numbers.items()}
        return {**finite, "unit": self.unit, "status": self.status}


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of one calibration: estimates by name, the setup patch, what to say, and curves to draw by name (k,).

    simulated: the file says that no transducer took it; False where a file cannot say.
    """

    kind: Kind
    estimates: Mapping[str, Estimate]
    patch: dict[str, Any]
    readings: int
    residual_rms: float
    residual_unit: str
    issues: tuple[Issue, ...] = ()
    curves: Mapping[str, Array] = field(default_factory=dict)
    simulated: bool = False

    @property
    def observable(self) -> bool:
        """True when at least one value is not held."""
        return any(estimate.status != "held" for estimate in self.estimates.values())

    def to_json(self) -> dict[str, Any]:
        """Return the result without its curves."""
        return {
            "kind": self.kind,
            "estimates": {name: estimate.to_json() for name, estimate in self.estimates.items()},
            "patch": self.patch,
            "readings": self.readings,
            "residual_rms": self.residual_rms,
            "residual_unit": self.residual_unit,
            "issues": [issue.to_json() for issue in self.issues],
        }


def factor_95(dof: float) -> float:
    """Return the half width of a 95 % region in standard deviations estimated with `dof` degrees of freedom."""
    return float(stdtrit(max(dof, 1.0), 0.975))
