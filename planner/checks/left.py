"""What of the surface no pass reaches although it lies outside of every margin: how much, in how many places, and why."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from planner.issues import Issue
from planner.path.coverage import Coverage
from planner.path.edge_passes import WORTH_MM2
from planner.path.mesh import PathMesh
from planner.path.passes import LEAD_MM
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.keepouts import keep_outs_of

# Less than this (mm2) is not worth a sentence.
_LEAST_MM2 = 20.0
# Samples this many mean distances apart belong to one place.
_TOGETHER = 2.0


def left_issues(curved: CurvedSurface, covered: Coverage, setup: Setup) -> list[Issue]:
    """Return what the inspection raster leaves outside of margins, and out of reach of its passes; nothing if next to none."""
    if covered.unexplained_mm2 < _LEAST_MM2:
        return []
    seen, margin = covered.seen, setup.inspection.edge_margin_mm
    row = np.flatnonzero(~seen.swept)
    points, _ = curved.evaluate(seen.samples.face[row], seen.samples.bary[row])
    keep, mesh = keep_outs_of(curved.surface, setup), PathMesh.of(curved.surface)
    reach = margin + 2.0 * setup.probe.swath_mm
    edge = mesh.boundary_distance(points, reach)
    free = (edge > margin) & (keep.room_mm(points, LEAD_MM) >= 0.0)
    row, points, edge = row[free], points[free], edge[free]
    area = seen.samples.area_mm2[row]
    if float(area.sum()) < _LEAST_MM2:
        return []
    together = cKDTree(points).query_pairs(_TOGETHER * float(np.sqrt(area.mean())), output_type="ndarray")
    graph = coo_array((np.ones(len(together)), together.T), shape=(len(points), len(points)))
    count, place = connected_components(graph, directed=False)
    size = np.bincount(place, area)
    largest = int(size.argmax())
    inside = np.flatnonzero(place == largest)
    middle = inside[int(np.linalg.norm(points[inside] - points[inside].mean(axis=0), axis=1).argmin())]
    near = float(area[np.isfinite(edge)].sum())
    x, y, z = points[middle]
    why = (
        f"{near / area.sum():.0%} of it lies between the ends of passes at slanted edges and beside holes, in pieces under "
        f"{WORTH_MM2:g} mm2 or in corners where no further pass fits"
        if near > 0.0
        else "it lies away from all edges"
    )
    return [
        Issue(
            "info",
            "coverage-left",
            f"{area.sum():.0f} mm2 of the surface ({area.sum() / covered.area_mm2:.2%}), in {count} "
            f"place{'s' if count > 1 else ''}, are outside of the edge margin and yet reached by no pass: {why}. The largest, "
            f"{size[largest]:.0f} mm2, is at X {x:.0f} Y {y:.0f} Z {z:.0f} of the part.",
            f"An inspection.step_mm of half the swath ({setup.probe.swath_mm / 2.0:g} mm) leaves nothing between the ends of "
            "passes; passes along that edge (direction_deg) or a smaller edge_margin_mm leave less.",
            "inspection",
        )
    ]
