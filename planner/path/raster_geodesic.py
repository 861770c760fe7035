"""Strategy `geodesic`: lines of equal distance, measured on the surface, from a guide line along the scan direction."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.path.axes import ScanAxes
from planner.path.cut import Cut, surface_samples, tangent, towards_higher
from planner.path.field import guide_distance
from planner.path.holes import fill_holes
from planner.path.isolines import isolines, neighbours
from planner.path.layout import levels, step_field
from planner.path.manifold import unglued
from planner.path.mesh import PathMesh
from planner.path.swath import effective_half_mm, step_mm
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.subdivide import Subdivision, split_long_edges

_GUIDES = 15
# Triangles of the field are no longer than this share of the surface's size: fronts that bend need places to bend at.
_FINENESS = 1.0 / 60.0


def geodesic_cut(curved: CurvedSurface, mesh: PathMesh, axes: ScanAxes, setup: Setup) -> Cut:
    """Return the lines of equal distance from the longest central section along the passes.

    The field lives on a finer copy of the triangles in which holes are closed, so that lines do not bend round a hole;
    points are then handed back to the triangles of the surface. On a closed surface the two sides of the guide meet on a
    ridge: passes there stand half a step from it.
    """
    guided = _guided(mesh, axes)
    fine, d, cut_mesh = guided.fine, guided.distance, guided.mesh
    towards = towards_higher(fine, d)
    s = surface_samples(curved, cut_mesh, fine)
    half = effective_half_mm(s.shape, tangent(towards[s.face], s.normals), setup)
    v = np.einsum("nk,nk->n", d[fine.faces[s.face]], s.bary)
    used = np.unique(fine.faces)
    v_range = (float(d[used].min()), float(d[used].max()))
    field = step_field(v, step_mm(half, setup), half, np.ones(len(v)), v_range)
    rim = np.zeros(len(fine.vertices), dtype=bool)
    rim[cut_mesh.boundary_edges] = True
    margin = setup.inspection.edge_margin_mm
    ends = tuple(margin if rim[k] else None for k in (used[d[used].argmin()], used[d[used].argmax()]))
    at = levels(field, v_range, (ends[0], ends[1]), exact=setup.inspection.step_mm is not None)

    def across(face: NDArray[np.int32], normals: Array) -> Array:
        return tangent(towards[face], normals)

    return Cut(cut_mesh, isolines(d, fine.faces, cut_mesh.other, at), across, exact=False, fine=fine)


@dataclass(frozen=True, eq=False)
class _Guided:
    """The distance field: fine triangles of the surface, the same as a mesh, signed distance (v,) at its vertices."""

    axes: ScanAxes
    fine: Subdivision
    mesh: PathMesh
    distance: Array


# The field is the slow part and depends on the surface and the direction only: kept until either changes.
_KNOWN: WeakKeyDictionary[PathMesh, _Guided] = WeakKeyDictionary()


def _guided(mesh: PathMesh, axes: ScanAxes) -> _Guided:
    known = _KNOWN.get(mesh)
    if known is not None and _alike(known.axes, axes):
        return known
    size = float(np.linalg.norm(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0)))
    closed = fill_holes(unglued(mesh))
    whole = split_long_edges(closed.vertices, closed.faces, size * _FINENESS)
    if axes.guide is not None:
        height = axes.guide.height_mm(whole.vertices)
    else:
        height = whole.vertices @ axes.across
        height = height - _guide_offset(whole, height)
    d = guide_distance(whole.vertices, whole.faces, height)
    fine = whole.only(whole.parent < len(mesh.faces))
    made = _KNOWN[mesh] = _Guided(axes, fine, PathMesh(fine.vertices, fine.faces), d)
    return made


def _alike(a: ScanAxes, b: ScanAxes) -> bool:
    same = bool((a.along == b.along).all() and (a.across == b.across).all())
    if a.guide is None or b.guide is None:
        return same and a.guide is b.guide
    return same and np.array_equal(a.guide.line, b.guide.line) and np.array_equal(a.guide.origin, b.guide.origin)


def _guide_offset(whole: Subdivision, height: Array) -> float:
    """Return the height of the longest unbroken section, central ones preferred."""
    used = height[whole.faces]
    lo, hi = float(used.min()), float(used.max())
    share = np.linspace(0.1, 0.9, _GUIDES)
    chains = isolines(height, whole.faces, neighbours(whole.faces), lo + share * (hi - lo))
    corner = whole.vertices[whole.faces[chains.face]]
    step = np.einsum("mk,mkj->mj", chains.bary_out - chains.bary_in, corner)
    length = np.zeros(_GUIDES)
    np.maximum.at(length, chains.level, np.bincount(chains.chain, np.linalg.norm(step, axis=1)))
    best = int(np.argmax(np.round(length / length.max(), 6) - 0.2 * np.abs(share - 0.5)))
    return lo + float(share[best]) * (hi - lo)
