"""Where the TCP may take data: off the edges of the surface, and off the keep-out regions on it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.path.mesh import PathMesh
from planner.path.passes import LEAD_MM
from planner.setup import Setup
from planner.surface.inspection import InspectionSurface
from planner.surface.keepouts import KeepOuts, keep_outs_of


@dataclass(frozen=True, eq=False)
class Fence:
    """margin_mm: passes end this far from the boundary of the mesh; between its ends a pass may come as near as floor_mm.
    keep: regions on the surface; slack_mm: how much of their margin a pass may use up between its ends."""

    mesh: PathMesh
    margin_mm: float
    floor_mm: float = 0.0
    keep: KeepOuts | None = None
    slack_mm: float = 0.0

    @property
    def is_open(self) -> bool:
        """Whether there is nothing to keep away from."""
        return not self._has_edges and not self._has_regions

    @property
    def finest_mm(self) -> float:
        """Width (mm) of the narrowest thing to keep away from: a walk in half steps of it misses none."""
        edges = self.margin_mm if self._has_edges else np.inf
        return float(min(edges, self.keep.smallest_mm)) if self._has_regions and self.keep else float(edges)

    def tests(self, points: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return at which points (n, 3) a pass may end, and which it may run over (n,) each."""
        ends = np.ones(len(points), dtype=bool)
        runs = ends.copy()
        if self._has_edges:
            distance = np.minimum(self.mesh.boundary_distance(points, self.margin_mm * 1.5), self.margin_mm * 1.5)
            ends, runs = distance >= self.margin_mm, distance >= self.floor_mm
        if self._has_regions and self.keep is not None:
            gaps = self.keep.gaps_mm(points)
            ends &= self.keep.each_room_mm(points, LEAD_MM, gaps_mm=gaps).min(axis=0) >= 0.0
            runs &= self.keep.each_room_mm(points, give_mm=self.slack_mm, gaps_mm=gaps).min(axis=0) >= 0.0
        return ends, runs

    def may_end(self, points: Array) -> NDArray[np.bool_]:
        """Return at which points (n, 3) a pass may end."""
        return self.tests(points)[0]

    @property
    def _has_edges(self) -> bool:
        return self.margin_mm > 0.0 and len(self.mesh.boundary_edges) > 0

    @property
    def _has_regions(self) -> bool:
        return self.keep is not None and len(self.keep) > 0


def raster_fence(mesh: PathMesh, surface: InspectionSurface, setup: Setup) -> Fence:
    """Return the fence of the inspection raster.

    Where a pass runs past a hole or a region nearer than the margin, its neighbour covers everything up to it; how near
    it may come follows from step and swath. What must not be crossed gives nothing away.
    """
    inspection, swath = setup.inspection, setup.probe.swath_mm
    step = inspection.step_mm if inspection.step_mm is not None else (1.0 - inspection.overlap) * swath
    slack = max(step - swath / 2.0, 0.0)
    keep = keep_outs_of(surface, setup)
    return Fence(mesh, inspection.edge_margin_mm, inspection.edge_margin_mm - slack, keep, slack)
