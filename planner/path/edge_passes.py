"""Passes along edges, over what the raster leaves there: beside holes, and between the ends of passes at slanted edges."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planner.frames import Array
from planner.path.coverage import missed_near_edges
from planner.path.cut import Cut, tangent, towards_higher
from planner.path.fence import Fence
from planner.path.isolines import Ints, isolines, neighbours
from planner.path.mesh import PathMesh
from planner.path.order import nearest_order
from planner.path.passes import DataRuns
from planner.path.swath import effective_half_mm
from planner.path.tracks import Tracks, tracks
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.keepouts import keep_outs_of
from planner.surface.subdivide import split_long_edges
from planner.toolpath import ToolPath

WORTH_MM2 = 40.0
"""What an extra pass has to add to what is covered to be worth its approach."""
# Neighbouring passes leave nothing wider than this (mm) where they overlap that far.
_LEAST_SLACK_MM = 2.0
# Useful stretches nearer to each other than this are one pass: leaving and approaching takes longer.
_JOIN_MM = 200.0
_MOST_TURN_RAD = np.radians(100.0)
_LOW_SHARE = 20
_INSIDE = 0.97


@dataclass(frozen=True, eq=False)
class Left:
    """Samples that the raster does not see: points, normals (n, 3), area_mm2 (n,) each stands for; half_mm: half the
    swath that sees within tolerance there, whichever way the array stands."""

    points: Array
    normals: Array
    area_mm2: Array
    half_mm: float


def slack_mm(setup: Setup) -> float:
    """Return how far (mm) beside the middle of a pass its neighbour leaves the surface to it; 0 where gaps are asked for."""
    inspection, swath = setup.inspection, setup.probe.swath_mm
    step = inspection.step_mm if inspection.step_mm is not None else (1.0 - inspection.overlap) * swath
    return float(max(step - swath / 2.0, 0.0)) if step <= swath else 0.0


def left_by(path: ToolPath, curved: CurvedSurface, setup: Setup) -> Left | None:
    """Return what a raster leaves near edges outside of their margin; None where it is not worth a pass."""
    mesh = PathMesh.of(curved.surface)
    if slack_mm(setup) < _LEAST_SLACK_MM or not len(mesh.boundary_edges):
        return None
    samples, points, normals = missed_near_edges(curved, path, setup)
    if float(samples.area_mm2.sum()) < WORTH_MM2:
        return None
    bend = np.abs(np.linalg.eigvalsh(curved.shape_operator(samples.face, samples.bary))).max(axis=1)
    # Bent alike in both directions: as bad as the array may stand.
    shape = bend[:, None, None] * np.eye(3)
    half = effective_half_mm(shape, np.tile([1.0, 0.0, 0.0], (len(bend), 1)), setup)
    return Left(points, normals, samples.area_mm2, float(np.percentile(half, _LOW_SHARE)))


def edge_cut(curved: CurvedSurface, left: Left, setup: Setup, spacing_mm: float) -> tuple[Cut, Tracks]:
    """Return the lines along all edges whose swath begins at the margin, as lines on finer triangles, and their tracks."""
    mesh = PathMesh.of(curved.surface)
    margin = setup.inspection.edge_margin_mm
    away = margin + _INSIDE * left.half_mm
    size = float(np.linalg.norm(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0)))
    fine = split_long_edges(mesh.vertices, mesh.faces, max(left.half_mm / 2.0, size / 200.0))
    distance = np.minimum(mesh.boundary_distance(fine.vertices, 2.0 * away), 2.0 * away)
    lines = isolines(distance, fine.faces, neighbours(fine.faces), np.array([away]))
    inward = towards_higher(fine, distance)

    def across(face: NDArray[np.int32], normals: Array) -> Array:
        return tangent(inward[face], normals)

    cut = Cut(PathMesh(fine.vertices, fine.faces), lines, across, exact=False, fine=fine)
    fence = Fence(mesh, margin, margin, keep_outs_of(curved.surface, setup))
    return cut, tracks(cut.mesh, lines, spacing_mm, fence)


def useful(lines: DataRuns, left: Left, raster: ToolPath, spacing_mm: float) -> DataRuns | None:
    """Return the stretches of lines that see what was left, each worth a pass, in order after the raster.

    None turns by more than about a right angle, and their array stands as little turned from the raster's as it can.
    """
    tree = cKDTree(lines.points)
    reach = float(np.hypot(left.half_mm, 2.0 * spacing_mm))
    _, near = tree.query(left.points, distance_upper_bound=reach)
    hit = np.flatnonzero(near < len(lines.points))
    off = left.points[hit] - lines.points[near[hit]]
    seen = np.abs(np.einsum("ij,ij->i", off, lines.travel[near[hit]])) <= 2.0 * spacing_mm
    seen &= np.einsum("ij,ij->i", left.normals[hit], lines.normals[near[hit]]) > 0.0
    gain = np.bincount(near[hit][seen], left.area_mm2[hit][seen], len(lines.points)).astype(np.float64)
    pieces = _stretches(lines, gain, spacing_mm)
    if not pieces:
        return None
    start, end = (lines.points[[p[k] for p in pieces]] for k in (0, -1))
    last = raster.Ts_part_contact.xyz_mm[np.flatnonzero(raster.is_data)[-1]]
    first = int(np.linalg.norm(start - last, axis=1).argmin())
    order, flip = nearest_order(start, end, first)
    rows = np.concatenate([pieces[k][::-1] if back else pieces[k] for k, back in zip(order, flip, strict=True)])
    size = [len(pieces[k]) for k in order]
    run = np.repeat(np.arange(len(order)), size)
    travel = lines.travel[rows] * np.repeat(np.where(flip, -1.0, 1.0), size)[:, None]
    normals = lines.normals[rows]
    array = raster.Ts_part_tcp.rotation_matrix[raster.is_data][:, :, 0].mean(axis=0)
    y = np.cross(normals, travel)
    heading = np.where(np.bincount(run, y @ array) >= 0.0, 1, -1).astype(np.int8)
    return DataRuns(
        lines.points[rows], normals, travel, lines.face[rows], lines.bary[rows], run.astype(np.int64), heading
    )


def joined(a: DataRuns, b: DataRuns) -> DataRuns:
    """Return the runs of a, then those of b."""
    return DataRuns(
        np.concatenate([a.points, b.points]),
        np.concatenate([a.normals, b.normals]),
        np.concatenate([a.travel, b.travel]),
        np.concatenate([a.face, b.face]),
        np.concatenate([a.bary, b.bary]),
        np.concatenate([a.run, b.run + len(a.heading)]),
        np.concatenate([a.heading, b.heading]),
    )


def _stretches(lines: DataRuns, gain: Array, spacing_mm: float) -> list[Ints]:
    """Return the rows of stretches that gain enough, from their first useful row to their last."""
    row = np.flatnonzero(gain > 0.0)
    if not len(row):
        return []
    gap = np.diff(row) * spacing_mm
    cuts = np.flatnonzero((np.diff(lines.run[row]) != 0) | (gap > _JOIN_MM)) + 1
    out: list[Ints] = []
    for part in np.split(row, cuts):
        first, last = (
            np.searchsorted(lines.run, lines.run[part[0]]),
            np.searchsorted(lines.run, lines.run[part[0]], "right"),
        )
        rows = np.arange(max(part[0] - 1, first), min(part[-1] + 2, last))
        ahead, up = lines.travel[rows], lines.normals[rows]
        turn = np.arctan2(
            np.einsum("ij,ij->i", np.cross(ahead[:-1], ahead[1:]), up[:-1]),
            np.einsum("ij,ij->i", ahead[:-1], ahead[1:]),
        )
        turned = np.concatenate([[0.0], np.cumsum(turn)])
        pieces = max(int(np.ceil(float(np.ptp(turned)) / _MOST_TURN_RAD)), 1)
        level = np.minimum(
            (np.abs(turned - turned[0]) / max(float(np.ptp(turned)), 1e-9) * pieces).astype(int), pieces - 1
        )
        some = np.split(rows, np.flatnonzero(np.diff(level) != 0) + 1)
        out += [r for r in some if len(r) >= 2 and gain[r].sum() >= WORTH_MM2]
    return out
