"""Ways beside the columns above keep-outs that must not be crossed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from planner.frames import Array
from planner.setup import Setup
from planner.surface.keepouts import Column
from planner.surface.outlines import segment_distance_mm

_STEP_MM = 2.0
# Corners of a way round a column; each stands off it so far that the sides between them keep clear.
_CORNERS = 16


@dataclass(frozen=True, eq=False)
class Detours:
    """columns: what must not be crossed. radius_mm, length_mm: of the nozzle."""

    columns: tuple[Column, ...]
    radius_mm: float
    length_mm: float

    @classmethod
    def of(cls, columns: Sequence[Column], setup: Setup) -> "Detours":
        """Return the detours of a setup's nozzle, which keeps the margin above what it may pass over as well."""
        columns = [replace(c, top_mm=c.top_mm + c.margin_mm) for c in columns]
        return cls(tuple(columns), setup.tool.nozzle_radius_mm, setup.tool.nozzle_length_mm)

    def gap_mm(self, tips: Array, ups: Array) -> Array:
        """Return the least distance (n,), mm, of nozzles at TCP positions (n, 3), standing along ups (n, 3)."""
        out = np.full(len(tips), np.inf)
        for column in self.columns:
            out = np.minimum(out, column.gap_mm(tips, tips + self.length_mm * ups, self.radius_mm))
        return out

    def crossed(self, a: Array, b: Array, za: Array, zb: Array) -> NDArray[np.bool_]:
        """Return which straight ways from a to b (n, 3), tool along za and zb, come over a column (n,)."""
        if not self.columns or not len(a):
            return np.zeros(len(a), dtype=bool)
        pieces = np.maximum(np.ceil(np.linalg.norm(b - a, axis=1) / _STEP_MM), 1.0).astype(np.int64) + 1
        way = np.repeat(np.arange(len(a)), pieces)
        rank = np.arange(len(way)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        t = (rank / (pieces[way] - 1))[:, None]
        up = (1.0 - t) * za[way] + t * zb[way]
        up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-9)
        gap = self.gap_mm((1.0 - t) * a[way] + t * b[way], up)
        return np.asarray(np.minimum.reduceat(gap, np.cumsum(pieces) - pieces) < 0.0)

    def blocks(self, way: Array, ups: Array) -> bool:
        """Return whether a polyline of TCP positions (n, 3) comes over a column."""
        return bool(self.crossed(way[:-1], way[1:], ups[:-1], ups[1:]).any())

    def way(self, a: Array, b: Array, lifted: Callable[[Array], Array]) -> Array:
        """Return the turning points (k, 3) of the shortest way from a to b beside all columns; none if there is no way.

        `lifted` moves points clear of the part.
        """
        nodes = np.concatenate(
            [a[None], b[None], lifted(np.concatenate([self._around(c, a, b) for c in self.columns]))]
        )
        i, j = np.triu_indices(len(nodes), 1)
        free = np.ones(len(i), dtype=bool)
        for column in self.columns:
            flat = column.flat(nodes)
            room = column.radius_mm + self.radius_mm + 0.5 * column.margin_mm
            free &= segment_distance_mm(flat[i], flat[j], column.outline) >= room
        length = np.linalg.norm(nodes[i[free]] - nodes[j[free]], axis=1)
        graph = coo_array((length, (i[free], j[free])), shape=(len(nodes), len(nodes))).tocsr()
        _, before = dijkstra(graph, directed=False, indices=0, return_predecessors=True)
        turns: list[int] = []
        at = int(before[1])
        while at > 0:
            turns.append(at)
            at = int(before[at])
        return nodes[turns[::-1]] if turns else np.zeros((0, 3))

    def _around(self, column: Column, a: Array, b: Array) -> Array:
        """Return points (m, 3) around a column, as high above its origin as the way goes."""
        angle = np.arange(_CORNERS) * (2.0 * np.pi / _CORNERS)
        out = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        reach = (column.radius_mm + self.radius_mm + column.margin_mm) / np.cos(np.pi / _CORNERS)
        flat = column.outline[np.argmax(out @ column.outline.T, axis=1)] + reach * out
        height = float(max((a - column.origin) @ column.up, (b - column.origin) @ column.up))
        return np.asarray(column.origin + flat[:, :1] * column.first + flat[:, 1:] * column.second + height * column.up)
