"""Which triangles of a part are inspected: flooded from seeds up to the creases, or the largest smooth face."""

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planner.errors import fail
from planner.frames import Array
from planner.part import Part
from planner.shapes import Box
from planner.surface.facing import facing
from planner.surface.inspection import InspectionSurface
from planner.surface.normals import lengths
from planner.surface.topology import Edges, Index, edges_of, weld, weld_tolerance_mm

SEED_REACH_MM = 2.0
SAME_SIZE = 0.01
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Regions:
    """Smooth regions of a part: label (f,) per triangle, area_mm2 (r,), area-weighted mean normals (r, 3), unit or zero."""

    label: NDArray[np.int64]
    area_mm2: Array
    normals: Array


def inspection_surface(
    part: Part,
    seeds_part: ArrayLike | None = None,
    up_part: ArrayLike | None = None,
    crease_deg: float = 30.0,
    max_turn_deg: float | None = None,
    box: Box | None = None,
) -> InspectionSurface:
    """Return the inspection surface of a part.

    seeds_part (n, 3) or (3,), mm: the region flooded from the triangle nearest each seed, across edges whose dihedral
    angle is below crease_deg. Without seeds: the largest such region (with a box: the one with most area in it); of
    regions within 1 % of it the one that faces up_part (3,) most (default +Z), of these the topmost. A flood runs through
    tangent fillets, which have no crease, into the side walls: max_turn_deg stops it where the facets have turned by more
    than that from the seed's (or from up_part).

    Triangles that touch within rounding are joined even if the file does not share their vertices; edges of three or
    more faces are treated as creases. An open sheet has two sides of one size: the one that faces up_part is meant, and
    if the file winds it the other way `surface.part` is a copy wound towards up_part (`facing_issues` says so).

    Errors: `seed-off-part` (farther than 2 mm), `seeds-apart` (several regions that do
    not touch), `surface-turn` (nothing within max_turn_deg).
    """
    seeds = None if seeds_part is None else np.asarray(seeds_part, dtype=np.float64).reshape(-1, 3)
    up = np.asarray(UP if up_part is None else up_part, dtype=np.float64).reshape(3)
    up = up / np.linalg.norm(up)
    edges = part_edges(part)
    start = _seed_faces(part, seeds) if seeds is not None and len(seeds) else None
    allowed = _facing(part, up if start is None else part.face_normals[start].mean(axis=0), max_turn_deg)
    regions = smooth_regions(part, edges, crease_deg, allowed)
    if start is None:
        chosen = [_largest(part, regions if box is None else _in_box(part, regions, box), up)]
    else:
        chosen = sorted(set(regions.label[start].tolist()))
        _expect_one_piece(part, edges, regions, chosen, seeds)
    picked = np.flatnonzero(np.isin(regions.label, chosen) & allowed).astype(np.int32)
    return facing(InspectionSurface(part, picked), edges, up)


def welded_faces(part: Part) -> Index:
    """Return the faces (f, 3) of a part with vertices that coincide within rounding made one; kept as long as it lives."""
    known = _WELDED.get(part)
    if known is None:
        same = weld(part.vertices, weld_tolerance_mm(part.vertices))
        known = _WELDED[part] = np.asarray(same[part.faces], dtype=np.int64)
    return known


def part_edges(part: Part) -> Edges:
    """Return the edges of the welded faces of a part; kept as long as it lives."""
    known = _EDGES.get(part)
    if known is None:
        known = _EDGES[part] = edges_of(welded_faces(part))
    return known


_WELDED: "WeakKeyDictionary[Part, Index]" = WeakKeyDictionary()
_EDGES: "WeakKeyDictionary[Part, Edges]" = WeakKeyDictionary()


def dihedral_rad(part: Part, edges: Edges) -> Array:
    """Return the angle between the two faces at every edge (e,) of the part, rad, 0 for coplanar; pi where there are not two.

    Faces that walk their edge the same way are wound against each other: the angle is then taken with one of them turned.
    A sliver has no normal of its own: it counts as part of the face across its longest edge.
    """
    angle = np.full(len(edges.uses), np.pi)
    pair = np.flatnonzero(edges.uses == 2)
    normals = _normals_without_slivers(part, edges)
    a, b = normals[edges.first[pair]], normals[edges.second[pair]]
    sine, cosine = lengths(np.cross(a, b)), np.einsum("ij,ij->i", a, b)
    angle[pair] = np.arctan2(sine, np.where(same_winding(edges)[pair], cosine, -cosine))
    return angle


def _normals_without_slivers(part: Part, edges: Edges) -> Array:
    """Return face normals (f, 3); those of triangles thinner than rounding are taken from the face across the longest edge."""
    ends = part.vertices[part.faces]
    a, b, c = (lengths(ends[:, (k + 2) % 3] - ends[:, (k + 1) % 3]) for k in range(3))
    longest = np.where(c > np.maximum(a, b), 2, np.where(b > a, 1, 0))
    height = 2.0 * part.face_areas_mm2 / np.maximum(np.maximum(np.maximum(a, b), c), 1e-30)
    thin = np.flatnonzero(height < 4.0 * weld_tolerance_mm(part.vertices))
    if not len(thin):
        return part.face_normals
    normals = part.face_normals.copy()
    edge = edges.of_face[thin, longest[thin]]
    across = np.where(edges.first[edge] == thin, edges.second[edge], edges.first[edge])
    across = np.where(edges.uses[edge] == 2, across, thin)
    for _ in range(3):  # slivers lie against slivers, rarely more than two deep
        normals[thin] = normals[across]
    return normals


