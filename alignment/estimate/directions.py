"""What the scan can and cannot tell: directions held, weak or measured, and the named axes they touch."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from alignment.estimate.mixture import complement
from alignment.estimate.motion import rms_displacement_mm
from planner.frames import Array
from planner.setup import Tolerances

Status = Literal["measured", "weak", "held"]
# Posterior over prior standard deviation above which the data say too little to move the part.
HELD_RATIO = 0.5
# Share of a named axis's prior that must lie in held (weak) directions to call the axis so.
ROW_SHARE = 0.25


@dataclass(frozen=True, eq=False)
class Direction:
    """One of six independent motions of the part.

    sigma: its posterior standard deviation in prior standard deviations. vector (6,): the motion (rx, ry, rz, x, y, z),
    rad and mm, about the centroid, of one prior standard deviation; the covariance is the sum of sigma^2 vector vector'.
    displacement_mm, turn_deg: what one posterior standard deviation does to the surface (rms over its area).
    """

    status: Status
    sigma: float
    vector: Array
    displacement_mm: float
    turn_deg: float
    locked: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return an entry of `directions` in correction.json."""
        return {
            "status": self.status,
            "sigma": self.sigma,
            "vector": self.vector.tolist(),
            "displacement_mm": self.displacement_mm,
            "turn_deg": self.turn_deg,
            "locked": self.locked,
        }


def held_basis(covariance: Array, lock_rows: Array) -> Array:
    """Return orthonormal directions (6, h), in prior standard deviations, that are to be held.

    covariance (6, 6): posterior whitened by the prior. lock_rows (m, 6): combinations that the user locks; they are held
    whatever the data say, and the rest is judged among what they leave.
    """
    locked = _row_space(lock_rows)
    free = complement(locked, 6)
    # Locked motions are known: condition on them (information restricted to the free ones).
    restricted = np.linalg.inv(free.T @ np.linalg.inv(covariance) @ free)
    value, vector = np.linalg.eigh(restricted)
    loose = free @ vector[:, np.sqrt(np.maximum(value, 0.0)) > HELD_RATIO]
    return np.hstack([locked, loose])


def _row_space(rows: Array) -> Array:
    if len(rows) == 0:
        return np.zeros((6, 0))
    _, s, vt = np.linalg.svd(rows / np.linalg.norm(rows, axis=1, keepdims=True), full_matrices=False)
    return np.asarray(vt[s > 1e-9].T)


def directions(
    covariance: Array, held: Array, locked: Array, prior_sigma: Array, moments_base: Array, tolerances: Tolerances
) -> tuple[Direction, ...]:
    """Return the six directions: the held ones first (locks, then loose ones), then from weak to well known.

    covariance (6, 6): posterior whitened by the prior, with held (6, h) at their prior variance. Held directions all keep
    the prior, so any basis of theirs is as good; the one nearest to single axes is shown.
    """
    out = []
    lock = _row_space(locked)
    for basis, is_lock in ((lock, True), (_simple(_without(held, lock)), False)):
        out += [_direction("held", 1.0, u * prior_sigma, moments_base, is_lock) for u in basis.T]
    free = complement(held, 6)
    value, vector = np.linalg.eigh(free.T @ covariance @ free)
    for lam, v in zip(value[::-1], vector.T[::-1], strict=True):
        u = free @ v
        sigma = float(np.sqrt(max(lam, 0.0)))
        found = _direction("measured", sigma, u * prior_sigma, moments_base, False)
        if found.displacement_mm > tolerances.position_mm or found.turn_deg > tolerances.angle_deg:
            found = _direction("weak", sigma, u * prior_sigma, moments_base, False)
        out.append(found)
    return tuple(out)


def _direction(status: Status, sigma: float, vector: Array, moments_base: Array, locked: bool) -> Direction:
    vector = vector * (1.0 if vector[np.argmax(np.abs(vector / _scale(vector)))] >= 0 else -1.0)
    turn = float(np.degrees(np.linalg.norm(sigma * vector[:3])))
    return Direction(status, sigma, vector, rms_displacement_mm(sigma * vector, moments_base), turn, locked)


def _scale(vector: Array) -> Array:
    return np.repeat([max(float(np.abs(vector[:3]).max()), 1e-30), max(float(np.abs(vector[3:]).max()), 1e-30)], 3)


def _without(held: Array, locked: Array) -> Array:
    """Return an orthonormal basis of what is held but not locked."""
    if locked.shape[1] == 0:
        return held
    rest = held - locked @ (locked.T @ held)
    u, s, _ = np.linalg.svd(rest, full_matrices=False)
    return np.asarray(u[:, s > 1e-6])


def _simple(basis: Array) -> Array:
    """Return the same span with columns turned towards single axes (varimax, H. F. Kaiser, Psychometrika 23 (1958) 187)."""
    h = basis.shape[1]
    if h < 2:
        return basis
    turn = np.eye(h)
    for _ in range(200):
        b = basis @ turn
        u, _, vt = np.linalg.svd(basis.T @ (b**3 - b * (b**2).mean(axis=0)))
        new = u @ vt
        if np.abs(new - turn).max() < 1e-12:
            break
        turn = new
    out = basis @ turn
    return np.asarray(out[:, np.argsort(np.argmax(np.abs(out), axis=0), kind="stable")])


def named_statuses(found: tuple[Direction, ...], axes_of_xi: Array, prior_sigma: Array) -> tuple[Status, ...]:
    """Return the status of x, y, z, a, b, c. axes_of_xi (6, 6): change of these per xi (rad, mm) about the centroid.

    An axis is held if the norm of its row of the held directions, mapped to the axes about the BASE origin and divided by
    that axis's prior sigma, exceeds 0.25; the same for weak.
    """
    prior = np.sqrt(((axes_of_xi * prior_sigma) ** 2).sum(axis=1))
    shares = {}
    for status in ("held", "weak"):
        columns = [d.vector for d in found if d.status == status]
        mapped = axes_of_xi @ np.array(columns).T if columns else np.zeros((6, 0))
        shares[status] = np.linalg.norm(mapped, axis=1) / prior
    return tuple(
        "held" if h > ROW_SHARE else "weak" if w > ROW_SHARE else "measured"
        for h, w in zip(shares["held"], shares["weak"], strict=True)
    )
