"""What the residuals of a scan say about the part's shape: some hundred nodes, each the mean of many readings."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from alignment.estimate.noise_rows import coarse_of
from alignment.estimate.patches import Patches
from alignment.estimate.robust import mad_sigma
from alignment.estimate.surface_rows import Rows
from planner.frames import Array, Transform
from planner.setup import Setup

NEIGHBOURS = 16
# A patch this far (mm, and robust standard deviations) from its neighbours' middle is no shape of a part.
LONE_MM, LONE_SIGMAS = 1.0, 8.0
# Nor is one that fewer of its readings agree on than this share, or that is worth less than this share of the usual one.
MOST_AGREE, LEAST_WORTH = 0.5, 0.03


@dataclass(frozen=True, eq=False)
class Track:
    """Where on the scanner's way n nodes lie. block (n,): row of the others, -1 without a way. across (n,): place on the
    array, -1..1. from_mm, to_mm (b,): stretches of path; pass_id (b,): their passes."""

    block: NDArray[np.int32]
    across: Array
    from_mm: Array
    to_mm: Array
    pass_id: NDArray[np.int32]

    @property
    def known(self) -> bool:
        """False for ready surface points."""
        return len(self.pass_id) > 0


@dataclass(frozen=True, eq=False)
class Nodes:
    """n nodes. deviation_mm (n,): how far the part stands out of its CAD along the normal, mean over the node.

    points_part, normals_part (n, 3): mean foot and normal, `part`, mm. design (n, 6): normal displacement by motions about
    the centroid, in prior standard deviations, axes of base. count (n,): readings. size_mm: distance of nodes.
    scatter_mm: of a single reading.
    """

    deviation_mm: Array
    points_part: Array
    normals_part: Array
    design: Array
    count: Array
    track: Track
    size_mm: float
    scatter_mm: float

    def __len__(self) -> int:
        return len(self.deviation_mm)

    @property
    def passes(self) -> int:
        """Number of passes, 0 without a path."""
        return len(np.unique(self.track.pass_id))

    def only(self, keep: NDArray[np.bool_]) -> "Nodes":
        """Return the selected nodes."""
        track = replace(self.track, block=self.track.block[keep], across=self.track.across[keep])
        return Nodes(
            self.deviation_mm[keep], self.points_part[keep], self.normals_part[keep], self.design[keep],
            self.count[keep], track, self.size_mm, self.scatter_mm,
        )  # fmt: skip


def believable(patches: Patches, rows: Rows, setup: Setup) -> NDArray[np.bool_]:
    """Return which patches (p,) may tell of the part's shape: on the surface, and not on their own.

    A bend or a dent is no outlier: patches are compared with their neighbours, not with the rigid part.
    """
    keep = rows.valid & (np.abs(rows.r) < setup.alignment.search_radius_mm) & _agree(patches)
    for _ in range(2):
        at = np.flatnonzero(keep)
        if len(at) <= NEIGHBOURS:
            break
        near = cKDTree(rows.foot_base[at]).query(rows.foot_base[at], NEIGHBOURS)[1]
        off = rows.r[at] - np.median(rows.r[at][near], axis=1)
        keep[at] = np.abs(off) < LONE_MM + LONE_SIGMAS * mad_sigma(off, 1e-3, about_zero=True)
    return keep


def _agree(patches: Patches) -> NDArray[np.bool_]:
    """Return which patches (p,) most of their own readings agree on, and that are worth some.

    Where no echo comes back at all, beyond an edge or a step, the few readings that splash left agree on nothing.
    """
    cell, p = patches.cells.of_reading, len(patches)
    total, kept = np.bincount(cell, minlength=p), np.bincount(cell, patches.kept, p)
    usual = float(np.median(patches.count[patches.count > 0])) if (patches.count > 0).any() else 0.0
    return (kept >= MOST_AGREE * total) & (patches.count >= LEAST_WORTH * usual)


def gather(
    patches: Patches, rows: Rows, keep: NDArray[np.bool_], T_base_part: Transform, setup: Setup, most: int
) -> Nodes:
    """Return at most about `most` nodes of the patches `keep` (p,)."""
    picked = np.flatnonzero(keep)
    weight = patches.count[picked]
    cells = patches.cells
    with_path = not np.isnan(cells.s_from_mm).all()
    if with_path:
        row, info = coarse_of(patches, keep, most, of_shape=True)
        at, n = row[picked], len(info)
        _, first, block = np.unique(info[:, 3], return_index=True, return_inverse=True)
        s_from, s_to = np.full(len(first), np.inf), np.full(len(first), -np.inf)
        np.minimum.at(s_from, block, info[:, 0])
        np.maximum.at(s_to, block, info[:, 1])
        pass_id = info[first, 2].astype(np.int32)
    else:
        at, n = _in_space(rows.foot_base[picked], most)
        block, s_from, pass_id = np.full(n, -1), np.zeros(0), np.zeros(0, dtype=np.int32)
        s_to = s_from.copy()
    total = np.bincount(at, weight, n)

    def mean(values: Array) -> Array:
        columns = values.reshape(len(picked), -1)
        return np.stack([np.bincount(at, weight * c, n) / total for c in columns.T], axis=1)

    fixture = setup.fixture
    prior = np.repeat([np.radians(fixture.sigma_deg), fixture.sigma_mm], 3)
    r = mean(rows.r[picked])[:, 0]
    position = mean(rows.foot_base[picked])
    across = mean(cells.across_mm[picked])[:, 0] / max(0.5 * setup.probe.swath_mm, 1e-9)
    gap = cKDTree(position).query(position, 2)[0][:, 1] if n > 1 else np.ones(1)
    T_part_base = T_base_part.inv()
    return Nodes(
        -r, T_part_base.points(position), T_part_base.directions(mean(rows.normal_base[picked])),
        mean(rows.jacobian[picked] * prior), total.astype(np.float64),
        Track(block.astype(np.int32), across, s_from, s_to, pass_id), float(np.median(gap)), patches.sigma_mm,
    )  # fmt: skip


def _in_space(points: Array, most: int) -> tuple[NDArray[np.intp], int]:
    size = max(float(np.ptp(points, axis=0).max()) / 400.0, 1e-6)
    while True:
        cell = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
        _, at = np.unique(cell, axis=0, return_inverse=True)
        n = 1 + int(at.max(initial=0))
        if n <= most:
            return at.ravel(), n
        size *= 1.2
