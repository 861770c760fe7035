"""Readings of a fixed sphere as `SphereViews`, and a first, robust look at where it is."""

from collections.abc import Callable

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
        used.astype(np.int64),
    )


def first_look(views: SphereViews, about: tuple[float, Array], prior_sigma: Array, at_mm: float) -> Array:
    """Return an unknown (14,) near the truth, outliers notwithstanding: from distances, then with levels too.

    about: radius and centre, roughly. prior_sigma (14,): what is believed of the unknown beforehand, about its start;
    infinite for nothing. at_mm: distance to which the level belongs.
    """
    start = np.zeros(UNKNOWNS)
    start[RADIUS], start[CENTRE] = about
    look = views.subset(np.unique(np.linspace(0, len(views) - 1, FIRST_LOOK).astype(np.int64)))
    free = np.zeros(UNKNOWNS, dtype=bool)
    free[CENTRE] = free[RADIUS] = free[TCP] = True
    found, _ = _robust(look, start, start, free, prior_sigma, at_mm, _soft)
    found, _ = _robust(look, start, found, free, prior_sigma, at_mm, _redescending)
    off = np.abs(look.distance_mm - see(look, found, at_mm).distance_mm)
    # A false echo's level, where the sphere's would be faint, says much and all of it wrong.
    look = look.subset(off < 4.0 * max(1.4826 * float(np.median(off)), FIRST_MM))
    heard = np.isfinite(look.level_db)
    if heard.sum() < MIN_READINGS:
        return found
    # How the level falls with a tilt is far from a straight line, so that a poor first tilt may lead astray: try several.
    start[LEVEL] = found[LEVEL] = float(np.quantile(look.level_db[heard], 0.95))
    tries = []
    for c_deg in FIRST_TILTS_DEG:
        tilted = found.copy()
        tilted[TCP.start] = np.radians(c_deg)
        tries.append(_robust(look, start, tilted, np.ones(UNKNOWNS, dtype=bool), prior_sigma, at_mm, _redescending))
    return min(tries, key=lambda t: t[1])[0]


def _robust(
    look: SphereViews,
    believed: Array,
    start: Array,
    free: NDArray[np.bool_],
    prior_sigma: Array,
    at_mm: float,
    rho: Callable[[Array], Array],
) -> tuple[Array, float]:
    """Return the unknown of least robust cost, and that cost; levels count if the level is free. Beliefs count in full."""
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

    def loss(z: Array) -> Array:
        """Of squared rows: value, first and second derivative (3, n)."""
        data = len(z) - int(free.sum())
        plain = np.stack([z[data:], np.ones(len(z) - data), np.zeros(len(z) - data)])
        return np.hstack([rho(z[:data]), plain])

    found = least_squares(rows, start[free], slopes, loss=loss, x_scale="jac", max_nfev=40, ftol=1e-5)
    return spread(found.x), float(found.cost)


def _soft(z: Array) -> Array:
    root = np.sqrt(1.0 + z)
    return np.stack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])


def _redescending(z: Array) -> Array:
    """Cauchy's: what is far off pulls less the farther it is."""
    pull = 1.0 / (1.0 + z)
    return np.stack([np.log1p(z), pull, -pull * pull])


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
