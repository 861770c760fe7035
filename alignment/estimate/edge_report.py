"""What the crossings of edges say about a placement."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from alignment.estimate.system import System, nuisance_columns
from planner.frames import Array, Transform

# No robot and no beam leaves the ends of passes this far (rms of their medians, mm) off the edges of a part that is as its CAD.
OFF_EDGES_MM = 0.5
# With fewer of the crossings on their edges than this, something is wrong with more than a few.
LEAST_AGREE, LEAST_CROSSINGS = 0.7, 20


def edge_report(system: System, T_base_part: Transform, nuisance: Array, covariance: Array) -> dict[str, Any] | None:
    """Return crossings and those used, how far these lie off, and bias and lag with their sigmas; None without any.

    rms_mm: of single crossings, as they count; off_mm: of the medians of the ends of passes.
    nuisance (3,): bias, lag and tilt loss, in their sigmas. covariance (9, 9): of the motion and of them. `late_mm` is what
    bias and lag come to together: known even where every edge was crossed outwards and they cannot be told apart.
    """
    edges = system.edges
    if edges is None:
        return None
    to_mm = np.array([edges.bias_sigma_mm, edges.lag_sigma_mm])
    both = covariance[6:8, 6:8] * np.outer(to_mm, to_mm)
    bias, lag = nuisance[:2] * to_mm
    found, points = edges.rows(system.problem, T_base_part), edges.points.take(edges.used)
    left = (found.r + nuisance_columns(edges, found) @ nuisance)[edges.used]
    return {
        "crossings": len(edges.used),
        "used": int(edges.used.sum()),
        "rms_mm": float(np.sqrt(np.average(left**2, weights=points.weight))) if len(left) else 0.0,
        "off_mm": _off_mm(left, points.pass_id, points.along, found.lag[edges.used] > 0),
        "bias_mm": float(bias),
        "bias_sigma_mm": float(np.sqrt(both[0, 0])),
        "lag_mm": float(lag),
        "lag_sigma_mm": float(np.sqrt(both[1, 1])),
        "late_mm": float(bias + lag),
        "late_sigma_mm": float(np.sqrt(both.sum())),
    }


def off_edges(report: dict[str, Any] | None) -> bool:
    """Return whether the crossings contradict the placement."""
    return report is not None and (report["off_mm"] > OFF_EDGES_MM or few_agree(report))


def few_agree(report: dict[str, Any]) -> bool:
    """Return whether many crossings lie on no edge."""
    return bool(report["crossings"] >= LEAST_CROSSINGS and report["used"] < LEAST_AGREE * report["crossings"])


def _off_mm(left: Array, *where: NDArray) -> float:
    """Return the root mean square of the medians of residuals left (k,), mm, of each end of each pass.

    Splash and lost echoes scatter single crossings; a part that is elsewhere puts all of an end off.
    """
    if not len(left):
        return 0.0
    _, group = np.unique(np.column_stack(where), axis=0, return_inverse=True)
    medians = [float(np.median(left[group == k])) for k in range(1 + int(group.max()))]
    return float(np.sqrt(np.mean(np.square(medians))))
