"""Steps that single readings show and a smooth field does not: ply drops, joggles, the rim of a repair."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.spatial import cKDTree

from alignment.non_rigid.jumps import Jumps, jumps
from alignment.non_rigid.lines import BELIEVED, Line, lines
from alignment.non_rigid.rest import Rest
from planner.frames import Array

# A jump across the laws, which the robot does not make, must run along with the pass for so far (mm).
RUNS_ON_MM = 18.0
# Where a step is known to be, what is left of it is no matter of chance from so many standard deviations on.
STAYS = 4.0
# A step that rises over so many mm to either side shows its whole height.
RISE_MM = 5.0
# Lines and places nearer than this (mm) are one step; cells nearer stand off for its sake.
ONE_STEP_MM, REACH_MM = 20.0, 30.0
# A field that follows a steep step as far as it can swings beside it: what is so many times lower and so near (mm) is that.
SWING, SWING_MM = 4.0, 45.0


@dataclass(frozen=True, eq=False)
class Step:
    """A step as it was seen. point_part (3,), mm: its middle. ends_part (2, 3), mm: the farthest that it was seen.

    height_mm: how far one side stands above the other. passes: how many saw it. sigmas: how far beyond chance.
    """

    point_part: Array
    ends_part: Array
    height_mm: float
    passes: int
    sigmas: float

    @property
    def extent_mm(self) -> float:
        """Distance over which it was seen."""
        return float(np.linalg.norm(self.ends_part[1] - self.ends_part[0]))


@dataclass(frozen=True, eq=False)
class Steps:
    """found: the highest first. near (b, k): cells that stand off for their sake. scatter_mm: of jumps by chance."""

    found: tuple[Step, ...]
    near: NDArray[np.bool_]
    scatter_mm: float


def steps_in(rest: Rest, least_mm: float, followed: Rest | None = None) -> Steps:
    """Return the steps of at least `least_mm` in what a rigid part leaves of the readings.

    followed: what its field leaves; then only those that the field does not follow, and those that only show now.
    """
    along, across = jumps(rest, 0), jumps(rest, 1)
    pieces = [*lines(rest, along, least_mm), *_beside(rest, across, least_mm)]
    if followed is not None:
        after = jumps(followed, 0), jumps(followed, 1)
        pieces = [p for p in pieces if any(_stays(p, rest, jump, least_mm) for jump in after)]
        pieces += [*lines(followed, after[0], least_mm), *_beside(followed, after[1], least_mm)]
    points = rest.points_part.reshape(-1, 3)
    found: list[list[Line]] = []
    for piece in sorted(pieces, key=lambda p: -abs(p.height_mm)):
        near = [g for g in found if _one_step(points, g, piece)]
        for other in near[1:]:
            near[0].extend(other)
            found.remove(other)
        if near:
            near[0].append(piece)
        else:
            found.append([piece])
    whole = [jumps(rest, axis, RISE_MM) for axis in (0, 1)]
    steps = sorted((_step(rest, group, whole) for group in found), key=lambda s: -s.height_mm)
    cells = np.unique(np.concatenate([np.zeros(0, dtype=np.intp), *(p.cells for p in pieces)]))
    return Steps(tuple(steps), _within(rest, cells), along.sigma_mm)


def _stays(piece: Line, rest: Rest, after: Jumps, least_mm: float) -> bool:
    """Return whether the cells of a step still jump, each pass once, when the field is followed."""
    name = rest.pass_id[piece.cells // rest.value_mm.shape[1]]
    number = np.unique(name, return_inverse=True)[1].ravel()
    height = np.nan_to_num(after.height_mm.ravel()[piece.cells]) * np.sign(piece.height_mm)
    # Forth and back: what counts is that each pass jumps, not which way its rows are numbered.
    per_pass = np.abs(np.bincount(number, height) / np.bincount(number))
    z = float(per_pass.sum() / np.sqrt(len(per_pass)) / after.sigma_mm)
    return z >= STAYS and float(per_pass.mean()) >= 0.5 * least_mm


def _beside(rest: Rest, seen: Jumps, least_mm: float) -> list[Line]:
    """Return where one side of the array stands above the other, the same way on a stretch of a pass."""
    out = []
    columns = rest.value_mm.shape[1]
    points = rest.points_part.reshape(-1, 3)
    height, z = np.nan_to_num(seen.height_mm), seen.sigmas
    for sign in (1.0, -1.0):
        numbered, count = label(
            (sign * z >= BELIEVED) & (sign * height >= least_mm), structure=np.ones((3, 3), dtype=int)
        )
        flat = numbered.ravel()
        order = np.argsort(flat, kind="stable")
        bounds = np.searchsorted(flat[order], np.arange(1, count + 2))
        for i in range(count):
            cells = order[bounds[i] : bounds[i + 1]]
            # A jump counts over its breadth: one cell alone would be seen so far to both sides.
            if np.ptp(cells // columns) * rest.size_mm[0] < RUNS_ON_MM or len(points[cells]) < 3:
                continue
            top = cells[np.argsort(-sign * z.ravel()[cells])][: max(1, len(cells) // 3)]
            name = rest.pass_id[cells[:1] // columns]
            out.append(
                Line(cells, float(np.median(height.ravel()[top])), float(np.median(sign * z.ravel()[top])), name)
            )
    return out


def _one_step(points: Array, group: list[Line], piece: Line) -> bool:
    """Return whether a piece belongs to higher ones: near them, or only their swing."""
    cells = np.concatenate([p.cells for p in group])
    gap = float(cKDTree(points[cells]).query(points[piece.cells])[0].min())
    swing = max(abs(p.height_mm) for p in group) >= SWING * abs(piece.height_mm)
    return gap < (SWING_MM if swing else ONE_STEP_MM)


def _step(rest: Rest, group: list[Line], whole: list[Jumps]) -> Step:
    surest = max(group, key=lambda p: p.sigmas)
    at = rest.points_part.reshape(-1, 3)[np.concatenate([p.cells for p in group])]
    middle = np.median(at, axis=0)
    axis = np.linalg.svd(at - middle, full_matrices=False)[2][0]
    t = (at - middle) @ axis
    ends = at[[int(np.argmin(t)), int(np.argmax(t))]]
    nearest = at[int(np.argmin(((at - middle) ** 2).sum(axis=1)))]
    passes = len(np.unique(np.concatenate([p.passes for p in group])))
    return Step(nearest, ends, max(abs(surest.height_mm), _whole_mm(rest, surest, whole)), passes, surest.sigmas)


def _whole_mm(rest: Rest, piece: Line, whole: list[Jumps]) -> float:
    """Return the whole height (mm) of a step, mean of its passes; 0 where the sides are too short to tell."""
    height = whole[piece.axis].height_mm.ravel()[piece.cells]
    name = rest.pass_id[piece.cells // rest.value_mm.shape[1]]
    known = np.isfinite(height)
    of_pass = [float(np.median(height[known & (name == k)])) for k in np.unique(name[known])]
    return float(np.mean(np.abs(of_pass))) if of_pass else 0.0


def _within(rest: Rest, cells: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return the known cells (b, k) within reach of some cells."""
    if not len(cells):
        return np.zeros(rest.value_mm.shape, dtype=bool)
    near, known = np.zeros(rest.value_mm.shape, dtype=bool), rest.known
    tree = cKDTree(rest.points_part.reshape(-1, 3)[cells])
    near[known] = tree.query(rest.points_part[known])[0] < REACH_MM
    return near
