"""Readings of a fixed sphere as `SphereViews`, and a first, robust look at where it is."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from alignment.calibrate.sphere_model import CENTRE, LEVEL, RADIUS, TCP, UNKNOWNS, SphereViews, see
from alignment.scan import Scan
from planner.couplant import distance_mm
from planner.errors import fail
from planner.frames import Array
from planner.probe import law_origins_tcp, tool_axes
from planner.setup import Setup

MIN_READINGS, MIN_POSES = 40, 12
# Readings of the first look: enough for a start, and quick.
FIRST_LOOK = 1200
FIRST_MM, FIRST_DB = 0.05, 0.5
FIRST_TILTS_DEG = (-3.0, -1.0, 1.0, 3.0)
# Levels of the first look: those this far below the strongest.
STRONG_DB = 10.0
# An amplitude that this share of the readings has in common is where the receiver clips.
CLIPPED_SHARE = 0.03


def sphere_views(scan: Scan, setup: Setup) -> SphereViews:
    """Return the echoes of a scan of a fixed sphere. Raises EchoBaseError `tcp-readings` where they are too few."""
    distance = distance_mm(scan.tof_us, setup.couplant)
    origins = law_origins_tcp(setup.probe)
    law = scan.law - 1
    good = np.isfinite(distance) & (distance > 0.0) & (law >= 0) & (law < len(origins))
    used, pose = np.unique(scan.pose_index[good], return_inverse=True)
    if len(used) < MIN_POSES or good.sum() < MIN_READINGS:
        raise fail(
            "tcp-readings",
            f"Only {len(used)} poses saw the target, in {int(good.sum())} echoes.",
            "Pass over a fixed sphere from 5 or more directions, up to 30 deg apart, turned about the beam by 90 deg.",
            scan.name,
        )
    tcp = scan.Ts_scan_tcp[used] @ tool_axes(setup.tool)
    loss = setup.probe.tilt_loss_db_per_deg2
    return SphereViews(
        tcp.rotation_matrix,
        tcp.xyz_mm,
        pose.ravel().astype(np.int32),
        origins[law[good]],
        distance[good],
        _level_db(scan.amplitude_pct[good]),
        max(loss.b, 1e-3),
        max(loss.c, 1e-3),
    )


def first_look(views: SphereViews, radius_mm: float | None, prior_sigma: Array, at_mm: float) -> Array:
    """Return an unknown (14,) near the truth, outliers notwithstanding: from distances, then with levels too.

    prior_sigma (14,): what is believed of the unknown beforehand, about its start; infinite for nothing. at_mm: distance
    to which the level belongs.
    """
    rotation, beam = views.rotation[views.pose], views.rotation[views.pose, :, 2]
    face = views.origin_base[views.pose] + np.einsum("nij,nj->ni", rotation, views.law_tcp)
    surface = face + views.distance_mm[:, None] * beam
    start = np.zeros(UNKNOWNS)
    start[RADIUS] = radius_mm if radius_mm is not None else _radius(surface, beam)
    start[CENTRE] = np.median(surface + start[RADIUS] * beam, axis=0)
    look = views.subset(np.unique(np.linspace(0, len(views) - 1, FIRST_LOOK).astype(np.int64)))
    free = np.zeros(UNKNOWNS, dtype=bool)
    free[CENTRE] = free[RADIUS] = free[TCP] = True
    found, _ = _robust(look, start, start, free, prior_sigma, at_mm)
    heard = np.isfinite(look.level_db)
    if heard.sum() < MIN_READINGS:
        return found
    # How the level falls with a tilt is far from a straight line, so that a poor first tilt may lead astray: try several.
    start[LEVEL] = found[LEVEL] = float(np.quantile(look.level_db[heard], 0.95))
    tries = []
    for c_deg in FIRST_TILTS_DEG:
        tilted = found.copy()
        tilted[TCP.start] = np.radians(c_deg)
        tries.append(_robust(look, start, tilted, np.ones(UNKNOWNS, dtype=bool), prior_sigma, at_mm))
    return min(tries, key=lambda t: t[1])[0]


def _robust(
    look: SphereViews, believed: Array, start: Array, free: NDArray[np.bool_], prior_sigma: Array, at_mm: float
) -> tuple[Array, float]:
    """Return the unknown of least robust cost, and that cost; levels count if the level is free."""
    strong = np.isfinite(look.level_db) & free[LEVEL]
    if strong.any():
        strong &= look.level_db > np.quantile(look.level_db[strong], 0.95) - STRONG_DB
    weight = 1.0 / prior_sigma[free]

    def spread(v: Array) -> Array:
        full = start.copy()
        full[free] = v
        return full

    def rows(v: Array) -> Array:
        seen = see(look, spread(v), at_mm)
        distance = (look.distance_mm - seen.distance_mm) / FIRST_MM
        level = (look.level_db - seen.level_db)[strong] / FIRST_DB
        return np.concatenate([distance, level, weight * (v - believed[free])])

    def slopes(v: Array) -> Array:
        seen = see(look, spread(v), at_mm)
        blocks = -seen.d_distance[:, free] / FIRST_MM, -seen.d_level[strong][:, free] / FIRST_DB, np.diag(weight)
        return np.vstack(blocks)

    found = least_squares(rows, start[free], slopes, loss="soft_l1", x_scale="jac", max_nfev=40, ftol=1e-5)
    return spread(found.x), float(found.cost)


def _radius(surface: Array, beam: Array) -> float:
    """Return the radius (mm) at which the points surface + radius beam (n, 3) lie closest together, outliers dropped."""
    keep = np.ones(len(surface), dtype=bool)
    radius = 0.0
    for _ in range(8):
        s, b = surface[keep] - surface[keep].mean(axis=0), beam[keep] - beam[keep].mean(axis=0)
        radius = -float((s * b).sum()) / max(float((b * b).sum()), 1e-12)
        radius = float(np.clip(radius, 1.0, 500.0))
        together = surface + radius * beam
        off = np.linalg.norm(together - np.median(together, axis=0), axis=1)
        keep = off <= 3.0 * np.median(off) + 1e-9
    return radius


def _level_db(amplitude_pct: Array) -> Array:
    """Return levels in dB; NaN where unknown, or where the receiver clips."""
    level = np.full(len(amplitude_pct), np.nan)
    known = np.isfinite(amplitude_pct) & (amplitude_pct > 0.0)
    if not known.any():
        return level
    top = amplitude_pct[known].max()
    if (amplitude_pct[known] == top).mean() > CLIPPED_SHARE:
        known &= amplitude_pct < top
    level[known] = 20.0 * np.log10(amplitude_pct[known])
    return level
