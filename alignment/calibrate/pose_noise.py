"""Least squares whose readings share the errors of a robot that is off by hundredths, and stays off for centimetres."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import minimize, minimize_scalar

from planner.frames import Array

MOST_STATIONS = 320
# A turn of the wrist by one radian makes the robot's error as new as a move of this many mm.
LEVER_MM = 100.0
# A step this many times the usual one begins another pass, whose errors may be new.
JUMP, FAR_MM = 4.0, 1e6
LENGTHS_MM = (3.0, 10.0, 30.0, 100.0)
# Below these (mm, dB, mm) no cell is; above the others no robot.
FLOOR = {"distance": 5e-4, "level": 5e-3, "pose": 1e-4}
CEILING = 2.0
# Of a logarithm, as long as only the correlation is to be chosen.
# Noise this much less likely than the best is none to reckon with.
UNLIKELY = 0.05
IMPOSSIBLE = 1e12
COARSE = {"xatol": 0.05}


@dataclass(frozen=True, eq=False)
class Stations:
    """Poses near each other, between which the robot's error hardly changes.

    of_pose (m,): station of each pose. apart: distances (s, s) between stations, mm: along the way recorded ("path"), the
    same but far between passes ("passes"), and through the air ("space").
    """

    of_pose: NDArray[np.int64]
    apart: dict[str, Array]

    def __len__(self) -> int:
        return len(self.apart["path"])


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations: of distances (mm) and levels (dB) apart from the robot, of the robot per axis (mm).

    `pose_mm` is correlated as exp(-distance / length_mm), distance by `metric`. independent: number of
    independent robot errors that the stations amount to. rivals: (likelihood over the best, noise) of what else may be.
    """

    distance_mm: float
    level_db: float
    pose_mm: float
    length_mm: float
    metric: str
    independent: float
    rivals: "tuple[tuple[float, Noise], ...]" = ()


def stations(rotation: Array, origin_base: Array) -> Stations:
    """Return at most MOST_STATIONS stations of m poses in the order recorded: rotation (m, 3, 3), origin_base (m, 3)."""
    turn = np.arccos(np.clip((np.einsum("nij,nij->n", rotation[1:], rotation[:-1]) - 1.0) / 2.0, -1.0, 1.0))
    step = np.linalg.norm(np.diff(origin_base, axis=0), axis=1) + LEVER_MM * turn
    path = np.concatenate([[0.0], np.cumsum(step)])
    # Between passes the robot travels farther than from pose to pose, and perhaps another way.
    run = (
        np.concatenate([[0], np.cumsum(step > JUMP * np.median(step[step > 1e-6]))])
        if (step > 1e-6).any()
        else 0 * path
    )
    # One station never holds poses of two passes: their errors are not one.
    start = np.unique(run, return_index=True)[1]
    within = path - path[start][run]
    width, station = 0.5, _stations(run, within, 0.5)
    while station.max() >= max(MOST_STATIONS, len(start)):
        width *= 1.3
        station = _stations(run, within, width)
    first = np.unique(station, return_index=True)[1]
    # The pose in the middle of each station stands for it.
    middle = first + (np.bincount(station) - 1) // 2
    r, p, s = rotation[middle], origin_base[middle], path[middle]
    cosine = (np.einsum("aij,bij->ab", r, r) - 1.0) / 2.0
    turned = np.arccos(np.clip(cosine, -1.0, 1.0))
    np.fill_diagonal(turned, 0.0)
    air = np.hypot(np.linalg.norm(p[:, None] - p[None], axis=2), LEVER_MM * turned)
    way = np.abs(s[:, None] - s[None])
    same = run[middle][:, None] == run[middle][None]
    return Stations(station, {"path": way, "passes": np.where(same, way, FAR_MM), "space": air})


def _stations(run: NDArray[np.int64], within_mm: Array, width_mm: float) -> NDArray[np.int64]:
    """Return the station of each pose (m,): a run, and a stretch of it."""
    stretch = np.floor(within_mm / width_mm).astype(np.int64)
    return np.asarray(np.unique(run * (stretch.max() + 1) + stretch, return_inverse=True)[1].ravel())


# Of n readings: station (n,), derivatives by the pose's error (n, 3), by the unknown beside the residual (n, p + 1).
Rows = tuple[NDArray[np.int64], Array, Array]
# Metric, length (mm), inverse of the correlation between stations (s, s), log determinant of the correlation.
Correlation = tuple[str, float, Array, float]


class Sums:
    """Readings of several kinds summed per station, for any noise."""

    def __init__(self, rows: dict[str, Rows], count: int) -> None:
        self.count = count
        self.n = {kind: len(at) for kind, (at, _, _) in rows.items()}
        self.zz, self.zj, self.jj = {}, {}, {}
        for kind, (at, z, j) in rows.items():
            self.zz[kind] = _by_station(at, z, z, count)
            self.zj[kind] = _by_station(at, z, j, count).reshape(3 * count, -1)
            self.jj[kind] = j.T @ j

    def solve(self, sigma: dict[str, float], pose_mm: float, inverse: Array) -> tuple[Array, Array, float]:
        """Return the normal matrix, the stations' errors and a log determinant.

        normal (p + 1, p + 1): of unknown and residual. errors (3 s, p + 1): of the stations, per unit of each column. The
        log determinant is that of the readings' covariance but for the correlation's. inverse (s, s): of the correlation.
        """
        count = self.count
        precision = np.zeros((count, 3, count, 3))
        axis, at = np.arange(3), np.arange(count)
        precision[:, axis, :, axis] = inverse / pose_mm**2
        precision[at, :, at, :] += sum(self.zz[k] / sigma[k] ** 2 for k in self.zz)
        shared = sum(self.zj[k] / sigma[k] ** 2 for k in self.zj)
        factor = cholesky(precision.reshape(3 * count, 3 * count), lower=True, check_finite=False)
        half = solve_triangular(factor, shared, lower=True, check_finite=False)
        normal = sum(self.jj[k] / sigma[k] ** 2 for k in self.jj) - half.T @ half
        log_det = 2.0 * float(np.log(np.diag(factor)).sum()) + 6.0 * count * np.log(pose_mm)
        log_det += 2.0 * sum(n * np.log(sigma[k]) for k, n in self.n.items())
        errors = solve_triangular(factor, half, lower=True, trans="T", check_finite=False)
        return np.asarray(normal), np.asarray(errors), log_det


