"""The inspection raster."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from planner.errors import fail
from planner.frames import Array
from planner.path.axes import ScanAxes, raster_axes
from planner.path.cut import Cut, tangent
from planner.path.edge_passes import Left, edge_cut, joined, left_by, useful
from planner.path.fence import raster_fence
from planner.path.links import with_links
from planner.path.mesh import PathMesh
from planner.path.order import nearest_order
from planner.path.passes import DataRuns, assemble, headings
from planner.path.raster_geodesic import geodesic_cut
from planner.path.raster_plane import plane_cut
from planner.path.tracks import Tracks, split_at_turns, tracks
from planner.path.travel import along_track, smoothed
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.toolpath import ToolPath

MOST_POSES = 5_000_000
GEOMETRY_SPACING_MM = 5.0
"""Dense poses stand no farther apart than this, however sparse the acquisition, so that they describe the surface."""
_SHARP_DEG = 30.0


def raster(curved: CurvedSurface, setup: Setup) -> ToolPath:
    """Return the dense inspection path (kind `inspection`) over the surface.

    `plane`: sections by parallel planes along `inspection.direction`; `geodesic`: lines of equal distance, measured on the
    surface, from the longest central section along it, or from the line drawn. Both keep the step on the surface, go forth and
    back, hold the array's heading in space, and split at holes and sharp turns. Passes along edges follow, over what all
    these leave beside holes and slanted edges, where that is worth a pass (`edge_passes`).

    The track of the TCP keeps `edge_margin_mm` from the edge at the ends of each pass; across, the swath of the
    outermost pass reaches the margin line. Poses are spaced equally, at `point_spacing_mm` or an integer part of it;
    each carries its triangle and barycentric coordinates, and normals are those of `curved` at that very point.
    Raises `EchoBaseError` if the surface leaves no room or the raster would be unreasonably dense.
    """
    return raster_and_edges(curved, setup)[0]


def raster_and_edges(curved: CurvedSurface, setup: Setup) -> tuple[ToolPath, int]:
    """Return the path of `raster`, and how many of its passes come before those along edges."""
    surface, inspection = curved.surface, setup.inspection
    axes = raster_axes(curved, setup)
    mesh = PathMesh.of(surface)
    cut = (plane_cut if inspection.strategy == "plane" else geodesic_cut)(curved, mesh, axes, setup)
    spacing = acquisition_spacing_mm(setup)
    track = tracks(cut.mesh, cut.chains, spacing, raster_fence(cut.mesh, surface, setup))
    if len(track.run) > MOST_POSES:
        raise fail(
            "raster-too-dense",
            f"The raster would have {len(track.run)} poses.",
            "Give a larger inspection.step_mm or point_spacing_mm, or a smaller surface.",
            "setup.json: inspection",
        )
    if len(track.level) == 0:
        raise fail(
            "raster-empty",
            f"No pass fits on the surface with {inspection.edge_margin_mm:g} mm kept from its edges"
            + (" and the keep-out regions left out." if inspection.keep_outs else "."),
            "Give smaller keep-outs or margins, let the tool cross them (may_cross), or a smaller edge_margin_mm."
            if inspection.keep_outs
            else "Give a smaller inspection.edge_margin_mm, or choose a larger surface.",
            "setup.json: inspection" if inspection.keep_outs else "setup.json: inspection.edge_margin_mm",
        )
    if not cut.exact:
        track = split_at_turns(track, _sharp(track, cut.mesh.face_normals, spacing))
    track = _in_order(track, axes)
    data = _data(curved, cut, track, spacing)
    path = assemble(data, "inspection", setup.standoff_mm, spacing)
    passes = path.passes
    left = left_by(path, curved, setup)
    if left is not None:
        more = _along_edges(curved, left, path, setup, spacing)
        if more is not None:
            path = assemble(joined(data, more), "inspection", setup.standoff_mm, spacing)
    return with_links(path, curved, setup), passes


def _along_edges(curved: CurvedSurface, left: Left, path: ToolPath, setup: Setup, spacing: float) -> DataRuns | None:
    """Return passes along edges that see what the raster left there; None if there are none worth it."""
    cut, track = edge_cut(curved, left, setup, spacing)
    if not len(track.level):
        return None
    track = split_at_turns(track, _sharp(track, cut.mesh.face_normals, spacing))
    return useful(_data(curved, cut, track, spacing), left, path, spacing)


def _data(curved: CurvedSurface, cut: Cut, track: Tracks, spacing: float) -> DataRuns:
    """Return the DATA poses of tracks: on the smooth surface, travel and heading of each pass."""
    face, bary = cut.on_surface(track.face, track.bary)
    points, normals = curved.evaluate(face, bary)
    across = cut.across(track.face, normals)
    if not cut.exact:
        aside = smoothed(track, points, across, spacing)
        face, bary, points, normals = _moved(curved, face, bary, points, aside[:, None] * across)
    travel = _travel(track, points, normals, across, spacing, cut.exact)
    heading = headings(points, normals, travel, track.run, across)
    return DataRuns(points, normals, travel, curved.surface.part_faces[face], bary, track.run, heading)


def acquisition_spacing_mm(setup: Setup) -> float:
    """Return the spacing of dense poses: `point_spacing_mm`, or an integer part of it up to `GEOMETRY_SPACING_MM`."""
    asked = setup.inspection.point_spacing_mm
    return asked / float(np.ceil(asked / GEOMETRY_SPACING_MM - 1e-9))


def _moved(
    curved: CurvedSurface, face: NDArray[np.int32], bary: Array, points: Array, shift: Array
) -> tuple[NDArray[np.int32], Array, Array, Array]:
    """Return faces, barycentrics, points and normals (n, ...) of points of the surface moved along it by a little."""
    corner = curved.surface.vertices[curved.surface.faces[face]]
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    uu, uv, vv = (np.einsum("ij,ij->i", a, b) for a, b in ((u, u), (u, v), (v, v)))
    su, sv = (np.einsum("ij,ij->i", shift, a) for a in (u, v))
    det = uu * vv - uv * uv
    sound = det > 1e-12 * uu * vv
    det = np.where(sound, det, 1.0)
    db, dc = (vv * su - uv * sv) / det, (uu * sv - uv * su) / det
    new = bary + np.stack([-db - dc, db, dc], axis=1)
    inside = sound & (new.min(axis=1) >= 0.0)
    face, bary = face.copy(), np.where(inside[:, None], new, bary)
    left = np.flatnonzero(~inside & (np.abs(shift).max(axis=1) > 0.0))
    if len(left):
        foot = curved.closest(points[left] + shift[left])
        face[left], bary[left] = foot.face, foot.bary
    return face, bary, *curved.evaluate(face, bary)


def _sharp(track: Tracks, face_normals: Array, spacing: float) -> NDArray[np.bool_]:
    """Return the points (n,) where a track turns sharply within the surface: the sharpest one of each corner."""
    n = len(track.run)
    sharp = np.zeros(n, dtype=bool)
    w = max(int(np.ceil(3.0 / spacing)), 1)
    i = np.arange(w, n - w)
    i = i[track.run[i - w] == track.run[i + w]]
    if not len(i):
        return sharp
    up = face_normals[track.face[i]]
    back, ahead = (
        tangent(d, up) for d in (track.points[i] - track.points[i - w], track.points[i + w] - track.points[i])
    )
    turn = np.zeros(n)
    turn[i] = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", back, ahead), -1.0, 1.0)))
    top = maximum_filter1d(turn, 2 * w + 1)
    return (turn >= top) & (turn > _SHARP_DEG)


def _in_order(track: Tracks, axes: ScanAxes) -> Tracks:
    """Return the runs in the order they are travelled; loops alternate, so that hoses do not wind up."""
    first, last = track.bounds()
    start, end = track.points[first], track.points[last]
    order, flip = nearest_order(start, end)
    if bool((end[0] - start[0]) @ axes.along < 0) and not track.closed[0]:
        order, flip = nearest_order(end, start)
        flip = ~flip
    loops = track.closed[order]
    flip = np.where(loops, np.cumsum(loops) % 2 == 0, flip)
    return track.arranged(order, flip)


def _travel(track: Tracks, points: Array, normals: Array, across: Array, spacing: float, exact: bool) -> Array:
    """Return the direction of travel (n, 3), unit and tangent; smooth, for the array turns with it."""
    if not exact:
        return tangent(along_track(track, points, spacing), normals)
    straight = np.cross(across, normals)
    rough = _forwards(track)
    straight *= np.where(np.einsum("ij,ij->i", straight, rough) < 0, -1.0, 1.0)[:, None]
    # Where a plane only grazes the surface, its line is all there is to go by.
    grazing = np.linalg.norm(straight, axis=1) < 0.5
    straight[grazing] = tangent(rough, normals)[grazing]
    return straight


def _forwards(track: Tracks) -> Array:
    """Return differences (n, 3) to the next point of the run; of the last, from the one before."""
    first, last = track.bounds()
    ahead = np.diff(track.points, axis=0, append=track.points[-1:])
    ahead[last] = ahead[np.maximum(last - 1, first)]
    return ahead
