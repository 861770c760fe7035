"""Serial parts on one fixture and the corrections their scans would give: a linear Gaussian world, by the book."""

import numpy as np
from scipy.spatial.transform import Rotation

CENTRE = np.array([180.0, -40.0, 60.0])
PRIOR = np.r_[np.full(3, np.radians(0.5)), np.full(3, 2.0)]
# A scan that crosses edges (turns in rad, shifts in mm, one sigma), and one of a flat face alone: x, y and rz unseen.
EDGES = np.r_[np.full(3, np.radians(0.004)), [0.02, 0.02, 0.01]]
FLAT = np.r_[np.radians([0.004, 0.004, np.inf]), [np.inf, np.inf, 0.01]]


def placement(x):
    """T_base_basecorr (4, 4) of a motion: turn by a rotation vector, and the centroid moved."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(x[:3]).as_matrix()
    T[:3, 3] = CENTRE + x[3:] - T[:3, :3] @ CENTRE
    return T


def six(T):
    abc = Rotation.from_matrix(T[:3, :3]).as_euler("ZYX", degrees=True)
    keys = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
    return dict(zip(keys, [*T[:3, 3].tolist(), *abc.tolist()], strict=True))


def correction(x_true, scan_sigma, rng, turn=None, prior=PRIOR) -> dict:
    """Return correction.json of a part at x_true (6,): posterior of a scan with scan_sigma (6,), held by the rule of DESIGN.

    turn (3, 3): the axes along which the scan has these sigmas.
    """
    axes = np.kron(np.eye(2), np.eye(3) if turn is None else turn)
    keep = np.isfinite(scan_sigma)
    H, sigma = axes.T[keep] * prior, scan_sigma[keep]
    seen = H @ (x_true / prior) + sigma * rng.standard_normal(len(sigma))
    information = np.eye(6) + (H / sigma[:, None] ** 2).T @ H
    covariance = np.linalg.inv(information)
    value, u = np.linalg.eigh(covariance)
    held = np.sqrt(value) > 0.5
    found = (
        u[:, ~held]
        @ np.linalg.inv(u[:, ~held].T @ information @ u[:, ~held])
        @ u[:, ~held].T
        @ (H.T @ (seen / sigma**2))
    )
    sigma_of = np.where(held, 1.0, np.sqrt(value))
    T = placement(found * prior)
    return {
        "method": "map",
        "verdict": "pass",
        "correction": six(T),
        "centroid_mm": (T[:3, :3] @ CENTRE + T[:3, 3]).tolist(),
        "covariance": ((u * sigma_of**2) @ u.T * np.outer(prior, prior)).tolist(),
        "directions": [
            {"status": "held" if h else "measured", "sigma": float(s), "vector": (v * prior).tolist()}
            for h, s, v in zip(held, sigma_of, u.T, strict=True)
        ],
        "inputs": {"plan_sha256": "p", "scan_sha256": ["s"], "part_sha256": "", "version": ""},
    }
