"""`LeftOver`: what a scan shows of the part that neither its placement nor its field accounts for, and what to say of it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d
from scipy.spatial import cKDTree

from alignment.cloud import PointCloud
from alignment.non_rigid.field import Field
from alignment.non_rigid.rest import Rest, rest_of
from alignment.non_rigid.steps import Step, Steps, steps_in
from planner.frames import Array, Transform
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

# Over such a stretch of a pass (mm) what single readings and a shaking robot add is mostly gone.
SLOW_MM = 30.0
# Cells that tell what is left at a place, and how quickly they count less (sizes of a cell).
NEIGHBOURS, SMOOTH = 8, 0.6
# Of `tolerances.position_mm`, what may be left over such stretches (rms) before it counts.
SLOW_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class LeftOver:
    """rest: cells of the passes. steps: in them. slow_mm (b, k): means over stretches. slow_rms_mm: their spread."""

    rest: Rest
    steps: Steps
    slow_mm: Array
    slow_rms_mm: float
    slow_counts: bool

    @property
    def counts(self) -> bool:
        """Whether anything is left that an inspection will meet again."""
        return bool(self.steps.found) or self.slow_counts

    @cached_property
    def value_mm(self) -> Array:
        """What is left at each cell (b, k): single cells about steps, else slow means where they count, else nothing."""
        calm = self.slow_mm if self.slow_counts else np.zeros(self.rest.value_mm.shape)
        value = np.where(self.steps.near, self.rest.value_mm, calm)
        return np.where(self.rest.known, value, np.nan)

    def at(self, points_part: Array) -> Array:
        """Return how far the part stands out beyond what is believed of it (n,), mm, at points (n, 3); NaN off the passes."""
        known = self.rest.known
        tree = cKDTree(self.rest.points_part[known])
        size = float(self.rest.size_mm.max())
        away, nearest = tree.query(points_part, min(NEIGHBOURS, int(known.sum())))
        away, nearest = away.reshape(len(points_part), -1), nearest.reshape(len(points_part), -1)
        # As wide as the beam that hears it: at the step itself neither side is all that is there.
        weight = np.exp(-0.5 * (away / (SMOOTH * size)) ** 2)
        value = (weight * self.value_mm[known][nearest]).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-12)
        return np.where(away[:, 0] <= size, value, np.nan)

    def seen_share(self, points_part: Array) -> float:
        """Return the share of points (n, 3) where a pass went."""
        return float(np.isfinite(self.at(points_part)).mean()) if len(points_part) else 0.0

    def off_mm(self, step: Step) -> float:
        """Return the largest distance (mm) that is left about a step: of a hundred cells the last but one."""
        near: NDArray[np.bool_] = self.steps.near
        points = self.rest.points_part[near]
        ends = step.ends_part
        t = np.clip((points - ends[0]) @ (ends[1] - ends[0]) / max(step.extent_mm**2, 1e-9), 0.0, 1.0)
        beside = np.linalg.norm(points - ends[0] - t[:, None] * (ends[1] - ends[0]), axis=1) < SLOW_MM
        values = np.abs(self.rest.value_mm[near][beside])
        return float(np.quantile(values, 0.99)) if len(values) else 0.5 * step.height_mm


def left_over(
    cloud: PointCloud, curved: CurvedSurface, setup: Setup, T_base_part: Transform, field: Field | None
) -> LeftOver | None:
    """Return what is left of a scan at a placement, with a field or without; None for readings that know no passes."""
    rigid = rest_of(cloud, curved, setup, T_base_part)
    if rigid is None or not rigid.known.any():
        return None
    least = setup.tolerances.position_mm
    rest = rigid if field is None else rigid.followed(field)
    steps = steps_in(rigid, least, None if field is None else rest)
    slow = _slow(rest)
    rms = float(np.nanstd(slow))
    return LeftOver(rest, steps, slow, rms, rms > SLOW_SHARE * least)


def _slow(rest: Rest) -> Array:
    """Return means (b, k) over stretches of a pass and half of the array."""
    half = [
        max(0, round(0.5 * mm / float(cell))) for mm, cell in zip((SLOW_MM, 0.5 * SLOW_MM), rest.size_mm, strict=True)
    ]

    def total(what: Array) -> Array:
        along = correlate1d(what, np.ones(2 * half[0] + 1), axis=0, mode="constant")
        return np.asarray(correlate1d(along, np.ones(2 * half[1] + 1), axis=1, mode="constant"))

    mean = total(np.nan_to_num(rest.value_mm)) / np.maximum(total(rest.known.astype(np.float64)), 1.0)
    return np.where(rest.known, mean, np.nan)
