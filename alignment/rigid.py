"""Best rigid transform between paired points. Proper rotations only: a part is never a mirror image of itself."""

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import fail
from planner.frames import Array

# Second singular value of the centred points over the first below which they lie on one line.
COLLINEAR = 1e-6


def fit_rigid(source: ArrayLike, target: ArrayLike, weights: ArrayLike | None = None) -> tuple[Array, Array]:
    """Return (R, t) that minimise sum w |R source + t - target|^2; R is (3, 3), t (3,) in the unit of the points.

    source, target: (n, 3), row i of one belongs to row i of the other; weights (n,), not negative, default 1.
    K. S. Arun, T. S. Huang, S. D. Blostein, "Least-squares fitting of two 3-D point sets", IEEE PAMI 9 (1987) 698,
    doi:10.1109/TPAMI.1987.4767965; det(R) = +1 always (S. Umeyama, IEEE PAMI 13 (1991) 376, doi:10.1109/34.88573).
    Raises EchoBaseError where the rotation is not defined: fewer than three points, or points on one line.
    """
    p, q = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    w = np.ones(len(p)) if weights is None else np.asarray(weights, dtype=np.float64)
    if p.shape != q.shape or p.ndim != 2 or p.shape[1] != 3 or w.shape != (len(p),):
        raise ValueError("source and target must both be (n, 3) and weights (n,)")
    if not (np.isfinite(p).all() and np.isfinite(q).all() and np.isfinite(w).all() and (w >= 0).all()):
        raise ValueError("points must be finite and weights finite and not negative")
    used = int(np.count_nonzero(w))
    if used < 3:
        raise fail("points-too-few", f"{used} point pairs, but a rigid transform needs three.", "Give more points.")
    p_mean, q_mean = np.average(p, axis=0, weights=w), np.average(q, axis=0, weights=w)
    p0, q0 = p - p_mean, q - q_mean
    root = np.sqrt(w)[:, None]
    for points in (p0, q0):
        s = np.linalg.svd(root * points, compute_uv=False)
        if s[1] <= COLLINEAR * max(s[0], 1e-300):
            raise fail(
                "points-collinear",
                "the points lie on one line, and the turn about that line is not defined.",
                "Give points that span a plane.",
            )
    u, _, vt = np.linalg.svd((w[:, None] * p0).T @ q0)
    sign = np.sign(np.linalg.det(vt.T @ u.T))
    r = vt.T @ np.diag([1.0, 1.0, sign]) @ u.T
    return r, q_mean - r @ p_mean
