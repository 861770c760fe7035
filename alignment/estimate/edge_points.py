"""Where the echo falls to half: crossings of the part's edges, along the passes and across the laws.

Half the amplitude (-6 dB) means half of the beam on the part, so its middle stands over the edge. Between two readings
the place is found on the beam's own S-curve (`edge_curve`).
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.estimate.edge_readings import EdgeReadings, edge_readings
from alignment.estimate.pose_line import PoseLine
from planner.frames import Array
from planner.probe import law_offsets_mm
from planner.setup import Probe

# Readings farther apart than this do not bracket an edge closely enough (mm).
MOST_GAP_MM = 6.0
# Tilt that takes more than this of the echo, or this much from one reading to the next (dB), cannot be given back well enough.
MOST_LOSS_DB, MOST_STEP_DB = 10.0, 2.0
# Crossings share what the poses between two readings wander (mm): none is known better than this.
EVEN_MM = 0.02
# None weighs less or more than this against a usual one.
WEIGHTS = (1e-2, 4.0)


@dataclass(frozen=True, eq=False)
class EdgePoints:
    """k crossings between two readings each, one on the part and one off it.

    on_base, off_base (k, 3): where their laws stand, mm.
    window (k, 8): shares from three readings further on to three further off the part, NaN where there are none to trust;
    window_other (k, 8): the same if tilt takes of the echo what it may take as well. at, at_other (k,): place of the edge
    from on (0) to off (1), by either. misfit (k,): mean squared misfit of the shares to the beam's S-curve.
    sigma_mm (k,): how well its readings tell the place. scatter, dropout (k,): of the shares on the part, and how often an
    echo is lost there. beam (k, 3): blend, width in mm and floor of the S-curve (`edge_curve.Beam`), NaN where not known yet.
    travel_base (k, 3): unit direction of travel. along (k,): True if found along the pass, False if across the laws.
    pass_id, law (k,). s_mm (k,): where on the path the edge lies; step_s_mm (k,): from the reading on to the one off it.
    """

    on_base: Array
    off_base: Array
    window: Array
    window_other: Array
    at: Array
    at_other: Array
    misfit: Array
    sigma_mm: Array
    scatter: Array
    dropout: Array
    beam: Array
    travel_base: Array
    along: NDArray[np.bool_]
    pass_id: NDArray[np.int32]
    s_mm: Array
    step_s_mm: Array
    law: Array

    def __len__(self) -> int:
        return len(self.at)

    def take(self, rows: NDArray[np.bool_]) -> "EdgePoints":
        """Return the crossings picked."""
        return EdgePoints(*(getattr(self, f.name)[rows] for f in fields(self)))

    @property
    def gap_mm(self) -> Array:
        """Distance between the two readings (k,), mm."""
        return np.asarray(np.linalg.norm(self.off_base - self.on_base, axis=1))

    @property
    def origins_base(self) -> Array:
        """Where a law stands when half its beam is on the part (k, 3), mm."""
        return self.on_base + self.at[:, None] * (self.off_base - self.on_base)

    @property
    def weight(self) -> Array:
        """How much each crossing counts (k,), the usual one 1: inverse variance of its place."""
        variance = self.sigma_mm**2 + EVEN_MM**2
        usual = float(np.median(variance)) if len(variance) else 1.0
        return np.asarray(np.clip(usual / variance, *WEIGHTS))

    @property
    def outward_base(self) -> Array:
        """Unit direction (k, 3) from on to off the part."""
        gap = self.gap_mm
        return (self.off_base - self.on_base) / np.where(gap > 0, gap, 1.0)[:, None]


def edge_points(
    cloud: PointCloud, line: PoseLine, probe: Probe, loss_db: Array, loss_other_db: Array, expected_mm: Array
) -> EdgePoints:
    """Return all crossings of a cloud that knows amplitudes; none otherwise.

    loss_db (m, laws): what tilt takes of the echo, given back before edges are looked for; where it takes too much, or too
    steeply, nothing is said. loss_other_db (m, laws): what it may take as well. expected_mm (m, laws): distance of the
    placed part, by which its echoes are told from others.
    """
    if cloud.beams_base is None or cloud.arrays_base is None or not np.isfinite(cloud.amplitude_pct).any():
        return _none()
    heard = _readings(cloud, line, probe, loss_db, expected_mm)
    other = _readings(cloud, line, probe, loss_other_db, expected_mm) if loss_other_db.any() else heard
    if heard is None or other is None:
        return _none()
    on = heard.on
    x = law_offsets_mm(probe)
    step = np.abs(np.diff(line.s_mm))
    same = (np.diff(line.pass_id) == 0) & line.present[1:] & line.present[:-1] & (step < MOST_GAP_MM) & (step > 1e-6)
    i, k = np.nonzero((on[:-1] != on[1:]) & same[:, None])
    j, h = np.nonzero((on[:, :-1] != on[:, 1:]) & line.present[:, None])
    pose = np.column_stack([np.r_[i, j], np.r_[i + 1, j]])
    law = np.column_stack([np.r_[k, h], np.r_[k, h + 1]])
    swap = ~on[pose[:, 0], law[:, 0]]
    pose[swap], law[swap] = pose[swap, ::-1], law[swap, ::-1]
    loss = _windows(loss_db, line, pose, law)
    told = (np.nanmax(loss, axis=1) < MOST_LOSS_DB) & (np.nanmax(np.abs(np.diff(loss, axis=1)), axis=1) < MOST_STEP_DB)
    good = np.flatnonzero(told & _clear(_windows(on.astype(np.float64), line, pose, law)))
    pose, law = pose[good], law[good]
    origin = [line.position_base[pose[:, c]] + x[law[:, c]][:, None] * line.array_base[pose[:, c]] for c in (0, 1)]
    half, zero = np.full(len(pose), 0.5), np.zeros(len(pose))
    return EdgePoints(
        origin[0],
        origin[1],
        _windows(heard.share, line, pose, law),
        _windows(other.share, line, pose, law),
        half,
        half.copy(),
        zero,
        zero + 1.0,
        zero + heard.scatter,
        zero + heard.dropout,
        np.full((len(pose), 3), np.nan),
        line.travel_base[pose[:, 0]],
        good < len(i),
        line.pass_id[pose[:, 0]],
        line.s_mm[pose].mean(axis=1),
        line.s_mm[pose[:, 1]] - line.s_mm[pose[:, 0]],
        law.mean(axis=1),
    )


def _readings(
    cloud: PointCloud, line: PoseLine, probe: Probe, loss_db: Array, expected_mm: Array
) -> EdgeReadings | None:
    return edge_readings(cloud, line, probe.pitch_mm, probe.laws, 10.0 ** (loss_db / 20.0), expected_mm)


def _clear(on: Array) -> NDArray[np.bool_]:
    """Return which crossings (k, 8) are edges: on the part (1) for all readings before, off it (0) behind, two at least each.

    A lost echo or a splash comes and goes; beyond an edge there is nothing.
    """
    before, behind = on[:, :4], on[:, 4:]
    known_on, known_off = np.isfinite(before).sum(axis=1), np.isfinite(behind).sum(axis=1)
    stays = ~((before == 0.0).any(axis=1) | (behind == 1.0).any(axis=1))
    return stays & (known_on >= 3) & (known_off >= 2)


def _windows(share: Array, line: PoseLine, pose: NDArray, law: NDArray) -> Array:
    """Return shares (k, 8) along the line of each crossing, the crossing between the fourth and the fifth."""
    step_pose, step_law = pose[:, 1] - pose[:, 0], law[:, 1] - law[:, 0]
    reach = np.arange(-3, 5)
    p = pose[:, :1] + reach * step_pose[:, None]
    k = law[:, :1] + reach * step_law[:, None]
    inside = (p >= 0) & (p < share.shape[0]) & (k >= 0) & (k < share.shape[1])
    p, k = np.clip(p, 0, share.shape[0] - 1), np.clip(k, 0, share.shape[1] - 1)
    inside &= (line.pass_id[p] == line.pass_id[pose[:, :1]]) & line.present[p]
    return np.where(inside, share[p, k], np.nan)


def _none() -> EdgePoints:
    z, z3, z8 = np.zeros(0), np.zeros((0, 3)), np.zeros((0, 8))
    no, none = np.zeros(0, dtype=bool), np.zeros(0, dtype=np.int32)
    return EdgePoints(
        on_base=z3, off_base=z3, window=z8, window_other=z8, at=z, at_other=z, misfit=z, sigma_mm=z, scatter=z, dropout=z,
        beam=z3, travel_base=z3, along=no, pass_id=none, s_mm=z, step_s_mm=z, law=z,
    )  # fmt: skip
