"""What of a surface is inspected: cut to a box, or to what was painted, along exact lines whatever the triangles."""

from collections.abc import Callable
from dataclasses import replace
from weakref import ReferenceType, WeakKeyDictionary, ref

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planner.errors import fail
from planner.frames import Array
from planner.part import Part
from planner.setup import Inspection
from planner.shapes import Box, Brush
from planner.surface.curved import CurvedSurface
from planner.surface.inspection import InspectionSurface
from planner.surface.keepouts import PARENTS
from planner.surface.select import welded_faces
from planner.surface.subdivide import Subdivision, split_at_zero, split_long_edges
from planner.surface.topology import edges_of

LEFT_OUT = "left_out_mm2"
"""Key of `Part.meta`: areas (mm2) of pieces that a box or the brush cut off, which are not inspected."""
# Vertices this near to a cut (mm, and share of their edges) lie on it: no slivers beside it.
_SNAP_MM, _SNAP_SHARE = 0.05, 0.05
# Triangles along the rim of a dab are no longer than this share of its radius.
_DAB_SHARE = 0.25
_RINGS = 3


def is_chosen(inspection: Inspection, points: Array) -> NDArray[np.bool_]:
    """Return which points (n, 3) of the surface box and brush leave in (n,)."""
    inside = np.ones(len(points), dtype=bool)
    if inspection.box is not None:
        inside &= _beyond_box(inspection.box, points).max(axis=1) <= 0.0
    if inspection.paint:
        inside &= _unpainted_mm(inspection.paint, points) <= 0.0
    return inside


def clipped(
    surface: InspectionSurface, inspection: Inspection, seeds: Array | None, footprint_mm: float
) -> InspectionSurface:
    """Return what of a surface lies in the box and under the paint of a setup; the largest piece, or that of the seeds.

    Triangles are cut where box or paint end, so `surface.part` is then a copy with more triangles
    (`meta[PARENTS]` holds the row of each as read); new vertices are put on the smooth surface. Pieces left out are
    in `meta[LEFT_OUT]`. Raises EchoBaseError `surface-clipped` if nothing is left.
    """
    if inspection.box is None and not inspection.paint:
        return surface
    key = (surface.part_faces.tobytes(), inspection.box, inspection.paint, None if seeds is None else seeds.tobytes())
    kept = _KNOWN.setdefault(surface.part, {})
    made = kept[key]() if key in kept else None
    if made is None:
        made = _clipped(surface, inspection, seeds, footprint_mm)
        kept.clear()
        kept[key] = ref(made)
    return made


_KNOWN: "WeakKeyDictionary[Part, dict[object, ReferenceType[InspectionSurface]]]" = WeakKeyDictionary()


def _clipped(
    surface: InspectionSurface, inspection: Inspection, seeds: Array | None, footprint_mm: float
) -> InspectionSurface:
    part = surface.part
    s = Subdivision(part.vertices, part.faces, np.arange(len(part.faces)), np.tile(np.eye(3), (len(part.faces), 1, 1)))
    own = np.zeros(len(part.faces), dtype=bool)
    own[surface.part_faces] = True
    if inspection.box is not None:
        for column in range(6):
            s = _cut(s, own, lambda p, c=column: _beyond_box(inspection.box, p)[:, c])  # type: ignore[misc]
    if inspection.paint:
        s = _refined(s, inspection.paint)
        s = _cut(s, own, lambda p: _unpainted_mm(inspection.paint, p))
    chosen = own[s.parent] & is_chosen(inspection, s.vertices[s.faces].mean(axis=1))
    if not chosen.any():
        raise fail(
            "surface-clipped",
            "Nothing of the inspection surface lies inside the box and under the paint.",
            "Correct inspection.box or inspection.paint: they are in CAD coordinates and mm.",
            "setup.json: inspection",
        )
    if len(s.faces) > len(part.faces):
        vertices = _on_smooth(surface, s, len(part.vertices), footprint_mm)
        part = replace(part, vertices=vertices, faces=s.faces, meta=part.meta | {PARENTS: _parents(part, s)})
    rows, left_out = _one_piece(part, np.flatnonzero(chosen), seeds)
    if left_out:
        part = replace(part, meta=part.meta | {LEFT_OUT: left_out})
    return InspectionSurface(part, rows.astype(np.int32))


def _parents(part: Part, s: Subdivision) -> NDArray[np.int64]:
    before = part.meta.get(PARENTS)
    return s.parent if before is None else np.asarray(before[s.parent], dtype=np.int64)


def _beyond_box(box: Box, points: Array) -> Array:
    """Return the heights (n, 6) over the six sides of a box, mm, positive outside."""
    return np.hstack([np.array(box.min_mm) - points, points - np.array(box.max_mm)])


def _unpainted_mm(paint: tuple[Brush, ...], points: Array) -> Array:
    """Return how far points (n, 3) lie outside of what is painted, mm, negative inside; exact at its rim."""
    # What was never painted is out; where erasing comes first, everything was in.
    out = np.full(len(points), -1e9 if paint[0].erase else 1e9)
    for dab in paint:
        away = np.linalg.norm(points - dab.centre_mm, axis=1) - dab.radius_mm
        out = np.maximum(out, -away) if dab.erase else np.minimum(out, away)
    return out