def fit_noise(sums: Sums, prior: Array, at: Stations, start: Noise, anew: bool = True) -> Noise:
    """Return the noise that makes the residuals most likely.

    Restricted likelihood: Patterson, Thompson, Biometrika 58, 1971, doi:10.1093/biomet/58.3.545.
    prior (p + 1, p + 1): information on the unknown (and its residual) beside the readings.
    anew: choose metric and length too, not only how large the noise is.
    """
    kinds = list(sums.n)
    values = np.log([*(_sigma(start, kind) for kind in kinds), start.pose_mm])
    low, high = np.log([*(FLOOR[kind] for kind in kinds), FLOOR["pose"]]), np.full(len(values), np.log(CEILING))

    def cost(v: Array, correlation: Correlation) -> float:
        sigma = dict(zip(kinds, np.exp(v[:-1]), strict=True))
        normal, _, own = sums.solve(sigma, float(np.exp(v[-1])), correlation[2])
        full = normal + prior
        try:
            factor = cholesky(full[:-1, :-1], lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            return IMPOSSIBLE  # so little noise that differences of large sums are all rounding
        part = solve_triangular(factor, full[:-1, -1], lower=True, check_finite=False)
        return float(own + 3.0 * correlation[3] + 2.0 * np.log(np.diag(factor)).sum() + full[-1, -1] - part @ part)

    def settle(v: Array, correlation: Correlation) -> Array:
        bounds = list(zip(low, high, strict=True))
        options = {"maxiter": 30, "ftol": 1e-8}
        found = minimize(cost, np.clip(v, low, high), (correlation,), method="L-BFGS-B", bounds=bounds, options=options)
        return np.asarray(found.x)

    correlation = _correlation_of(at, start.metric, start.length_mm)
    values = settle(values, correlation)
    if not anew:
        return _noise(kinds, values, correlation, at, start)
    tried = []
    for correlation in _correlations(at):
        # What the robot adds goes with how it is correlated; the rest hardly does, until the last round.
        found = minimize_scalar(
            lambda p, c=correlation: cost(np.r_[values[:-1], p], c),
            bounds=(low[-1], high[-1]),
            method="bounded",
            options=COARSE,
        )
        tried.append((float(found.fun), float(found.x), correlation))
    best, pose, correlation = min(tried, key=lambda t: t[0])
    values = settle(np.r_[values[:-1], pose], correlation)
    found = _noise(kinds, values, correlation, at, start)
    others = [
        (float(np.exp((best - c) / 2.0)), _noise(kinds, np.r_[values[:-1], p], k, at, start)) for c, p, k in tried
    ]
    return replace(found, rivals=tuple((w, n) for w, n in others if w > UNLIKELY))


def _noise(kinds: list[str], values: Array, correlation: Correlation, at: Stations, start: Noise) -> Noise:
    by = dict(zip((*kinds, "pose"), np.exp(values), strict=True))
    metric, length = correlation[:2]
    independent = len(at) ** 2 / float((np.exp(-at.apart[metric] / length) ** 2).sum())
    level = float(by.get("level", start.level_db))
    return Noise(float(by["distance"]), level, float(by["pose"]), length, metric, independent)


def correlation_inverse(at: Stations, noise: Noise) -> Array:
    """Return the inverse correlation (s, s) of the robot's errors between stations."""
    return np.asarray(np.linalg.inv(_correlation(at.apart[noise.metric], noise.length_mm)))


def _correlation(apart: Array, length_mm: float) -> Array:
    return np.exp(-apart / length_mm) + 1e-9 * np.eye(len(apart))


def _correlations(at: Stations) -> Iterator[Correlation]:
    return (_correlation_of(at, metric, length) for metric in at.apart for length in LENGTHS_MM)


def _correlation_of(at: Stations, metric: str, length_mm: float) -> Correlation:
    k = _correlation(at.apart[metric], length_mm)
    return metric, length_mm, np.asarray(np.linalg.inv(k)), float(np.linalg.slogdet(k)[1])


def _sigma(noise: Noise, kind: str) -> float:
    return noise.distance_mm if kind == "distance" else noise.level_db


def _by_station(at: NDArray[np.int64], left: Array, right: Array, count: int) -> Array:
    """Return sums over each station's readings of left (n, 3) times right (n, q), (s, 3, q)."""
    products = (left[:, :, None] * right[:, None, :]).reshape(len(left), -1)
    order = np.argsort(at, kind="stable")
    out = np.zeros((count, products.shape[1]))
    if len(at):
        sorted_at = at[order]
        first = np.flatnonzero(np.r_[True, np.diff(sorted_at) > 0])
        out[sorted_at[first]] = np.add.reduceat(products[order], first, axis=0)
    return out.reshape(count, left.shape[1], -1)
