"""Least squares whose readings share the errors of a robot that is off by hundredths, and stays off for centimetres."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky, cholesky_banded, solve_triangular
from scipy.optimize import minimize, minimize_scalar

from alignment.calibrate.stations import Stations
from planner.frames import Array

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


# Of n readings: pose (n,), derivatives by the pose's error (n, 3), by the unknown beside the residual (n, p + 1).
Rows = tuple[NDArray[np.integer], Array, Array]


@dataclass(frozen=True, eq=False)
class Correlation:
    """How the robot's errors at s stations go together: exp(-distance / length_mm), distance by `metric`.

    inverse: of the correlation, (s, s); or of one along the way, which is Markov's, its diagonal and the one beside it,
    (2, s), the last of the second nothing.
    """

    metric: str
    length_mm: float
    inverse: Array
    log_det: float

    @property
    def along(self) -> bool:
        """Only neighbours are coupled."""
        return self.metric != "space"


class Sums:
    """Readings of several kinds summed per station, for any noise. rows: with the pose of each reading (n,)."""

    def __init__(self, rows: dict[str, Rows], at: Stations) -> None:
        self.count, self.at = len(at), at
        rows = {kind: (at.of_pose[pose], z, j) for kind, (pose, z, j) in rows.items()}
        count = self.count
        self.n = {kind: len(station) for kind, (station, _, _) in rows.items()}
        self.zz, self.zj, self.jj = {}, {}, {}
        for kind, (station, z, j) in rows.items():
            self.zz[kind] = _by_station(station, z, z, count)
            self.zj[kind] = _by_station(station, z, j, count).reshape(3 * count, -1)
            self.jj[kind] = j.T @ j

    def solve(self, sigma: dict[str, float], pose_mm: float, correlation: Correlation) -> tuple[Array, Array, float]:
        """Return the normal matrix, the stations' errors and a log determinant.

        normal (p + 1, p + 1): of unknown and residual. errors (3 s, p + 1): of the stations, per unit of each column. The
        log determinant is that of the readings' covariance but for the correlation's.
        """
        count = self.count
        own = np.sum([self.zz[k] / sigma[k] ** 2 for k in self.zz], axis=0)
        shared = np.sum([self.zj[k] / sigma[k] ** 2 for k in self.zj], axis=0)
        inverse = correlation.inverse / pose_mm**2
        if correlation.along:
            band = np.zeros((4, count, 3))
            band[0] = inverse[0][:, None] + np.einsum("sii->si", own)
            band[1, :, :2] = np.stack([own[:, 1, 0], own[:, 2, 1]], axis=1)
            band[2, :, 0] = own[:, 2, 0]
            band[3] = inverse[1][:, None]
            lower = cholesky_banded(band.reshape(4, 3 * count), lower=True, check_finite=False)
            errors, roots = cho_solve_banded((lower, True), shared, check_finite=False), lower[0]
        else:
            precision = np.zeros((count, 3, count, 3))
            axis, at = np.arange(3), np.arange(count)
            precision[:, axis, :, axis] = inverse
            precision[at, :, at, :] += own
            factor = cholesky(precision.reshape(3 * count, 3 * count), lower=True, check_finite=False)
            half = solve_triangular(factor, shared, lower=True, check_finite=False)
            errors = solve_triangular(factor, half, lower=True, trans="T", check_finite=False)
            roots = np.diag(factor)
        normal = sum(self.jj[k] / sigma[k] ** 2 for k in self.jj) - shared.T @ errors
        log_det = 2.0 * float(np.log(roots).sum()) + 6.0 * count * np.log(pose_mm)
        log_det += 2.0 * sum(n * np.log(sigma[k]) for k, n in self.n.items())
        return np.asarray(0.5 * (normal + normal.T)), np.asarray(errors), log_det


def fit_noise(few: Sums, many: Sums, prior: Array, start: Noise, anew: bool = True) -> Noise:
    """Return the noise that makes the residuals most likely.

    Restricted likelihood: Patterson, Thompson, Biometrika 58, 1971, doi:10.1093/biomet/58.3.545.
    few, many: the readings summed over few stations, on which all correlations are compared, and over many, on which those
    along the way are then followed closely. prior (p + 1, p + 1): information on the unknown (and its residual) beside the
    readings. anew: choose metric and length too, not only how large the noise is.
    """
    kinds = list(few.n)
    values = np.log([*(_sigma(start, kind) for kind in kinds), start.pose_mm])
    low, high = np.log([*(FLOOR[kind] for kind in kinds), FLOOR["pose"]]), np.full(len(values), np.log(CEILING))

    def cost(v: Array, correlation: Correlation, sums: Sums) -> float:
        sigma = dict(zip(kinds, np.exp(v[:-1]), strict=True))
        normal, _, own = sums.solve(sigma, float(np.exp(v[-1])), correlation)
        full = normal + prior
        try:
            factor = cholesky(full[:-1, :-1], lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            return IMPOSSIBLE  # so little noise that differences of large sums are all rounding
        part = solve_triangular(factor, full[:-1, -1], lower=True, check_finite=False)
        log_det = own + 3.0 * correlation.log_det + 2.0 * np.log(np.diag(factor)).sum()
        return float(log_det + full[-1, -1] - part @ part)

    def settle(v: Array, metric: str, length_mm: float) -> Array:
        sums = few if metric == "space" else many
        given = (correlation(sums.at, metric, length_mm), sums)
        bounds = list(zip(low, high, strict=True))
        options = {"maxiter": 30, "ftol": 1e-8}
        found = minimize(cost, np.clip(v, low, high), given, method="L-BFGS-B", bounds=bounds, options=options)
        return np.asarray(found.x)

    values = settle(values, start.metric, start.length_mm)
    if not anew:
        return _noise(kinds, values, start.metric, start.length_mm, few.at, start)
    tried = []
    for metric, length_mm in product(few.at.apart, LENGTHS_MM):
        # What the robot adds goes with how it is correlated; the rest hardly does, until the last round.
        k = correlation(few.at, metric, length_mm)
        found = minimize_scalar(
            lambda p, k=k: cost(np.r_[values[:-1], p], k, few), bounds=(low[-1], high[-1]), method="bounded",
            options=COARSE,
        )  # fmt: skip
        tried.append((float(found.fun), float(found.x), metric, length_mm))
    best, pose, metric, length_mm = min(tried, key=lambda t: t[0])
    values = settle(np.r_[values[:-1], pose], metric, length_mm)
    found = _noise(kinds, values, metric, length_mm, few.at, start)
    others = [
        (float(np.exp((best - c) / 2.0)), _noise(kinds, np.r_[values[:-1], p], m, ell, few.at, start))
        for c, p, m, ell in tried
    ]
    return replace(found, rivals=tuple((w, n) for w, n in others if w > UNLIKELY))


def _noise(kinds: list[str], values: Array, metric: str, length_mm: float, at: Stations, start: Noise) -> Noise:
    by = dict(zip((*kinds, "pose"), np.exp(values), strict=True))
    independent = len(at) ** 2 / float((np.exp(-at.apart[metric] / length_mm) ** 2).sum())
    level = float(by.get("level", start.level_db))
    return Noise(float(by["distance"]), level, float(by["pose"]), length_mm, metric, independent)


def correlation(at: Stations, metric: str, length_mm: float) -> Correlation:
    """Return the correlation of the robot's errors between stations, inverted."""
    if metric == "space":
        k = np.exp(-at.apart[metric] / length_mm) + 1e-9 * np.eye(len(at))
        return Correlation(metric, length_mm, np.asarray(np.linalg.inv(k)), float(np.linalg.slogdet(k)[1]))
    rho = np.exp(-at.next_mm[metric] / length_mm)
    new = -np.expm1(-2.0 * at.next_mm[metric] / length_mm)
    inverse = np.zeros((2, len(at)))
    inverse[0] = 1.0
    inverse[0, :-1] += rho**2 / new
    inverse[0, 1:] += 1.0 / new - 1.0
    inverse[1, :-1] = -rho / new
    return Correlation(metric, length_mm, inverse, float(np.log(new).sum()))


def _sigma(noise: Noise, kind: str) -> float:
    return noise.distance_mm if kind == "distance" else noise.level_db


def _by_station(at: NDArray[np.integer], left: Array, right: Array, count: int) -> Array:
    """Return sums over each station's readings of left (n, 3) times right (n, q), (s, 3, q)."""
    products = (left[:, :, None] * right[:, None, :]).reshape(len(left), -1)
    order = np.argsort(at, kind="stable")
    out = np.zeros((count, products.shape[1]))
    if len(at):
        sorted_at = at[order]
        first = np.flatnonzero(np.r_[True, np.diff(sorted_at) > 0])
        out[sorted_at[first]] = np.add.reduceat(products[order], first, axis=0)
    return out.reshape(count, left.shape[1], -1)