def same_winding(edges: Edges) -> NDArray[np.bool_]:
    """Return for edges of two faces whether these are wound alike, that is walk the edge in opposite ways (e,)."""
    ways = np.bincount(edges.of_face.ravel(), edges.forward.ravel(), len(edges.uses))
    return np.asarray((edges.uses != 2) | (ways == 1))


def smooth_regions(part: Part, edges: Edges, crease_deg: float, allowed: NDArray[np.bool_]) -> Regions:
    """Return the regions into which creases, non-manifold edges and faces not `allowed` (f,) cut the part."""
    smooth = np.flatnonzero((edges.uses == 2) & (dihedral_rad(part, edges) < np.radians(crease_deg)))
    a, b = edges.first[smooth], edges.second[smooth]
    joined = allowed[a] & allowed[b]
    f = len(part.faces)
    graph = coo_array((np.ones(int(joined.sum()), dtype=np.int8), (a[joined], b[joined])), shape=(f, f))
    count, label = connected_components(graph, directed=False)
    areas = np.where(allowed, part.face_areas_mm2, 0.0)
    total = np.asarray(np.bincount(label, areas, count), dtype=np.float64)
    normals = np.stack([np.bincount(label, areas * part.face_normals[:, k], count) for k in range(3)], axis=1)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 1e-9 * total[:, None])
    return Regions(label.astype(np.int64), total, normals)


def _largest(part: Part, regions: Regions, up: Array) -> int:
    alike = np.flatnonzero(regions.area_mm2 >= (1.0 - SAME_SIZE) * regions.area_mm2.max())
    # Rounded, so that the order of the file decides between equals and not the last bit.
    facing = np.round(regions.normals[alike] @ up, 6)
    best = alike[facing == facing.max()]
    if len(best) == 1:
        return int(best[0])
    # Of several bodies that face alike the topmost is in reach of the probe.
    height = part.vertices[part.faces].mean(axis=1) @ up
    mean = [float(np.round(height[regions.label == r].mean(), 3)) for r in best]
    return int(best[int(np.argmax(mean))])


def _in_box(part: Part, regions: Regions, box: Box) -> Regions:
    """Return the regions with the areas they have in a box: of every triangle the share of its bounds that lies inside.

    A ranking, no measure: exact where triangles are small. Nothing in the box at all leaves the areas as they were.
    """
    corners = part.vertices[part.faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    inside = np.minimum(high, box.max_mm) - np.maximum(low, box.min_mm)
    size = np.maximum(high - low, 1e-9)
    share = np.prod(np.clip((inside + 1e-9) / size, 0.0, 1.0), axis=1) * (inside >= 0.0).all(axis=1)
    area = np.bincount(regions.label, part.face_areas_mm2 * share, len(regions.area_mm2)).astype(np.float64)
    return replace(regions, area_mm2=area) if area.any() else regions


def _seed_faces(part: Part, seeds: Array) -> NDArray[np.int64]:
    if not np.isfinite(seeds).all():
        raise fail("seed-invalid", "A seed point is not a finite number.", "Give X,Y,Z in mm.")
    vertices, faces = np.ascontiguousarray(part.vertices), np.ascontiguousarray(part.faces, dtype=np.int64)
    squared, face, _ = igl.point_mesh_squared_distance(seeds, vertices, faces)
    for i, gap in enumerate(np.sqrt(np.atleast_1d(squared))):
        if gap > SEED_REACH_MM:
            x, y, z = seeds[i]
            raise fail(
                "seed-off-part",
                f"The point ({x:.3f}, {y:.3f}, {z:.3f}) mm lies {gap:.2f} mm from the part.",
                f"Give a point within {SEED_REACH_MM:g} mm of the surface, in CAD coordinates and mm.",
                f"seed {i + 1}",
            )
    return np.atleast_1d(face)


def _facing(part: Part, direction: Array, max_turn_deg: float | None) -> NDArray[np.bool_]:
    if max_turn_deg is None:
        return np.ones(len(part.faces), dtype=bool)
    length = np.linalg.norm(direction)
    cosine = part.face_normals @ (direction / length if length > 0 else direction)
    allowed = np.asarray(cosine >= np.cos(np.radians(max_turn_deg)))
    if not allowed.any():
        raise fail(
            "surface-turn",
            f"No face of the part is within {max_turn_deg:g} deg of the direction asked.",
            "Raise max_turn_deg.",
        )
    return allowed


def _expect_one_piece(part: Part, edges: Edges, regions: Regions, chosen: list[int], seeds: Array | None) -> None:
    """Raise unless the regions chosen touch each other along edges, so that their union is one surface."""
    if len(chosen) == 1:
        return
    shared = edges.uses == 2
    ends = np.stack([regions.label[edges.first[shared]], regions.label[edges.second[shared]]], axis=1)
    ends = ends[np.isin(ends, chosen).all(axis=1)]
    index = {region: i for i, region in enumerate(chosen)}
    rows = np.array([[index[int(a)], index[int(b)]] for a, b in np.unique(ends, axis=0)]).reshape(-1, 2)
    n = len(chosen)
    count, _ = connected_components(
        coo_array((np.ones(len(rows)), (rows[:, 0], rows[:, 1])), shape=(n, n)), directed=False
    )
    if count > 1:
        raise fail(
            "seeds-apart",
            f"The seeds lie on {count} surfaces that do not touch, of "
            + ", ".join(f"{regions.area_mm2[c]:.0f}" for c in chosen)
            + " mm2.",
            "Inspect one surface at a time: keep the seeds or key points of one of them.",
        )