def _refined(s: Subdivision, paint: tuple[Brush, ...]) -> Subdivision:
    """Return the pieces, small along the rim of the paint, largest dabs first."""
    for radius in sorted({d.radius_mm for d in paint}, reverse=True):
        dabs = tuple(d for d in paint if d.radius_mm == radius)

        def wanted(a: Array, b: Array, dabs: tuple[Brush, ...] = dabs) -> NDArray[np.bool_]:
            return _rim_mm(dabs, 0.5 * (a + b)) <= 0.5 * np.linalg.norm(b - a, axis=1) + 1e-9

        corner = s.vertices[s.faces]
        middle = corner.mean(axis=1)
        reach = np.linalg.norm(corner - middle[:, None], axis=2).max(axis=1)
        # Every triangle with an edge that is wanted is among these.
        near = _rim_mm(dabs, middle) <= 2.5 * reach
        fine = split_long_edges(s.vertices, s.faces[near], _DAB_SHARE * radius, wanted)
        inner = np.einsum("nij,njk->nik", fine.bary, s.bary[near][fine.parent])
        s = Subdivision(
            fine.vertices,
            np.concatenate([s.faces[~near], fine.faces]),
            np.concatenate([s.parent[~near], s.parent[near][fine.parent]]),
            np.concatenate([s.bary[~near], inner]),
        )
    return s


def _rim_mm(dabs: tuple[Brush, ...], points: Array) -> Array:
    """Return the distance of points (n, 3) from the nearest of the spheres of some dabs (n,), mm."""
    out = np.full(len(points), np.inf)
    for dab in dabs:
        out = np.minimum(out, np.abs(np.linalg.norm(points - dab.centre_mm, axis=1) - dab.radius_mm))
    return out


def _cut(s: Subdivision, own: NDArray[np.bool_], value: Callable[[Array], Array]) -> Subdivision:
    """Return the pieces cut where a function of place is zero; vertices near the cut count as on it."""
    mine = own[s.parent]
    used = np.zeros(len(s.vertices), dtype=bool)
    used[s.faces[mine]] = True
    values = np.zeros(len(s.vertices))
    values[used] = value(s.vertices[used])
    f = s.faces[mine]
    length = np.linalg.norm(s.vertices[f] - s.vertices[np.roll(f, -1, axis=1)], axis=2)
    shortest = np.full(len(s.vertices), np.inf)
    for k in range(3):
        np.minimum.at(shortest, f[:, k], np.minimum(length[:, k], length[:, (k + 2) % 3]))
    values[np.abs(values) < np.minimum(_SNAP_MM, _SNAP_SHARE * shortest)] = 0.0
    # Only edges of the surface are cut: elsewhere all vertices count as on the line.
    return split_at_zero(s, values)


def _on_smooth(surface: InspectionSurface, s: Subdivision, old: int, footprint_mm: float) -> Array:
    """Return the vertices with the new ones on the smooth surface, as those of a CAD tessellation are."""
    vertices = s.vertices.copy()
    face, corner = np.nonzero(s.faces >= old)
    owner = s.parent[face]
    row = np.full(len(surface.part.faces), -1, dtype=np.int64)
    row[surface.part_faces] = np.arange(len(surface.part_faces))
    mine = row[owner] >= 0
    face, corner, owner = face[mine], corner[mine], owner[mine]
    if not len(face):
        return vertices
    number, first = np.unique(s.faces[face, corner], return_index=True)
    at, bary = row[owner[first]], s.bary[face[first], corner[first]]
    near = np.zeros(len(surface.faces), dtype=bool)
    near[at] = True
    for _ in range(_RINGS):
        touched = np.zeros(len(surface.vertices), dtype=bool)
        touched[surface.faces[near]] = True
        near = np.asarray(touched[surface.faces].any(axis=1))
    rows = np.flatnonzero(near)
    curved = CurvedSurface(InspectionSurface(surface.part, surface.part_faces[rows]), footprint_mm)
    local = np.searchsorted(rows, at).astype(np.int32)
    vertices[number] = curved.evaluate(local, bary)[0]
    return vertices


def _one_piece(part: Part, rows: NDArray[np.intp], seeds: Array | None) -> tuple[NDArray[np.intp], list[float]]:
    """Return the rows of the piece that is inspected, ascending, and the areas (mm2) of those that are not."""
    faces = welded_faces(part)[rows]
    edges = edges_of(faces)
    pair = edges.uses == 2
    n = len(rows)
    graph = coo_array((np.ones(int(pair.sum()), dtype=np.int8), (edges.first[pair], edges.second[pair])), shape=(n, n))
    count, piece = connected_components(graph, directed=False)
    if count == 1:
        return rows, []
    area = np.bincount(piece, part.face_areas_mm2[rows], count)
    best = int(area.argmax())
    if seeds is not None and len(seeds):
        centre = part.vertices[part.faces[rows]].mean(axis=1)
        holds = {int(piece[np.linalg.norm(centre - p, axis=1).argmin()]) for p in seeds}
        best = max(holds, key=lambda k: float(area[k]))
    return rows[piece == best], [float(a) for k, a in enumerate(area) if k != best]
