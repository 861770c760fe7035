"""The alignment path: passes over the surface through the key points, and across the edges where they tell something."""

import numpy as np

from planner.errors import EchoBaseError, fail
from planner.frames import Array
from planner.keypoint import KeyPoint
from planner.path.axes import ScanAxes, raster_axes
from planner.path.bands import beside, passes_allowed
from planner.path.crossings import (
    PATCH_MM,
    PATCH_SIGMA_MM,
    Rim,
    best_crossings,
    edge_rows,
    prior_precision,
    rows,
    usable_rim,
)
from planner.path.cut import tangent
from planner.path.ends import Run, finished, outside, overrun
from planner.path.links import with_links
from planner.path.mesh import PathMesh
from planner.path.oppose import opposed
from planner.path.order import nearest_order
from planner.path.passes import assemble, headings
from planner.path.raster import acquisition_spacing_mm
from planner.path.section import Stroke, positions, section, together
from planner.path.tour import strokes_through
from planner.path.tracks import measure, resample
from planner.path.travel import along_track
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.keepouts import keep_outs_of
from planner.toolpath import ToolPath

MOST_POSES = 1_000_000
_RIM_SPACING_MM = 5.0
# How far inside a crossing of its own begins: long enough to settle, short enough not to fill a small part.
_CROSSING_SHARE, _CROSSING_MM = 0.08, (8.0, 20.0)


def alignment_path(curved: CurvedSurface, keypoints: tuple[KeyPoint, ...], setup: Setup) -> ToolPath:
    """Return the dense alignment path (kind `alignment`, at `alignment_standoff_mm`) through all key points.

    Each pass is a plane section of the surface, so it follows it; where the way turns at a key point a new pass begins,
    for the array turns with the travel. Suggested key points keep to their strips, which narrow probes run several times
    side by side (`bands`); others are visited by a short tour. A pass that ends near an edge goes on to it: with
    `alignment.edges` across it by `edge_overrun_mm`, data on (face -1, on the surface's continuation), wherever the part
    ends there; elsewhere, and without, up to the edge margin. With
    `alignment.edges` crossings are added until the edges on all sides are crossed and all six directions can be found.
    Passes are interrupted at keep-out regions, and edges under them are not crossed.
    Raises `EchoBaseError` where no line over the surface joins two key points.
    """
    return with_links(passes_through(curved, keypoints, setup), curved, setup)


def passes_through(curved: CurvedSurface, keypoints: tuple[KeyPoint, ...], setup: Setup) -> ToolPath:
    """Return the alignment path as `alignment_path` does, without the links between its passes."""
    if not keypoints:
        raise fail(
            "keypoints-missing", "There are no key points.", "Pick at least three, or let EchoBase suggest them."
        )
    mesh = PathMesh.of(curved.surface)
    axes = raster_axes(curved, setup)
    foot = curved.closest(np.array([k.xyz() for k in keypoints]))
    on_mesh = np.einsum("nk,nkj->nj", foot.bary, mesh.vertices[mesh.faces[foot.face]])
    edges = usable_rim(curved.surface, _RIM_SPACING_MM, setup)
    keep = keep_outs_of(curved.surface, setup)
    strips, others = strokes_through(keypoints, foot.points)
    strokes = [_lines(curved, mesh, on_mesh[rows_], foot.normals[rows_], axes) for rows_ in strips + others]
    runs = [finished(mesh, stroke, edges, setup) for some in strokes for stroke in some]
    of_strips = sum(len(some) for some in strokes[: len(strips)])
    count = passes_allowed(curved, setup, sum(run.s1 - run.s0 for run in runs[:of_strips]))
    if count > 1:
        for members in strips:
            more = beside(curved, mesh, on_mesh[members], foot.normals[members], count, setup)
            runs += [finished(mesh, stroke, edges, setup) for stroke in more]
    runs = outside(mesh, runs, keep)
    if setup.alignment.edges:
        extra = _crossings(curved, mesh, runs, edges, axes, setup)
        runs += [piece for piece in outside(mesh, extra, keep) if piece.over]
    if not runs:
        raise fail(
            "alignment-kept-out",
            "The keep-out regions leave nothing of the passes through the key points.",
            "Pick key points away from them, or correct inspection.keep_outs.",
            "keypoints",
        )
    expect_sensible(sum(run.s1 - run.s0 for run in runs), setup)
    return _path(curved, mesh, runs, edges, setup)


def expect_sensible(length_mm: float, setup: Setup) -> None:
    """Raise EchoBaseError `alignment-too-long` for data passes so long that no robot would run them."""
    poses = length_mm / acquisition_spacing_mm(setup)
    if poses > MOST_POSES:
        raise fail(
            "alignment-too-long",
            f"The alignment scan would be {length_mm / 1e6:.1f} km long.",
            "Ask for less alignment.coverage, take a probe with a wider swath, or inspect a smaller surface.",
            "setup.json: alignment.coverage",
        )


