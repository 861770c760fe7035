"""Nominal BASE from touched points: where `$BASE` must lie for the CAD points to be where the spike found them."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy.spatial.transform import Rotation

from planner.errors import fail
from planner.frames import Array, Transform
from planner.issues import Issue

MIN_PAIRS = 3
# Points whose spread across their best line is below this share of their length fix the turn about that line badly,
# or (below the second share) not at all.
THIN_SHARE = 0.1
LINE_SHARE = 0.01
# A residual beyond this (mm) is said: a spike driven by hand finds a point to a few tenths of a mm.
SUSPECT_MM = 1.0
# Up to this many pairs every order of the touched points is tried when they do not fit: 720 fits at most.
MAX_REORDER = 6


@dataclass(frozen=True, eq=False)
class BaseFit:
    """`T_world_base` and how well n pairs agree with it.

    residuals_mm (n,): distance between each touched point and its CAD point in the fitted base. left_out_mm (n,): the same
    when that pair is left out of the fit, which finds a bad point that the others have hidden; NaN for three pairs.
    rms_mm: root mean square of the residuals. sigma_mm: standard deviation of one coordinate of one touch that these
    residuals speak for, with 3 n - 6 degrees of freedom.
    """

    T_world_base: Transform
    residuals_mm: Array
    left_out_mm: Array
    rms_mm: float
    sigma_mm: float
    issues: tuple[Issue, ...] = ()


def fit_base(cad_points_partnom: Array, touched_world: Array, T_base_partnom: Transform) -> BaseFit:
    """Return the base that carries n >= 3 CAD points (n, 3), `partnom`, mm, onto their touched points (n, 3), `world`.

    Least squares over proper rotations (Arun, Huang, Blostein, IEEE PAMI 9, 1987, doi:10.1109/TPAMI.1987.4767965). Raises
    EchoBaseError `base-pairs` (too few, unequal, not finite), `base-duplicate` or `base-line` (points on one line).
    """
    cad, touched = (np.asarray(p, dtype=np.float64) for p in (cad_points_partnom, touched_world))
    _check_pairs(cad, touched)
    _check_spread(cad, "CAD points")
    _check_spread(touched, "touched points")
    T_world_partnom = _rigid(cad, touched)
    residuals = np.linalg.norm(T_world_partnom.points(cad) - touched, axis=1)
    n = len(cad)
    total = float(residuals @ residuals)
    left_out = np.full(n, np.nan)
    if n > MIN_PAIRS:
        for i in range(n):
            rest = np.arange(n) != i
            if _thinness(cad[rest]) > LINE_SHARE:
                left_out[i] = np.linalg.norm(_rigid(cad[rest], touched[rest]).points(cad[i]) - touched[i])
    return BaseFit(
        T_world_partnom @ T_base_partnom.inv(),
        residuals,
        left_out,
        float(np.sqrt(total / n)),
        float(np.sqrt(total / (3 * n - 6))),
        tuple(_issues(cad, touched, residuals, left_out)),
    )


def _check_pairs(cad: Array, touched: Array) -> None:
    if cad.ndim != 2 or cad.shape != touched.shape or cad.shape[1] != 3 or len(cad) < MIN_PAIRS:
        raise fail(
            "base-pairs",
            f"BASE needs three or more pairs of a CAD point and a touched point; there are {len(cad)} CAD points and"
            f" {len(touched)} touched points.",
            "Touch at least three points that are far apart and not on one line.",
        )
    bad = np.flatnonzero(~np.isfinite(np.hstack([cad, touched])).all(axis=1))
    if len(bad):
        raise fail("base-pairs", "A coordinate is not a number.", "Type it again.", f"pair {bad[0] + 1}")


def _check_spread(points: Array, what: str) -> None:
    gap = np.linalg.norm(points[:, None] - points[None], axis=2)
    same = np.argwhere(np.triu(gap < 1e-6, k=1))
    if len(same):
        i, j = same[0] + 1
        raise fail(
            "base-duplicate",
            f"Two of the {what} are the same.",
            "Remove one pair, or touch another point.",
            f"pairs {i} and {j}",
        )
    if _thinness(points) < LINE_SHARE:
        raise fail(
            "base-line",
            f"The {what} lie on one line, so nothing fixes the turn about it.",
            "Touch a point well away from the line through the others.",
        )


def _thinness(points: Array) -> float:
    """Return the spread across the best line over the spread along it."""
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(singular[1] / singular[0]) if singular[0] > 0 else 0.0


def _rigid(source: Array, target: Array) -> Transform:
    a, b = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((target - b).T @ (source - a))
    proper = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    turn = u @ proper @ vt
    return Transform.from_parts("world", "partnom", Rotation.from_matrix(turn), b - turn @ a)


def _issues(cad: Array, touched: Array, residuals: Array, left_out: Array) -> list[Issue]:
    issues = []
    judged = np.where(np.isfinite(left_out), left_out, residuals)
    worst = int(np.argmax(judged))
    if residuals.max() > SUSPECT_MM:
        order = _better_order(cad, touched, float(np.sqrt(np.mean(residuals**2))))
        if order is None:
            remedy = "Touch it again, or check that it is the point meant on the CAD."
        else:
            remedy = f"In the order {', '.join(str(i + 1) for i in order)} the touched points fit: were some swapped?"
        size = (
            f"{judged[worst]:.2f} mm off the place the others give"
            if np.isfinite(left_out[worst])
            else (f"{residuals[worst]:.2f} mm off its fitted place")
        )
        issues.append(Issue("warning", "base-residual", f"The touched point is {size}.", remedy, f"pair {worst + 1}"))
    thin = _thinness(cad)
    if thin < THIN_SHARE:
        issues.append(
            Issue(
                "warning",
                "base-thin",
                f"The points lie nearly on one line (spread {100 * thin:.0f} % across it): the turn about it is weak.",
                "Add a point well away from that line.",
            )
        )
    return issues


def _better_order(cad: Array, touched: Array, rms_mm: float) -> tuple[int, ...] | None:
    """Return the order of the touched points that fits at least five times better, if there is one."""
    if len(cad) > MAX_REORDER:
        return None
    best, best_rms = None, rms_mm / 5.0
    for order in permutations(range(len(cad))):
        moved = touched[list(order)]
        off = _rigid(cad, moved).points(cad) - moved
        rms = float(np.sqrt((off**2).sum(axis=1).mean()))
        if rms < best_rms:
            best, best_rms = order, rms
    return best
