"""TCP offset and tilt from a fixed sphere passed over from several directions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from alignment.calibrate.passes import pass_starts
from alignment.calibrate.pose_noise import Noise, Rows, Sums, correlation, fit_noise
from alignment.calibrate.result import Calibration, Estimate, factor_95
from alignment.calibrate.sphere_model import CENTRE, LEVEL, LOSS, RADIUS, SLOPE, TCP, UNKNOWNS, Seen, SphereViews, see
from alignment.calibrate.sphere_search import on_sphere
from alignment.calibrate.sphere_views import MIN_READINGS, first_look, sphere_views
from alignment.calibrate.stations import stations
from alignment.calibrate.tcp_result import PRIOR, split_held, tcp_estimates, tcp_patch
from alignment.scan import Scan
from planner.errors import fail
from planner.frames import Array
from planner.issues import Issue
from planner.setup import Setup

ADVICE = {
    "a": "Pass over the sphere beside its middle too, with the array along the pass and across it.",
    "b": "Turn the tool by 180 deg about the beam between passes, and record amplitudes.",
    "c": "Record amplitudes, and pass over the sphere at two standoffs that differ by 5 mm or more.",
    "x": "Turn the tool by 90 and 180 deg about the beam between passes.",
    "y": "Turn the tool by 90 and 180 deg about the beam between passes.",
    "z": "State the radius of the sphere (--radius-mm), and look at it from directions 40 deg and more apart.",
}
# A calibration ball is known to this (mm); one whose radius nobody stated, to nothing that would help.
RADIUS_SIGMA_MM, NO_RADIUS_SIGMA_MM = 0.01, 20.0
SLOPE_SIGMA_DB_MM = 0.5
LOSS_SIGMA = 0.7
# Echoes count down to this predicted loss: distances (below, side lobes answer), levels (below, the curve is no parabola).
DISTANCE_DB, LEVEL_DB = 18.0, 12.0
OUTLIER_SIGMAS = 4.5
ROUNDS, NOISE_ROUNDS = 6, (0, 1, 2)


def calibrate_tcp_sphere(scan: Scan, setup: Setup, radius_mm: float | None = None) -> Calibration:
    """Return the correction of `tool.tcp` that makes all poses see one sphere, and the setup patch that applies it.

    Unknown: centre and radius of the sphere (the radius stated to 0.01 mm, or found), the TCP's error in its own axes
    (turns about x, y, z, named c, b, a; shifts x, y, z), and, if amplitudes are there, their level, its change with
    distance and both tilt losses. Speed of sound and delay stay as in the setup. Each pose is off by an error of its own
    that fades over a length found from the data. A direction whose posterior sigma stays above half of the prior (1.5 deg,
    2 mm) is held. Raises EchoBaseError `tcp-readings`.
    """
    views, about = on_sphere(sphere_views(scan, setup), radius_mm, scan.name)
    fit = _Fit(views, radius_mm, about, scan.name)
    covariance = fit.solve(np.eye(6))
    kept, held = split_held(covariance[TCP, TCP])
    if kept.shape[1] == 0:
        raise fail("tcp-readings", "These poses show nothing of the TCP.", ADVICE["x"] + " " + ADVICE["c"], scan.name)
    radius = _radius(fit, covariance, radius_mm)
    if held.shape[1]:
        covariance = fit.solve(kept, (1,))
    dof = max(fit.noise.independent - kept.shape[1], 2.0)
    error = fit.unknown[TCP]
    estimates, issues = tcp_estimates(error, covariance[TCP, TCP], held, dof, ADVICE)
    estimates["radius"] = radius
    if radius_mm is not None and estimates["z"].status != "held":
        text = "Z rests on the stated radius and on the couplant of the setup: 0.1 % of its speed is worth 0.015 mm at 15 mm."
        issues.append(Issue("info", "tcp-z-rests-on", text, "Calibrate the couplant first.", "z"))
    seen = see(views, fit.unknown, fit.at_mm)
    off = views.distance_mm - seen.distance_mm
    pose = views.pose_of_scan[views.pose]
    curves = {
        "pose": pose.astype(np.float64),
        "pass_start": pass_starts(scan, np.unique(pose)),
        "law_x_mm": views.law_tcp[:, 0],
        "residual_mm": off,
        "used_mm": fit.use["distance"].astype(np.float64),
    }
    if fit.levels.any():
        curves["residual_db"] = views.level_db - seen.level_db
        curves["used_db"] = fit.use["level"].astype(np.float64)
    rms = float(np.sqrt(np.mean(off[fit.use["distance"]] ** 2)))
    patch = tcp_patch(error, setup)
    return Calibration("tcp", estimates, patch, int(fit.use["distance"].sum()), rms, "mm", tuple(issues), curves)


def _radius(fit: "_Fit", covariance: Array, stated: float | None) -> Estimate:
    sigma = float(np.sqrt(covariance[RADIUS, RADIUS]))
    half = sigma * factor_95(max(fit.noise.independent - 6.0, 2.0))
    if stated is not None:
        return Estimate(stated, RADIUS_SIGMA_MM, 1.96 * RADIUS_SIGMA_MM, "mm", "held")
    return Estimate(float(fit.unknown[RADIUS]), sigma, half, "mm", "measured" if sigma < 0.1 else "weak")


@dataclass(eq=False)
class _Fit:
    """Gauss-Newton steps over all readings, with outliers left out and the noise found along the way."""

    views: SphereViews
    radius_mm: float | None
    about: tuple[float, Array]
    name: str

    def __post_init__(self) -> None:
        views, known = self.views, self.radius_mm is not None
        self.prior_sigma = np.full(UNKNOWNS, np.inf)
        self.prior_sigma[RADIUS] = RADIUS_SIGMA_MM if known else NO_RADIUS_SIGMA_MM
        self.prior_sigma[SLOPE], self.prior_sigma[LOSS], self.prior_sigma[TCP] = SLOPE_SIGMA_DB_MM, LOSS_SIGMA, PRIOR
        self.at_mm = float(np.median(views.distance_mm))
        self.believed = first_look(views, self.about, self.prior_sigma, self.at_mm)
        self.unknown = self.believed.copy()
        self.believed[LOSS], self.believed[SLOPE], self.believed[TCP] = 0.0, 0.0, 0.0
        if known:
            self.believed[RADIUS] = self.radius_mm
        self.levels = np.isfinite(views.level_db)
        self.few, self.many = stations(views.rotation, views.origin_base)
        self.noise = Noise(0.02, 0.3, 0.03, 10.0, "path", float(len(self.few)))
        self.use = self._first_use()

    def _first_use(self) -> dict[str, NDArray[np.bool_]]:
        """Choose readings by the first look; start the level from them."""
        views, seen = self.views, see(self.views, self.unknown, self.at_mm)
        off = views.distance_mm - seen.distance_mm
        scale = max(1.4826 * float(np.median(np.abs(off))), 0.03)
        near = np.abs(off) < 5.0 * scale
        levels = near & self.levels & (seen.loss_db < LEVEL_DB)
        if levels.any():
            self.unknown[LEVEL] = self.believed[LEVEL] = float(np.median((views.level_db + seen.loss_db)[levels]))
        return {"distance": near & (seen.loss_db < DISTANCE_DB), "level": levels}

    def solve(self, kept: Array, rounds: tuple[int, ...] = NOISE_ROUNDS) -> Array:
        """Move the unknown to the best fit; return its covariance (14, 14).

        kept (6, k): directions of the TCP not held. rounds: those in which the noise is found anew.
        """
        tcp = np.diag(PRIOR) @ kept
        basis = np.zeros((UNKNOWNS, TCP.start + kept.shape[1]))
        basis[: TCP.start, : TCP.start] = np.eye(TCP.start)
        basis[TCP, TCP.start :] = tcp
        self.unknown[TCP] = tcp @ (kept.T @ (self.unknown[TCP] / PRIOR))
        information = np.r_[self.prior_sigma[: TCP.start] ** -2.0, np.ones(kept.shape[1])]
        # Without amplitudes nothing shows level and losses; a belief keeps the system regular.
        information[LEVEL] = 1e-6
        information[CENTRE] = 1e-6
        covariance = np.eye(len(information))
        for round_ in range(ROUNDS):
            if self.use["distance"].sum() < MIN_READINGS:
                raise fail(
                    "tcp-readings", "The readings are not those of one sphere.", "Check target and radius.", self.name
                )
            seen = see(self.views, self.unknown, self.at_mm)
            offset = np.r_[(self.believed - self.unknown)[: TCP.start], -(kept.T @ (self.unknown[TCP] / PRIOR))]
            prior = np.zeros((len(offset) + 1, len(offset) + 1))
            prior[:-1, :-1] = np.diag(information)
            prior[:-1, -1] = prior[-1, :-1] = information * offset
            prior[-1, -1] = offset @ (information * offset)
            rows = self._rows(seen, basis)
            used = {k: (s[u], z[u], j[u]) for k, (s, z, j) in rows.items() if (u := self.use[k]).any()}
            sums = Sums(used, self.few), Sums(used, self.many)
            if round_ in rounds:
                self.noise = fit_noise(*sums, prior, self.noise, anew=round_ == rounds[-1])
            step, covariance, errors = self._step(sums, prior, self.noise)
            if round_ == ROUNDS - 1:
                covariance = self._mixed(sums, prior, step)
            self.unknown = self.unknown + basis @ step
            self._choose(seen, rows, step, errors)
        return np.asarray(basis @ covariance @ basis.T)

    def _step(self, sums: tuple[Sums, Sums], prior: Array, noise: Noise) -> tuple[Array, Array, Array]:
        """Return the step (p,), its covariance (p, p) and the poses' errors per column (m, 3, p + 1).

        sums: over few stations, and over many.
        """
        sigma = {"distance": noise.distance_mm, "level": noise.level_db}
        of = sums[0] if noise.metric == "space" else sums[1]
        normal, errors, _ = of.solve(sigma, noise.pose_mm, correlation(of.at, noise.metric, noise.length_mm))
        factor = cho_factor((normal + prior)[:-1, :-1])
        errors = errors.reshape(of.count, 3, -1)[of.at.of_pose]
        return cho_solve(factor, (normal + prior)[:-1, -1]), cho_solve(factor, np.eye(len(normal) - 1)), errors

    def _mixed(self, sums: tuple[Sums, Sums], prior: Array, step: Array) -> Array:
        """Return the covariance (p, p) about a step, over what the noise may be: how it is correlated is a guess, too."""
        total, weights = np.zeros((len(step), len(step))), 0.0
        for weight, noise in self.noise.rivals:
            other, covariance, _ = self._step(sums, prior, noise)
            total += weight * (covariance + np.outer(other - step, other - step))
            weights += weight
        return total / weights

    def _rows(self, seen: Seen, basis: Array) -> dict[str, Rows]:
        """By kind: pose, derivatives by the pose's error, derivatives by the unknown beside the residual."""
        kinds = {
            "distance": (seen.d_distance, self.views.distance_mm - seen.distance_mm),
            "level": (seen.d_level, np.nan_to_num(self.views.level_db) - seen.level_db),
        }
        return {k: (self.views.pose, -d[:, CENTRE], np.column_stack([d @ basis, off])) for k, (d, off) in kinds.items()}

    def _choose(self, seen: Seen, rows: dict[str, Rows], step: Array, errors: Array) -> None:
        """Leave out what neither the sphere nor its pose's error explains."""
        of_pose = errors[..., -1] - errors[..., :-1] @ step
        limit = {"distance": DISTANCE_DB, "level": LEVEL_DB}
        sigma = {"distance": self.noise.distance_mm, "level": self.noise.level_db}
        for kind, (pose, z, j) in rows.items():
            left = j[:, -1] - j[:, :-1] @ step - np.einsum("ni,ni->n", z, of_pose[pose])
            self.use[kind] = (np.abs(left) < OUTLIER_SIGMAS * sigma[kind]) & (seen.loss_db < limit[kind])
        self.use["level"] = self.use["level"] & self.levels & self.use["distance"]