def _lines(curved: CurvedSurface, mesh: PathMesh, points: Array, normals: Array, axes: ScanAxes) -> list[Stroke]:
    """Return the strokes through points in order: one plane if they share it, else leg by leg."""
    if len(points) == 1:
        foot = curved.closest(points[0] + np.outer([1.0, -1.0], axes.along) * _CROSSING_MM[1])
        k = int(np.argmax(np.linalg.norm(foot.points - points[0], axis=1)))
        other = np.einsum("k,kj->j", foot.bary[k], mesh.vertices[mesh.faces[foot.face[k]]])
        return section(mesh, np.stack([points[0], other]), np.stack([normals[0], foot.normals[k]]))
    side = np.cross(normals.mean(axis=0), points[-1] - points[0])
    off = np.abs((points - points[0]) @ side) / max(float(np.linalg.norm(side)), 1e-12)
    if len(points) > 2 and float(off.max()) > 1.0:
        return [s for i in range(len(points) - 1) for s in section(mesh, points[i : i + 2], normals[i : i + 2])]
    return section(mesh, points, normals)


def _crossings(
    curved: CurvedSurface, mesh: PathMesh, runs: list[Run], edges: Rim, axes: ScanAxes, setup: Setup
) -> list[Run]:
    """Return short extra passes across edges that nothing crosses yet and that the estimate needs."""
    centre = curved.surface.centroid_part
    precision = _precision(curved, mesh, runs, centre, setup)
    crossed = [run.rim_at(edges, end) for run in runs for end in run.over]
    if crossed:
        j = edge_rows(edges.points[crossed], edges.conormals[crossed], edges.along[crossed], centre, setup).reshape(
            -1, 6
        )
        precision = precision + j.T @ j
    sides = np.stack([axes.along, -axes.along, axes.across, -axes.across])
    out = []
    for k in best_crossings(edges, edges.conormals[crossed], precision, sides, centre, setup):
        extra = _crossing(curved, mesh, edges, k, setup)
        if extra is not None:
            out.append(extra)
    return out


def _precision(curved: CurvedSurface, mesh: PathMesh, runs: list[Run], centre: Array, setup: Setup) -> Array:
    """Return the precision (6, 6) of a motion about `centre`: of the fixture, and of the surface under the runs."""
    precision = prior_precision(setup)
    for run in runs:
        s = np.arange(run.s0, run.s1, PATCH_MM)
        _, bary, face = positions(mesh, run.line, s)
        p, n = curved.evaluate(face.astype(np.int32), bary)
        j = rows(p, n, centre) / PATCH_SIGMA_MM
        precision = precision + j.T @ j
    return precision


def _crossing(curved: CurvedSurface, mesh: PathMesh, edges: Rim, k: int, setup: Setup) -> Run | None:
    """Return the pass from inside across the edge at point k of the rim, or None where no straight way leads there."""
    p, c = edges.points[k], edges.conormals[k]
    size = float(np.sqrt(curved.surface.area_mm2))
    inside = min(float(np.clip(_CROSSING_SHARE * size, *_CROSSING_MM)), size / 4.0)
    foot = curved.closest(np.stack([p - c * inside, p - c * 0.01]))
    on_mesh = np.einsum("nk,nkj->nj", foot.bary, mesh.vertices[mesh.faces[foot.face]])
    try:
        stroke = section(mesh, on_mesh, foot.normals)[-1]
    except EchoBaseError:
        return None
    run = finished(mesh, stroke, edges, setup, only_last=True)
    return run if run.over else None


def _path(curved: CurvedSurface, mesh: PathMesh, runs: list[Run], edges: Rim, setup: Setup) -> ToolPath:
    spacing = acquisition_spacing_mm(setup)
    lengths = measure(mesh, together([Stroke(r.line, r.s0, r.s1, 0.0) for r in runs]))
    s0, s1 = np.array([r.s0 for r in runs]), np.array([r.s1 for r in runs])
    track = resample(lengths, np.arange(len(runs)), s0, s1, np.zeros(len(runs), dtype=bool), spacing)
    first, last = track.bounds()
    order, flip = nearest_order(track.points[first], track.points[last])
    runs = [runs[k] for k in order]
    if setup.alignment.edges:
        centre = curved.surface.centroid_part
        flip = opposed(runs, flip, edges, _precision(curved, mesh, runs, centre, setup), centre, setup)
    track = track.arranged(order, flip)
    points, normals = curved.evaluate(track.face, track.bary)
    travel = tangent(along_track(track, points, spacing), normals)
    over = [tuple(sorted(1 - end if flip[i] else end for end in run.over)) for i, run in enumerate(runs)]
    data = overrun(
        points, normals, travel, curved.surface.part_faces[track.face], track.bary, track.run, over, setup, spacing
    )
    data = data.with_heading(headings(data.points, data.normals, data.travel, data.run, None))
    return assemble(data, "alignment", setup.alignment_standoff_mm, spacing)
