"""TCP offset and tilt from a fixed plane seen from several poses."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from alignment.calibrate.passes import pass_starts
from alignment.calibrate.result import Calibration
from alignment.calibrate.stations import stretches
from alignment.calibrate.tcp_poses import PlaneViews, plane_views
from alignment.calibrate.tcp_result import PRIOR, split_held, tcp_estimates, tcp_patch
from alignment.scan import Scan
from planner.errors import fail
from planner.frames import Array
from planner.setup import Setup

ADVICE = {
    "a": "Tilt the probe about its array axis in more poses.",
    "b": "Turn the probe about the beam by 180 deg in some poses.",
    "c": "Record amplitudes with the probe tilted about its array axis: distances alone do not show this turn.",
    "x": "Tilt farther, to both sides, about y.",
    "y": "Tilt farther, to both sides, about x.",
    "z": "A plane shows the length of the tool hardly at all: use a sphere of known radius, or a known gap.",
}
NOISE_ROUNDS = 5
OUTLIER_SIGMAS = 4.5


def calibrate_tcp(scan: Scan, setup: Setup) -> Calibration:
    """Return the correction of `tool.tcp` that makes all poses see one plane, and the setup patch that applies it.

    Unknown: the plane (two tilts, height) and the TCP's error in its own axes: turns about x, y, z (named c, b, a) and
    shifts x, y, z. Seen per pose: distance of the array's middle (perpendicular to the plane), its slope along the array,
    and, if amplitudes are there, their loss with the tilt of the beam (k_b, k_c of the setup). The scatter of each kind is
    estimated from the data with its share of the degrees of freedom. A direction whose posterior sigma stays above half of
    the prior (1.5 deg, 2 mm) is held. Raises EchoBaseError `tcp-readings`.
    """
    views = plane_views(scan, setup)
    problem = _Problem(views, setup)
    basis = np.eye(6)
    solution, covariance, dof, rms = problem.solve(basis)
    kept, held = split_held(covariance)
    if kept.shape[1] == 0:
        raise fail(
            "tcp-readings",
            "These poses show nothing of the TCP.",
            "Tilt the probe both ways by 2 deg or more about x and y, and turn it about the beam by 90 and 180 deg.",
            scan.name,
        )
    if held.shape[1]:
        basis = PRIOR[:, None] * kept
        solution, covariance, dof, rms = problem.solve(basis)
    estimates, issues = tcp_estimates(solution, covariance, held, dof, ADVICE)
    curves = {
        "distance_mm": views.middle_mm,
        "slope": views.slope,
        "level_db": views.level_db,
        "pose": views.pose.astype(np.float64),
        "pass_start": pass_starts(scan, views.pose),
        **problem.left_over(),
    }
    return Calibration("tcp", estimates, tcp_patch(solution, setup), len(scan), rms, "mm", tuple(issues), curves)


class _Problem:
    """Residuals of m views, by kind: distance, slope, level; and the prior of the TCP's error."""

    def __init__(self, views: PlaneViews, setup: Setup) -> None:
        self.views, self.loss = views, setup.probe.tilt_loss_db_per_deg2
        self.offset = setup.probe.face_offset_mm
        self.rotation, self.origin = views.Ts_base_tcp.rotation_matrix, views.Ts_base_tcp.xyz_mm
        self.shared = stretches(self.rotation, self.origin)
        self.centre = self.origin.mean(axis=0)
        beam = self.rotation[:, :, 2].mean(axis=0)
        self.normal = -beam / np.linalg.norm(beam)
        self.tangent = np.linalg.svd(self.normal[None])[2][1:]
        reach = (self.origin - self.centre) @ self.normal - views.middle_mm
        self.height = float(np.median(reach))
        self.kinds = [np.isfinite(v) for v in (views.middle_mm, views.slope, views.level_db)]
        if np.ptp(views.level_db[self.kinds[2]]) < 1e-6 if self.kinds[2].any() else False:
            self.kinds[2] = np.zeros_like(self.kinds[2])
        self.parts: tuple[Array, ...] = ()
        self.used = self.kinds

    def residuals(self, unknown: Array, basis: Array) -> tuple[Array, ...]:
        """Return (distance, slope, level) residuals of all views; unknown = plane tilt 2, height, level, TCP error."""
        error = basis @ unknown[4:]
        normal = self.normal + unknown[:2] @ self.tangent
        normal = normal / np.linalg.norm(normal)
        turn = Rotation.from_rotvec(error[:3]).as_matrix()
        seen = np.einsum("mij,i->mj", self.rotation, normal)
        middle = error[3:] - self.offset * turn[:, 2]
        distance = (self.origin - self.centre) @ normal + seen @ middle - self.height - unknown[2]
        true = seen @ turn
        tilt_b, tilt_c = (np.degrees(np.arcsin(np.clip(true[:, i], -1, 1))) for i in (0, 1))
        level = unknown[3] - self.loss.b * tilt_b**2 - self.loss.c * tilt_c**2
        v = self.views
        return v.middle_mm - distance, v.slope - true[:, 0], v.level_db - level

    def left_over(self) -> dict[str, Array]:
        """Return what the last solution leaves of each kind (m,), NaN where a view has none: residual_<unit>, used_<unit>."""
        out = {}
        units = (("mm", 1.0), ("deg", 180.0 / np.pi), ("db", 1.0))
        for (unit, scale), part, kind, used in zip(units, self.parts, self.kinds, self.used, strict=True):
            if kind.any():
                out[f"residual_{unit}"] = np.where(kind, scale * part, np.nan)
                out[f"used_{unit}"] = used.astype(np.float64)
        return out

    def solve(self, basis: Array) -> tuple[Array, Array, float, float]:
        """Return TCP error (6,), its covariance, degrees of freedom of the scarcest kind, rms of the distances."""
        kinds = [k.copy() for k in self.kinds]
        sigma = [0.05, 0.003, 0.3]
        unknown = np.zeros(4 + basis.shape[1])
        unknown[3] = np.nanmax(self.views.level_db) if kinds[2].any() else 0.0
        prior = np.zeros((basis.shape[1], len(unknown)))
        prior[:, 4:] = np.eye(basis.shape[1]) if basis.shape[1] < 6 else np.diag(1.0 / PRIOR)
        level = np.zeros((1, len(unknown)))
        level[0, 3] = 1e-3  # keeps the system regular without amplitudes

        def stacked(u: Array) -> Array:
            parts = self.residuals(u, basis)
            data = [p[k] / s for p, k, s in zip(parts, kinds, sigma, strict=True)]
            return np.concatenate([*data, prior @ u, level @ u])

        for _ in range(NOISE_ROUNDS):
            found = least_squares(stacked, unknown, method="lm", x_scale="jac", xtol=1e-12, ftol=1e-12)
            unknown, used_kinds = found.x, [k.copy() for k in kinds]
            covariance = np.linalg.inv(found.jac.T @ found.jac)
            leverage = np.einsum("ij,jk,ik->i", found.jac, covariance, found.jac)
            parts, start, free = self.residuals(unknown, basis), 0, []
            for g, part in enumerate(parts):
                n = int(kinds[g].sum())
                used = float(leverage[start : start + n].sum())
                start += n
                if n == 0:
                    continue
                free.append(max(n - used, 1.0))
                sigma[g] = max(float(np.sqrt((part[kinds[g]] ** 2).sum() / free[-1])), 1e-9)
                # From the kinds as recorded, so that a view is not lost for good to a bad first round.
                kinds[g] = self.kinds[g] & (np.abs(np.nan_to_num(part, nan=np.inf)) < OUTLIER_SIGMAS * sigma[g])
        shared = np.concatenate([self.shared[k] for k in used_kinds])
        covariance = _by_stretch(found.jac, found.fun, shared, covariance)
        block = basis @ covariance[4:, 4:] @ basis.T
        rms = float(np.sqrt(np.mean(parts[0][kinds[0]] ** 2)))
        self.parts, self.used = parts, kinds
        return basis @ unknown[4:], block, min(*free, max(len(np.unique(shared)) - len(unknown), 2)), rms


def _by_stretch(jacobian: Array, residual: Array, shared: NDArray[np.int64], covariance: Array) -> Array:
    """Return the covariance that holds when what one stretch of the way says is correlated: the robot's error enters all of it.

    shared (n,): the stretch of each of the first n rows; the rows below the data are the prior, which counts as it is.
    Sandwich over stretches with each residual freed of its own leverage (jackknife form, MacKinnon and White, J.
    Econometrics 29, 1985, doi:10.1016/0304-4076(85)90158-7).
    """
    n = len(shared)
    prior = jacobian[n:]
    middle = prior.T @ prior
    for i in np.unique(shared):
        rows = np.flatnonzero(shared == i)
        j = jacobian[rows]
        # (I - J C J')^-1 r by Woodbury, small however many rows: J' of it is (I - J'J C)^-1 J' r.
        score = np.linalg.solve(np.eye(len(covariance)) - j.T @ j @ covariance, j.T @ residual[rows])
        middle = middle + np.outer(score, score)
    return np.asarray(covariance @ middle @ covariance)
