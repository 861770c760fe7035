"""Readings of a flat target condensed to one distance, one slope and one level per pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.scan import Scan
from planner.couplant import distance_mm
from planner.errors import fail
from planner.frames import Array, Transform
from planner.probe import law_offsets_mm, tool_axes
from planner.setup import Setup

MIN_SHARE = 0.5
HUBER = 1.345
ROUNDS = 8


@dataclass(frozen=True, eq=False)
class PlaneViews:
    """m poses that saw the target.

    Ts_base_tcp: EchoBase's TCP (beam z, array x) as the robot believes it, stack m. middle_mm (m,): distance of the target
    from the middle of the array. slope (m,): change of distance per mm along the array, NaN for a single crystal.
    level_db (m,): mean amplitude, NaN if unknown. pose (m,): row in the poses of the scan.
    """

    Ts_base_tcp: Transform
    middle_mm: Array
    slope: Array
    level_db: Array
    pose: NDArray[np.int64]


def plane_views(scan: Scan, setup: Setup) -> PlaneViews:
    """Return the condensed readings of a scan of a flat target.

    On a plane the perpendicular distance changes linearly along the array; a straight line by iterated reweighting (Huber)
    over the laws of a pose keeps all of it and sheds outliers. Poses with fewer than half their laws are left out.
    """
    distance = distance_mm(scan.tof_us, setup.couplant)
    offsets = law_offsets_mm(setup.probe)
    law = scan.law - 1
    good = np.isfinite(distance) & (law >= 0) & (law < len(offsets))
    pose, d, x = scan.pose_index[good], distance[good], offsets[law[good]]
    count = np.bincount(pose, minlength=len(scan.Ts_scan_tcp))
    single = len(offsets) == 1
    middle, slope = _lines(pose, x, d, len(count), single)
    with np.errstate(divide="ignore", invalid="ignore"):
        amplitude = np.bincount(pose, np.nan_to_num(scan.amplitude_pct[good], nan=0.0), len(count)) / count
        level = 20.0 * np.log10(amplitude)
    use = (count >= max(1.0, MIN_SHARE * len(offsets))) & np.isfinite(middle)
    if use.sum() < 6:
        raise fail(
            "tcp-readings",
            f"Only {int(use.sum())} poses saw the target.",
            "View a fixed flat target from 20 or more poses, tilted both ways and turned about the beam.",
            scan.name,
        )
    seen = np.flatnonzero(use)
    tcp = scan.Ts_scan_tcp[seen] @ tool_axes(setup.tool)
    poses = Transform("base", "tcp", tcp.rigid)
    return PlaneViews(poses, middle[use], slope[use], np.where(np.isfinite(level[use]), level[use], np.nan), seen)


def _lines(pose: NDArray[np.int32], x: Array, d: Array, poses: int, single: bool) -> tuple[Array, Array]:
    weight = np.ones_like(d)
    middle, slope = np.full(poses, np.nan), np.full(poses, np.nan)
    for _ in range(ROUNDS):
        s0, sx, sxx, sd, sxd = (np.bincount(pose, weight * v, poses) for v in (np.ones_like(x), x, x * x, d, x * d))
        det = s0 * sxx - sx * sx
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.full(poses, np.nan) if single else np.where(det > 1e-9, (s0 * sxd - sx * sd) / det, np.nan)
            middle = sd / s0 if single else np.where(det > 1e-9, (sxx * sd - sx * sxd) / det, np.nan)
        off = np.abs(d - middle[pose] - (0.0 if single else slope[pose] * x))
        scale = max(1.4826 * float(np.nanmedian(off)), 1e-9)
        weight = np.nan_to_num(np.minimum(1.0, HUBER * scale / np.maximum(off, 1e-12)))
        # Beyond six scales a reading is of something else.
        weight[np.nan_to_num(off, nan=np.inf) > 6.0 * scale] = 0.0
    return middle, slope
