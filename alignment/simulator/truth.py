"""What the simulated scanner knows and the alignment does not: where the part is, its shape, and the noise."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from planner.frames import Array, Transform

Field = Callable[[Array], Array]
"""Displacement along the outward normal (n,), mm, of points of the inspection surface (n, 3) in `part`, mm. Smooth."""


class TrueSurface(Protocol):
    """The inspected face of the true part, in `part`, mm. An analytic one may stand in for the one behind the triangles."""

    def foot(self, points: Array) -> tuple[Array, Array]:
        """Return the closest surface points (n, 3) and the outward unit normals there (n, 3).

        Where a query is beyond the rim, the closest point lies on the rim.
        """
        ...


@dataclass(frozen=True)
class Truth:
    """The hidden truth.

    T_base_basecorr: the correction to be found. spring_back: 0 for none; a number for the largest displacement (mm) of
    the default field (bend and twist together); or a field of your own (see `alignment.simulator.fields`).
    surface: a true shape to use in place of the smooth one behind the part's triangles.
    temperature_error_c: how much warmer the water is than the setup believes.
    """

    T_base_basecorr: Transform
    spring_back: float | Field = 0.0
    surface: TrueSurface | None = None
    temperature_error_c: float = 0.0


@dataclass(frozen=True)
class Noise:
    """What a cell adds to the truth. Defaults are the reference noise of every published figure."""

    pose_mm: float = 0.03
    """Standard deviation of the robot's position, per axis (mm)."""
    pose_deg: float = 0.005
    """Standard deviation of the robot's orientation, per axis (deg)."""
    correlation_mm: float = 10.0
    """Path length over which the pose noise falls to 1/e (mm)."""
    tof_mm: float = 0.01
    """Standard deviation of the time of flight, as one-way distance (mm)."""
    amplitude: float = 0.02
    """Relative standard deviation of the amplitude."""
    outliers: float = 0.0
    """Share of readings that are bubbles or splash: an echo at a wrong time."""
    dropouts: float = 0.0
    """Share of readings lost for no reason."""
    latency_ms: float = 0.0
    """How late the echo is relative to the pose it is recorded with (ms): recorded poses lag behind the firing."""
    prf_hz: float | None = None
    """Firings per second: law k of a sweep fires (k - 1) / prf after the first, on the move. None: all at once."""
    floor_db: float = 20.0
    """Largest amplitude loss through tilt (dB); beyond `lost_deg` there is no echo at all."""
    lost_deg: float = 10.0
    detection_pct: float = 2.0
    """Echoes below this amplitude (%FSH) are not detected."""

    @classmethod
    def none(cls) -> "Noise":
        """Return a perfect cell."""
        return cls(pose_mm=0.0, pose_deg=0.0, tof_mm=0.0, amplitude=0.0)
