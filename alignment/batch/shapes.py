"""Shapes of serial parts: the field they have in common, and what is left of each part's own."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planner.frames import Array


@dataclass(frozen=True, eq=False)
class PartShape:
    """Displacement of one part along its normals: points_part (m, 3), values_mm, sigma_mm (m,), supported (m,)."""

    name: str
    points_part: Array
    values_mm: Array
    sigma_mm: Array
    supported: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Shapes:
    """k shapes on the same m places (those of the first part), NaN where a scan does not determine it.

    values_mm (k, m). common_mm, sigma_mm (m,): the mean and its standard deviation; NaN where fewer than two parts tell.
    own_rms_mm (k,): of each part about the mean, beyond its own noise. scatter_mm: of all parts together; None with fewer
    than three.
    """

    names: tuple[str, ...]
    points_part: Array
    values_mm: Array
    common_mm: Array
    sigma_mm: Array
    own_rms_mm: Array
    scatter_mm: float | None

    def to_json(self) -> dict[str, Any]:
        """Return the figures: rms and largest of the common field, each part's own rms."""
        known = np.isfinite(self.common_mm)
        common = self.common_mm[known]
        return {
            "parts": list(self.names),
            "common_rms_mm": float(np.sqrt(np.mean(common**2))) if known.any() else None,
            "common_max_mm": float(np.abs(common).max()) if known.any() else None,
            "common_sigma_mm": float(np.sqrt(np.mean(self.sigma_mm[known] ** 2))) if known.any() else None,
            "support_share": float(known.mean()),
            "scatter_mm": self.scatter_mm,
            "own_rms_mm": [float(v) if np.isfinite(v) else None for v in self.own_rms_mm],
        }


def common_shape(shapes: Sequence[PartShape]) -> Shapes | None:
    """Return what k >= 2 shapes have in common, or None for fewer.

    One variance between parts for all places, by the method of moments (DerSimonian, Laird, Control. Clin. Trials 7, 1986,
    doi:10.1016/0197-2456(86)90046-2) summed over them; the mean is weighted by it and by each field's own sigma.
    """
    if len(shapes) < 2:
        return None
    places = shapes[0].points_part
    y, s2 = (np.full((len(shapes), len(places)), np.nan) for _ in range(2))
    for i, shape in enumerate(shapes):
        at = cKDTree(shape.points_part).query(places)[1]
        y[i] = np.where(shape.supported[at], shape.values_mm[at], np.nan)
        s2[i] = np.maximum(shape.sigma_mm[at], 1e-6) ** 2
    told = np.isfinite(y)
    some = told.sum(axis=0) >= 2
    filled = np.where(told, y, 0.0)
    w = np.where(told, 1.0 / s2, 0.0)
    total = np.maximum(w.sum(axis=0), 1e-30)
    mean = (w * filled).sum(axis=0) / total
    q = (w * (filled - mean) ** 2).sum(axis=0)
    excess = q - (told.sum(axis=0) - 1)
    scale = total - (w**2).sum(axis=0) / total
    tau2 = max(float(excess[some].sum() / max(scale[some].sum(), 1e-30)), 0.0) if some.any() else 0.0
    w = np.where(told, 1.0 / (s2 + tau2), 0.0)
    total = np.maximum(w.sum(axis=0), 1e-30)
    mean = np.where(some, (w * filled).sum(axis=0) / total, np.nan)
    apart = np.where(told & some, y - mean, np.nan)
    noise = np.where(told & some, s2, np.nan)
    counted = np.isfinite(apart).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        own = np.sqrt(np.maximum(np.nansum(apart**2, axis=1) - np.nansum(noise, axis=1), 0.0) / counted)
    return Shapes(
        tuple(s.name for s in shapes),
        places,
        y,
        mean,
        np.where(some, 1.0 / np.sqrt(total), np.nan),
        np.where(counted > 0, own, np.nan),
        float(np.sqrt(tau2)) if len(shapes) >= 3 else None,
    )
