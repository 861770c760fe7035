"""Where the echo falls to half: crossings of the part's edges, along the passes and across the laws.

Half the amplitude (-6 dB) means half of the beam on the part, so its middle stands over the edge. Between two readings
the place is found on the beam's own S-curve (`edge_curve`).
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter

from alignment.cloud import PointCloud
from alignment.estimate.pose_line import PoseLine
from planner.frames import Array
from planner.probe import law_offsets_mm
from planner.setup import Probe

# Readings farther apart than this do not bracket an edge closely enough (mm).
MOST_GAP_MM = 6.0
# Tilt that takes more than this of the echo, or this much from one reading to the next (dB), cannot be given back well enough.
MOST_LOSS_DB, MOST_STEP_DB = 10.0, 2.0
# Around a reading, how far its plateau is looked for along the pass and across the laws (mm).
PLATEAU_ALONG_MM, PLATEAU_ACROSS_MM = 12.0, 6.0


@dataclass(frozen=True, eq=False)
class EdgePoints:
    """k crossings between two readings each, one on the part and one off it.

    on_base, off_base (k, 3): where their laws stand, mm; share_on, share_off (k,): their amplitudes over the plateau.
    window (k, 8): shares from three readings further on to three further off the part, NaN where there are none to trust;
    window_other (k, 8): the same if tilt takes of the echo what it may take as well. at, at_other (k,): place of the edge
    from on (0) to off (1), by either. misfit (k,): mean squared misfit of the shares to the beam's S-curve.
    travel_base (k, 3): unit direction of travel. along (k,): True if found along the pass, False if across the laws.
    pass_id, s_mm, law (k,).
    """

    on_base: Array
    off_base: Array
    share_on: Array
    share_off: Array
    window: Array
    window_other: Array
    at: Array
    at_other: Array
    misfit: Array
    travel_base: Array
    along: NDArray[np.bool_]
    pass_id: NDArray[np.int32]
    s_mm: Array
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
    def outward_base(self) -> Array:
        """Unit direction (k, 3) from on to off the part."""
        gap = self.gap_mm
        return (self.off_base - self.on_base) / np.where(gap > 0, gap, 1.0)[:, None]


def edge_points(cloud: PointCloud, line: PoseLine, probe: Probe, loss_db: Array, loss_other_db: Array) -> EdgePoints:
    """Return all crossings of a cloud that knows amplitudes; none otherwise.

    loss_db (m, laws): what tilt takes of the echo, given back before edges are looked for; where it takes too much, or too
    steeply, nothing is said. loss_other_db (m, laws): what it may take as well.
    """
    if cloud.beams_base is None or cloud.arrays_base is None or not np.isfinite(cloud.amplitude_pct).any():
        return _none()
    shares = _shares(cloud, line, probe, 10.0 ** (loss_db / 20.0))
    if shares is None:
        return _none()
    others = _shares(cloud, line, probe, 10.0 ** (loss_other_db / 20.0)) if loss_other_db.any() else shares
    assert others is not None
    share, measured = shares
    x = law_offsets_mm(probe)
    step = np.abs(np.diff(line.s_mm))
    same = (np.diff(line.pass_id) == 0) & line.present[1:] & line.present[:-1] & (step < MOST_GAP_MM) & (step > 1e-6)
    i, k = np.nonzero(_crosses(share[:-1], share[1:]) & same[:, None])
    j, h = np.nonzero(_crosses(share[:, :-1], share[:, 1:]) & line.present[:, None])
    pose = np.column_stack([np.r_[i, j], np.r_[i + 1, j]])
    law = np.column_stack([np.r_[k, h], np.r_[k, h + 1]])
    swap = share[pose[:, 0], law[:, 0]] < share[pose[:, 1], law[:, 1]]
    pose[swap], law[swap] = pose[swap, ::-1], law[swap, ::-1]
    origin = [line.position_base[pose[:, c]] + x[law[:, c]][:, None] * line.array_base[pose[:, c]] for c in (0, 1)]
    found = EdgePoints(
        origin[0],
        origin[1],
        share[pose[:, 0], law[:, 0]],
        share[pose[:, 1], law[:, 1]],
        _windows(measured, line, pose, law),
        _windows(others[1], line, pose, law),
        np.full(len(pose), 0.5),
        np.full(len(pose), 0.5),
        np.zeros(len(pose)),
        line.travel_base[pose[:, 0]],
        np.repeat([True, False], [len(i), len(j)]),
        line.pass_id[pose[:, 0]],
        line.s_mm[pose].mean(axis=1),
        law.mean(axis=1),
    )
    loss = _windows(loss_db, line, pose, law)
    told = (np.nanmax(loss, axis=1) < MOST_LOSS_DB) & (np.nanmax(np.abs(np.diff(loss, axis=1)), axis=1) < MOST_STEP_DB)
    # Both readings next to the edge have to be measured ones: what was mended says on which side, not how far.
    sure = np.isfinite(found.window[:, 3:5]).all(axis=1) & np.isfinite(found.window_other[:, 3:5]).all(axis=1)
    return found.take(_clear(_windows(share, line, pose, law)) & told & sure)


def _clear(window: Array) -> NDArray[np.bool_]:
    """Return which crossings are edges: on the part for all readings before, off it for all behind, two at least each.

    A lost echo or a splash comes and goes; beyond an edge there is nothing.
    """
    on, off = window[:, :4], window[:, 4:]
    known_on, known_off = np.isfinite(on).sum(axis=1), np.isfinite(off).sum(axis=1)
    stays = ((on > 0.5) | np.isnan(on)).all(axis=1) & ((off < 0.5) | np.isnan(off)).all(axis=1)
    return stays & (known_on >= 3) & (known_off >= 2)


def _shares(cloud: PointCloud, line: PoseLine, probe: Probe, gain: Array) -> tuple[Array, Array] | None:
    """Return the amplitude of every pose and law over its plateau, twice (m, laws): 0 where no echo came back.

    First with odd readings mended, which tells on from off the part; then with NaN in their place: the median of neighbours
    is no measurement, and near an edge it would pull the edge to where the neighbours are.
    """
    m, laws = len(line.present), probe.laws
    amplitude = np.zeros((m, laws))
    known = np.zeros((m, laws), dtype=bool)
    value = np.nan_to_num(cloud.amplitude_pct)
    amplitude[cloud.pose_index, cloud.law - 1] = value
    known[cloud.pose_index, cloud.law - 1] = np.isfinite(cloud.amplitude_pct)
    known[cloud.lost_pose_index, cloud.lost_law - 1] = True
    if not (value > 0).any():
        return None
    amplitude *= gain
    usual = float(np.median(amplitude[amplitude > 0]))
    spacing = max(line.spacing_mm, 1e-3)
    along = 2 * max(1, round(PLATEAU_ALONG_MM / spacing)) + 1
    across = 2 * max(1, round(PLATEAU_ACROSS_MM / probe.pitch_mm)) + 1 if laws > 1 else 1
    out, sure = np.zeros((m, laws)), np.zeros((m, laws), dtype=bool)
    for first, last in _runs(line):
        part = slice(first, last)
        a, k = amplitude[part], known[part]
        a, sure[part] = _mend(a, k, usual)
        plateau = np.full(a.shape, usual)
        for level in (0.5, 0.85, 0.95):
            loud = a > level * plateau
            weight = uniform_filter(loud.astype(np.float64), (along, across), mode="constant")
            total = uniform_filter(np.where(loud, a, 0.0), (along, across), mode="constant")
            plateau = np.where(weight > 1e-9, total / np.maximum(weight, 1e-9), plateau)
        out[part] = np.minimum(a / plateau, 1.5)
    return out, np.where(sure, out, np.nan)


def _runs(line: PoseLine) -> list[tuple[int, int]]:
    cut = np.flatnonzero(np.diff(line.pass_id) != 0) + 1
    return list(zip(np.r_[0, cut], np.r_[cut, len(line.pass_id)], strict=True))


def _mend(a: Array, known: NDArray[np.bool_], usual: float) -> tuple[Array, NDArray[np.bool_]]:
    """Replace what contradicts its neighbours, an echo lost by chance or a splash, by their median; say what was left as is.

    Only readings on the other side of half amplitude than their neighbours' median are touched: edges stay where they are.
    """
    size = (3, 3) if a.shape[1] > 1 else (5, 1)
    middle = median_filter(a, size=size, mode="nearest")
    odd = ((a > 0.5 * usual) != (middle > 0.5 * usual)) | ~known
    # A second look with the first mends in place, so that neighbours lost together do not outvote the rest.
    mended = np.where(odd, middle, a)
    middle = median_filter(mended, size=size, mode="nearest")
    odd = (a > 0.5 * usual) != (middle > 0.5 * usual)
    # What was never recorded, where nothing is heard, is the silence of an echo that a file has no row for.
    return np.where(odd | ~known, middle, a), ~odd


def _crosses(a: Array, b: Array) -> NDArray[np.bool_]:
    return (a > 0.5) != (b > 0.5)


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
    z3, z = np.zeros((0, 3)), np.zeros(0)
    no, none = np.zeros(0, dtype=bool), np.zeros(0, dtype=np.int32)
    w = np.zeros((0, 8))
    return EdgePoints(
        z3, z3.copy(), z, z.copy(), w, w.copy(), z.copy(), z.copy(), z.copy(), z3.copy(), no, none, z.copy(), z.copy()
    )
