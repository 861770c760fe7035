"""The linear problem the noise model works on: few hundred rows, each the mean of many readings somewhere on the path."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.estimate.patches import Patches
from alignment.estimate.surface_rows import Rows
from planner.frames import Array

TARGET_ROWS = 200
MOST_BANDS = 3
# Rows that are too many stand for so many times longer stretches, on average.
LONGER = 1.15
# Of a shape, stretches are not made longer than so many cells while a third band of laws is left.
LONG_STRETCH = 4.0


@dataclass(frozen=True, eq=False)
class NoiseRows:
    """n rows of residuals r (n,), mm, with design x (n, k) against the unknowns in prior standard deviations.

    count (n,): readings a row stands for. block (n,): row of `block_*` it lies on; -1 without a path. across (n,): its
    place on the array, -1..1. position_base (n, 3), mm; size_mm: extent of a cell. block_from_mm, block_to_mm, block_pass
    (b,): stretches of path, ascending. edge (n,): True for rows that measure an edge, whose noise is their own.
    direction_base (n, 3): along which a row measures; an error of the pose shows in it by its component along.
    """

    r: Array
    x: Array
    count: Array
    block: NDArray[np.int32]
    across: Array
    position_base: Array
    size_mm: float
    block_from_mm: Array
    block_to_mm: Array
    block_pass: NDArray[np.int32]
    edge: NDArray[np.bool_]
    direction_base: Array

    def __len__(self) -> int:
        return len(self.r)

    @property
    def has_path(self) -> bool:
        """False for ready surface points."""
        return bool((self.block >= 0).any())


def has_path(patches: Patches) -> bool:
    """Return whether the patches lie along passes."""
    return not bool(np.isnan(patches.cells.s_from_mm).all())


def coarse_of(
    patches: Patches, used: NDArray[np.bool_], target: int = TARGET_ROWS, of_shape: bool = False
) -> tuple[NDArray[np.int64], Array]:
    """Return the row (p,) of each used patch (-1: unused) and [from, to, pass, band] per row (n, 4).

    Neighbouring stretches of a pass and neighbouring bands of laws are joined until there are few enough rows. of_shape: the
    rows are to show a part's shape, across the laws as well as along the pass.
    """
    cells = patches.cells
    pass_number = np.unique(cells.pass_id, return_inverse=True)[1]
    span = 1 + int(pass_number.max(initial=0))
    low = np.full(span, np.iinfo(np.int32).max)
    np.minimum.at(low, pass_number, cells.block)
    within = cells.block - low[pass_number]
    bands = np.unique(np.round(cells.across_mm, 6), return_inverse=True)[1]
    band_count = 1 + int(bands.max(initial=0))
    for join, merged in _joins(int(within.max(initial=0)) + 1, min(band_count, MOST_BANDS), of_shape):
        band = bands * merged // band_count
        stretch = (within / join).astype(np.int64)
        per_pass = 1 + int(stretch.max(initial=0))
        key = (pass_number * per_pass + stretch) * merged + band
        row_key = np.unique(key[used])
        if len(row_key) <= target:
            break
    row = np.searchsorted(row_key, key)
    row[~used] = -1
    n = len(row_key)
    s_from, s_to = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(s_from, row[used], cells.s_from_mm[used])
    np.maximum.at(s_to, row[used], cells.s_to_mm[used])
    number = row_key // merged
    return row, np.column_stack([s_from, s_to, number // per_pass, number])


def _joins(longest: int, bands: int, of_shape: bool) -> list[tuple[float, int]]:
    """Return ways to join, from fine to coarse: so many stretches to one, and into how many bands of laws.

    Two bands still show an array that tilts; shorter stretches say more of a robot that wanders than a third band does.
    """
    fewer = min(bands, 2)
    joins = [1.0]
    while joins[-1] < longest:
        # Nodes of a shape stay whole cells wide, so that they lie evenly.
        joins.append(max(joins[-1] + 1.0, round(1.3 * joins[-1])) if of_shape else LONGER * joins[-1])
    if of_shape:
        return [(join, bands if join <= LONG_STRETCH else fewer) for join in joins]
    ways = {(join, merged) for join in joins for merged in {bands, fewer}}
    return sorted(ways, key=lambda way: way[0] / way[1])


def noise_rows(
    patches: Patches,
    rows: Rows,
    used: NDArray[np.bool_],
    prior_sigma: Array,
    swath_mm: float,
    coarse: tuple[NDArray[np.int64], Array] | None = None,
) -> NoiseRows:
    """Return patches `used` (p,) joined to rows: means weighted by readings, which keeps them linear in the unknowns.

    coarse: what `coarse_of` gives for them, if it is known already.
    """
    if not has_path(patches):
        return _without_path(patches, rows, used, prior_sigma)
    row, info = coarse_of(patches, used) if coarse is None else coarse
    n = len(info)
    picked = np.flatnonzero(used)
    at, weight = row[picked], patches.count[picked]
    total = np.bincount(at, weight, n)

    def mean(values: Array) -> Array:
        columns = values.reshape(len(picked), -1)
        out = np.stack([np.bincount(at, weight * c, n) / total for c in columns.T], axis=1)
        return out.reshape((n, *values.shape[1:]))

    # Rows of one stretch and pass share a block, whatever their laws.
    _, first, block = np.unique(info[:, 3], return_index=True, return_inverse=True)
    s_from, s_to = np.full(len(first), np.inf), np.full(len(first), -np.inf)
    np.minimum.at(s_from, block, info[:, 0])
    np.maximum.at(s_to, block, info[:, 1])
    width = float(np.median(s_to - s_from))
    bands = max(1, round(n / max(1, len(first))))
    return NoiseRows(
        mean(rows.r[picked]),
        mean(rows.jacobian[picked] * prior_sigma),
        np.asarray(total, dtype=np.float64),
        block.astype(np.int32),
        mean(patches.cells.across_mm[picked]) / max(0.5 * swath_mm, 1e-9),
        mean(rows.foot_base[picked]),
        float(np.hypot(width, swath_mm / bands)),
        s_from,
        s_to,
        info[first, 2].astype(np.int32),
        np.zeros(n, dtype=bool),
        mean(rows.normal_base[picked]),
    )


def _without_path(patches: Patches, rows: Rows, used: NDArray[np.bool_], prior_sigma: Array) -> NoiseRows:
    picked = np.flatnonzero(used)
    points = rows.foot_base[picked]
    size = max(float(np.ptp(points, axis=0).max()) / 200.0, 1e-6)
    while True:
        _, at = np.unique(np.floor((points - points.min(axis=0)) / size).astype(np.int64), axis=0, return_inverse=True)
        n = 1 + int(at.max())
        if n <= TARGET_ROWS:
            break
        size *= 1.2
    weight = patches.count[picked]
    total = np.bincount(at, weight, n)

    def mean(values: Array) -> Array:
        columns = values.reshape(len(picked), -1)
        return np.stack([np.bincount(at, weight * c, n) / total for c in columns.T], axis=1)

    none = np.zeros(0)
    return NoiseRows(
        mean(rows.r[picked])[:, 0],
        mean(rows.jacobian[picked] * prior_sigma),
        np.asarray(total, dtype=np.float64),
        np.full(n, -1, dtype=np.int32),
        np.zeros(n),
        mean(points),
        float(size * np.sqrt(2.0)),
        none,
        none.copy(),
        np.zeros(0, dtype=np.int32),
        np.zeros(n, dtype=bool),
        mean(rows.normal_base[picked]),
    )
