"""`assess`: an inspection scan against the part, in the paper's figures (its Fig. 8), from data."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.metrics.bubbles import bubbles
from alignment.metrics.expected import Closest
from alignment.metrics.feet import feet, search
from alignment.metrics.figures import WITHIN_DB, centre_laws, loss_db, spread, tilts_deg
from planner.errors import fail
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.setup import Setup


@dataclass(frozen=True)
class Assessed:
    """The figures of one scan: `assessment.json`, `after` or `before`. All but `over_spray` are of the centre law.

    over_spray: share (0..1) of all readings, lost ones included, whose beam lies less than half on the part; they are
    left out of the rest. tof_std_mm, tof_range_mm: spread of the standoff. db_range_db, mean_abs_db: of the amplitude in
    dB from the reference. within_2db: share of the firings on the part within 2 dB; a lost echo is not.
    """

    over_spray: float
    tof_std_mm: float
    tof_range_mm: float
    db_range_db: float
    mean_abs_db: float
    within_2db: float

    def to_json(self) -> dict[str, float | None]:
        """Return the fields of the contract; null where there was nothing to measure."""
        return {key: value if np.isfinite(value) else None for key, value in asdict(self).items()}


@dataclass(frozen=True, eq=False)
class Assessment:
    """Figures and maps of one scan. Arrays are (n,), a row a usable reading of the cloud.

    feet_part (n, 3): where each beam meets the part, mm. deviation_mm: measured less expected distance. db: amplitude
    from the reference; expected_db: what the tilt of the CAD lets each law expect. on_part: at least half the beam is.
    centre: belongs to the centre law. bubble: an echo that is not the front wall (centre law only).
    """

    figures: Assessed
    feet_part: Array
    distance_mm: Array
    deviation_mm: Array
    db: Array
    expected_db: Array
    on_part: NDArray[np.bool_]
    centre: NDArray[np.bool_]
    bubble: NDArray[np.bool_]
    issues: tuple[Issue, ...]


def assess(cloud: PointCloud, curved: Closest, setup: Setup, T_base_part: Transform) -> Assessment:
    """Return the assessment of a scan of the part at `T_base_part` (measured, where an alignment exists).

    The beam is on the part by half or more where the foot of its law lies on the inspection surface. Fails for a cloud
    of ready surface points, and if the centre law never met the part.
    """
    if cloud.beams_base is None or cloud.arrays_base is None:
        raise fail(
            "assess-needs-echoes",
            "a cloud of surface points has no echoes to assess.",
            "Give the readings of the scan.",
        )
    to_part = T_base_part.inv()
    found = feet(cloud, curved, to_part, setup.probe)
    beams, arrays = to_part.directions(cloud.beams_base), to_part.directions(cloud.arrays_base)
    expected_db = loss_db(*tilts_deg(beams, arrays, found.normals), setup.probe)
    on_part = found.interior
    with np.errstate(divide="ignore", invalid="ignore"):
        db = 20.0 * np.log10(cloud.amplitude_pct / setup.reference_amplitude_pct)
    db[~np.isfinite(db)] = np.nan
    centre = np.isin(cloud.law, centre_laws(setup.probe))
    bubble = _bubbles(cloud, centre)
    lost_on_part = np.zeros(len(cloud.lost_law), dtype=bool)
    if len(cloud.lost_law):
        lost_on_part = search(curved, to_part.points(cloud.lost_origins_base)).interior
    figures, issues = _figures(cloud, setup, on_part, centre, bubble, db, lost_on_part)
    return Assessment(
        figures=figures,
        feet_part=found.points,
        distance_mm=cloud.distance_mm,
        deviation_mm=cloud.distance_mm - found.distance_mm,
        db=db,
        expected_db=expected_db,
        on_part=on_part,
        centre=centre,
        bubble=bubble,
        issues=issues,
    )


def compare(after: Assessed, before: Assessed | None) -> dict[str, Any]:
    """Return `assessment.json`: both sets of figures and the improvement of the mean |dB| in % (null without `before`)."""
    improvement = None
    if before is not None and np.isfinite(before.mean_abs_db) and before.mean_abs_db > 0.0:
        value = 100.0 * (before.mean_abs_db - after.mean_abs_db) / before.mean_abs_db
        improvement = value if np.isfinite(value) else None
    return {
        "after": after.to_json(),
        "before": None if before is None else before.to_json(),
        "improvement_pct": improvement,
    }


def _bubbles(cloud: PointCloud, centre: NDArray[np.bool_]) -> NDArray[np.bool_]:
    out = np.zeros(len(cloud), dtype=bool)
    rows = np.flatnonzero(centre)
    track = (
        (cloud.scan_id[rows].astype(np.int64) << 40) + (cloud.pass_id[rows].astype(np.int64) << 16) + cloud.law[rows]
    )
    order = np.lexsort((cloud.pose_index[rows], track))
    out[rows] = bubbles(cloud.distance_mm[rows], order, track)
    return out


def _figures(
    cloud: PointCloud,
    setup: Setup,
    on_part: NDArray[np.bool_],
    centre: NDArray[np.bool_],
    bubble: NDArray[np.bool_],
    db: Array,
    lost_on_part: NDArray[np.bool_],
) -> tuple[Assessed, tuple[Issue, ...]]:
    used = centre & on_part & ~bubble
    if not used.any():
        raise fail(
            "assess-off-part",
            "the centre law never met the inspection surface.",
            "Check that the scan is of this part, and say in which BASE it was taken.",
        )
    silent = int(np.count_nonzero(lost_on_part & np.isin(cloud.lost_law, centre_laws(setup.probe))))
    std, width = spread(cloud.distance_mm[used])
    level = db[used]
    known = level[np.isfinite(level)]
    issues = list(cloud.issues)
    if bubble.any():
        text = f"{int(bubble.sum())} echoes of the centre law stand apart from their neighbours and were left out."
        issues.append(Issue("info", "bubbles", text, "", ""))
    if silent:
        text = f"{silent} firings of the centre law on the part have no echo; they count as outside 2 dB."
        issues.append(Issue("warning", "echoes-lost-on-part", text, "Look at the map for where.", ""))
    everything = len(cloud) + len(cloud.lost_law)
    off = int(np.count_nonzero(~on_part)) + int(np.count_nonzero(~lost_on_part))
    within = np.count_nonzero(np.abs(known) <= WITHIN_DB) / (len(known) + silent) if len(known) else float("nan")
    figures = Assessed(
        over_spray=off / everything,
        tof_std_mm=std,
        tof_range_mm=width,
        db_range_db=float(np.ptp(known)) if len(known) else float("nan"),
        mean_abs_db=float(np.abs(known).mean()) if len(known) else float("nan"),
        within_2db=float(within),
    )
    return figures, tuple(issues)
