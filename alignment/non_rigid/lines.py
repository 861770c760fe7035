"""Jumps of several passes on one line: each pass alone may be the robot's, all of them together are the part's."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.non_rigid.jumps import Jumps
from alignment.non_rigid.rest import Rest
from planner.frames import Array

# Lines tried lean by up to this much along the passes per mm over from pass to pass, in at most so many steps to either side.
SLANT, MOST_SLANTS = 1.2, 40
# Half the width of a line (mm): the rise of a step, and how straight it is; at least this share of a cell.
HALF_MM, HALF_CELLS = 2.5, 0.8
# Numbers of neighbouring passes that a line is looked for in, besides all of them: steps end somewhere.
RUNS = (1, 2, 3, 4, 6, 9)
# How far beyond chance (standard deviations of the mean over the passes) a line must stand. Some thousand places and slants are
# tried; of true parts and wandering robots the largest of a hundred scans was 4.6.
BELIEVED = 5.2
MOST_LINES = 12
# Cells this near (mm) to where a step was seen are left out of the search for the next.
NEAR_MM = 35.0


@dataclass(frozen=True, eq=False)
class Line:
    """cells: flat numbers of the cells of the grid on the line. height_mm: of the jump. sigmas: beyond chance. passes (n,).
    axis: 0 for a jump along the passes, 1 across the laws."""

    cells: NDArray[np.intp]
    height_mm: float
    sigmas: float
    passes: NDArray[np.int32]
    axis: int = 0


def lines(rest: Rest, seen: Jumps, least_mm: float) -> list[Line]:
    """Return the lines on which passes jump by at least `least_mm`, the surest first; seen: jumps along the passes."""
    out = []
    for chart in _charts(rest, seen):
        left = np.ones(len(chart.cells), dtype=bool)
        for _ in range(MOST_LINES):
            found = chart.best(left)
            if found is None:
                break
            line, taken = found
            left &= ~taken
            if abs(line.height_mm) >= least_mm:
                out.append(line)
    return sorted(out, key=lambda line: -line.sigmas)


@dataclass(frozen=True, eq=False)
class _Chart:
    """Cells (n,) of passes that run side by side, flattened: along, aside (n,), mm; jumps towards +along and their sigmas."""

    cells: NDArray[np.intp]
    along: Array
    aside: Array
    height_mm: Array
    sigmas: Array
    number: NDArray[np.intp]
    names: NDArray[np.int32]
    half_mm: float

    def best(self, left: NDArray[np.bool_]) -> tuple[Line, NDArray[np.bool_]] | None:
        """Return the surest line among the cells `left` (n,), and the cells that it accounts for; None if none is sure."""
        best, found = BELIEVED, None
        passes = len(self.names)
        steps = int(np.clip(np.ceil(SLANT * np.ptp(self.aside) / (2.0 * self.half_mm)), 1, MOST_SLANTS))
        for slant in np.linspace(-SLANT, SLANT, 2 * steps + 1):
            w = self.along - slant * self.aside
            of_bin = np.floor((w - w.min()) / self.half_mm).astype(np.intp)
            mean, heard = self._profiles(of_bin, left)
            for n in sorted({*(r for r in RUNS if r < passes), passes}):
                both = np.cumsum(np.pad(np.stack([mean, heard]), ((0, 0), (1, 0), (0, 0))), axis=1)
                total, seen = both[:, n:] - both[:, :-n]
                z = np.where(seen == n, np.abs(total), 0.0) / np.sqrt(n)
                first, k = (int(i) for i in np.unravel_index(int(np.argmax(z)), z.shape))
                if z[first, k] > best:
                    best, found = float(z[first, k]), (of_bin, w, k, first, first + n)
        if found is None:
            return None
        of_bin, w, k, first, last = found
        mine = left & (self.number >= first) & (self.number < last)
        line = np.flatnonzero(mine & ((of_bin == k) | (of_bin == k + 1)))
        middle = (k + 1.0) * self.half_mm + w.min()
        height = float(np.median(self.height_mm[line]))
        # One side of a step leaves an echo of the other sign: that is no step of its own.
        taken = (self.number >= first - 1) & (self.number <= last) & (np.abs(w - middle) < NEAR_MM)
        return Line(self.cells[line], height, best, self.names[first:last]), taken

    def _profiles(self, of_bin: NDArray[np.intp], left: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return the mean jump (sigmas) of each pass in each two neighbouring bins (p, m), and 1 where any cell was there."""
        bins = int(of_bin.max()) + 2
        at, size = (self.number * bins + of_bin)[left], bins * len(self.names)
        sums = [np.bincount(at, w, size).reshape(-1, bins) for w in (self.sigmas[left], np.ones(len(at)))]
        total, count = (x[:, :-1] + x[:, 1:] for x in sums)
        return total / np.maximum(count, 1.0), (count > 0).astype(np.float64)


def _charts(rest: Rest, seen: Jumps) -> Iterator[_Chart]:
    """Yield a chart per direction in which passes run."""
    ways = _ways(rest)
    names = np.array(list(ways), dtype=np.int32)
    todo = np.array([np.linalg.norm(w) > 0.5 for w in ways.values()], dtype=bool)
    while todo.any():
        axis = next(iter(w for w, t in zip(ways.values(), todo, strict=True) if t))
        turn = np.array([float(w @ axis) for w in ways.values()])
        mine = todo & (np.abs(turn) > np.sqrt(0.5))
        todo &= ~mine
        chart = _chart(rest, seen, names[mine], np.sign(turn[mine]), axis)
        if chart is not None:
            yield chart


def _ways(rest: Rest) -> dict[int, Array]:
    """Return the direction (3,) of each pass, unit; zero where it has none."""
    out: dict[int, Array] = {}
    for name in np.unique(rest.pass_id[rest.pass_id >= 0]):
        mine = rest.pass_id == name
        points = rest.points_part[mine][rest.known[mine]]
        quarter = max(1, len(points) // 4)
        way = points[-quarter:].mean(axis=0) - points[:quarter].mean(axis=0) if len(points) > 1 else np.zeros(3)
        out[int(name)] = way / max(float(np.linalg.norm(way)), 1e-9)
    return out


def _chart(rest: Rest, seen: Jumps, names: NDArray[np.int32], sign: Array, axis: Array) -> _Chart | None:
    columns = rest.value_mm.shape[1]
    cells = np.flatnonzero(np.isfinite(seen.height_mm.ravel()) & np.isin(np.repeat(rest.pass_id, columns), names))
    if not len(cells):
        return None
    # Passes too short to tell stand between none.
    able = np.isin(names, rest.pass_id[cells // columns])
    names, sign = names[able], sign[able]
    points = rest.points_part.reshape(-1, 3)[cells]
    # Aside is what points differ by most once their place along is taken away.
    flat = points - points.mean(axis=0)
    flat = flat - np.outer(flat @ axis, axis)
    aside = flat @ np.linalg.svd(flat, full_matrices=False)[2][0]
    at = np.searchsorted(names, rest.pass_id[cells // columns])
    middle = np.bincount(at, aside, len(names)) / np.maximum(np.bincount(at, minlength=len(names)), 1)
    order = np.argsort(middle, kind="stable")
    rank = np.argsort(order, kind="stable")
    towards = sign[at]
    return _Chart(
        cells, points @ axis, aside, towards * seen.height_mm.ravel()[cells], towards * seen.sigmas.ravel()[cells],
        rank[at], names[order], max(HALF_MM, HALF_CELLS * float(rest.size_mm[0])),
    )  # fmt: skip
