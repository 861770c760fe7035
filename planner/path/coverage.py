"""What the array sweeps of the surface, and what of that within tolerance; in mm2."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planner.frames import Array
from planner.path.isolines import Ints
from planner.path.mesh import PathMesh
from planner.path.passes import LEAD_MM
from planner.path.sampling import Samples, sample_equal_area, sample_every_face
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.inspection import InspectionSurface
from planner.surface.keepouts import keep_outs_of
from planner.toolpath import ToolPath

_SAMPLES = 120_000
_CANDIDATES = 12
# Samples beside edges need stand for no less than this.
_FINE_MM2 = 2.0
_EPS_MM = 1e-6


@dataclass(frozen=True, eq=False)
class Coverage:
    """Areas of the inspection surface, mm2: whole, swept, swept within tolerance, missed (not swept within tolerance).

    kept_out_mm2: what lies in keep-out regions, neither swept nor missed. swept_share, within_share: 0..1 of the rest.
    Why of the missed area, each once: margin_mm2 lies in the edge margin, where no pass was asked for; beside_mm2 in the
    room that passes keep from keep-outs; beyond_mm2 was swept, but by laws whose own tilt or standoff is out of tolerance.
    seen: the samples behind the figures.
    """

    area_mm2: float
    swept_mm2: float
    swept_share: float
    within_tolerance_mm2: float
    within_share: float
    missed_mm2: float
    margin_mm2: float
    beside_mm2: float
    beyond_mm2: float
    kept_out_mm2: float
    seen: "Seen"

    @cached_property
    def face_share(self) -> Array:
        """Swept share of every triangle of the surface (k,)."""
        return self.seen.per_face(self.seen.swept)

    @cached_property
    def face_within_share(self) -> Array:
        """Share of every triangle swept within tolerance (k,)."""
        return self.seen.per_face(self.seen.within)

    @property
    def unexplained_mm2(self) -> float:
        """What was missed for no other reason than that no pass reaches it (mm2)."""
        return self.missed_mm2 - self.margin_mm2 - self.beside_mm2 - self.beyond_mm2

    @property
    def share(self) -> float:
        """Swept share of the surface, 0..1: the coverage of an alignment scan."""
        return self.swept_share


@dataclass(frozen=True, eq=False)
class Seen:
    """The samples of a coverage on a surface: where they are, and which of them (n,) are swept, and within tolerance."""

    surface: InspectionSurface
    samples: Samples
    swept: NDArray[np.bool_]
    within: NDArray[np.bool_]

    def per_face(self, mark: NDArray[np.bool_]) -> Array:
        """Return the marked share of every triangle (k,); where a triangle has no sample, that of the nearest which has."""
        face, area, k = self.samples.face, self.samples.area_mm2, len(self.surface.part_faces)
        whole = np.bincount(face, area, k)
        share = np.bincount(face, area * mark, k) / np.maximum(whole, 1e-300)
        empty = np.flatnonzero(whole == 0.0)
        if len(empty):
            middle = self.surface.vertices[self.surface.faces].mean(axis=1)
            known = np.flatnonzero(whole > 0.0)
            share[empty] = share[known[cKDTree(middle[known]).query(middle[empty])[1]]]
        return share


@dataclass(frozen=True, eq=False)
class _Poses:
    """DATA poses: points, normals, travel, array axes (n, 3); first, last (n,): rows where their run of data begins, ends;
    spacing (n,): mean distance of the poses of that run."""

    points: Array
    normals: Array
    travel: Array
    arrays: Array
    first: Ints
    last: Ints
    spacing: Array

    @cached_property
    def columns(self) -> dict[str, Array]:
        """The arrays by coordinate (3, n)."""
        return {k: np.ascontiguousarray(getattr(self, k).T) for k in ("points", "normals", "travel", "arrays")}


def coverage(curved: CurvedSurface, path: ToolPath, setup: Setup) -> Coverage:
    """Return what the DATA motion of a path covers of the surface.

    Swept: within half a swath (laws x pitch; the beam of a single crystal) either side of the way from one DATA pose to
    the next of the same pass, overlaps once, only what lies on the surface. Within tolerance: there the law that fires at
    the point meets the surface within `tolerances.tilt_deg`, at a standoff within `tolerances.standoff_mm` of the TCP's.
    Measured at some hundred thousand evenly spread points; several passes over a point count by the best.
    """
    surface = curved.surface
    few = len(surface.part_faces) < _SAMPLES
    samples = sample_every_face(surface, _SAMPLES) if few else sample_equal_area(surface.face_areas_mm2, _SAMPLES)
    points, normals = curved.evaluate(samples.face, samples.bary)
    kept = keep_outs_of(surface, setup).inside(points)
    swept = np.zeros(len(points), dtype=bool)
    within = np.zeros(len(points), dtype=bool)
    poses = _poses(path)
    if poses is not None:
        _sweep(points, normals, poses, setup, swept, within)
    return _summary(curved, samples, points, swept & ~kept, within & ~kept, kept, setup)


def swept_share(curved: CurvedSurface, path: ToolPath, setup: Setup, samples: int = 30_000) -> float:
    """Return the swept share of the surface, 0..1, from fewer samples: for planners that try many paths."""
    s = sample_equal_area(curved.surface.face_areas_mm2, samples)
    points, normals = curved.evaluate(s.face, s.bary)
    swept = np.zeros(len(points), dtype=bool)
    poses = _poses(path)
    if poses is not None:
        _sweep(points, normals, poses, setup, swept, np.zeros_like(swept))
    free = ~keep_outs_of(curved.surface, setup).inside(points)
    return float((swept & free).sum() / max(int(free.sum()), 1))


def missed_near_edges(curved: CurvedSurface, path: ToolPath, setup: Setup) -> tuple[Samples, Array, Array]:
    """Return samples, their points and normals (n, 3), that no DATA motion sweeps, near edges.

    Within two swaths of the boundary, outside of the edge margin and of the room that passes keep from keep-outs.
    """
    margin, swath = setup.inspection.edge_margin_mm, setup.probe.swath_mm
    count = int(np.clip(curved.surface.area_mm2 / _FINE_MM2, _SAMPLES // 10, _SAMPLES))
    s = sample_equal_area(curved.surface.face_areas_mm2, count)
    points, normals = curved.evaluate(s.face, s.bary)
    edge = PathMesh.of(curved.surface).boundary_distance(points, margin + 2.0 * swath)
    row = np.flatnonzero(np.isfinite(edge) & (edge > margin))
    keep = keep_outs_of(curved.surface, setup)
    if len(keep):
        row = row[keep.room_mm(points[row], LEAD_MM) >= 0.0]
    points, normals = points[row], normals[row]
    swept = np.zeros(len(row), dtype=bool)
    poses = _poses(path)
    if poses is not None and len(row):
        _sweep(points, normals, poses, setup, swept, np.zeros_like(swept))
    row, points, normals = row[~swept], points[~swept], normals[~swept]
    return Samples(s.face[row], s.bary[row], s.area_mm2[row]), points, normals


def _poses(path: ToolPath) -> _Poses | None:
    row = np.flatnonzero(path.is_data)
    if not len(row):
        return None
    axes, p = path.Ts_part_contact.rotation_matrix[row], path.Ts_part_contact.xyz_mm[row]
    new = np.concatenate([[True], (np.diff(row) > 1) | (np.diff(path.pass_id[row]) != 0)])
    run = np.cumsum(new) - 1
    start = np.flatnonzero(new)
    end = np.append(start[1:], len(row)) - 1
    step = np.concatenate([[0.0], np.linalg.norm(np.diff(p, axis=0), axis=1)])
    step[new] = 0.0
    mean = np.bincount(run, step) / np.maximum(end - start, 1)
    return _Poses(p, axes[:, :, 2], axes[:, :, 0], axes[:, :, 1], start[run], end[run], np.maximum(mean, 1e-3)[run])


def _sweep(
    points: Array, normals: Array, poses: _Poses, setup: Setup, swept: NDArray[np.bool_], within: NDArray[np.bool_]
) -> None:
    """Mark the samples swept, and swept within tolerance: first by the nearest pose, then by all tracks in reach."""
    half = setup.probe.swath_mm / 2.0
    reach = 1.2 * half + float(poses.spacing.max())
    tree = cKDTree(poses.points, balanced_tree=False, compact_nodes=False)
    distance, near = tree.query(points, distance_upper_bound=reach, workers=2)
    todo = np.flatnonzero(np.isfinite(distance))
    _test(points, normals, todo, near[todo], poses, setup, swept, within)
    todo = todo[~within[todo]]
    if not len(todo):
        return
    rank = np.arange(len(poses.first)) - poses.first
    stride = np.maximum(np.floor(half / 2.0 / poses.spacing), 1.0).astype(np.int64)
    thin = np.flatnonzero((rank % stride == 0) | (np.arange(len(rank)) == poses.last))
    k = min(_CANDIDATES, len(thin))
    tree = cKDTree(poses.points[thin], balanced_tree=False, compact_nodes=False)
    distance, near = tree.query(points[todo], k=k, distance_upper_bound=reach, workers=2)
    distance, near = distance.reshape(len(todo), k), near.reshape(len(todo), k)
    for c in range(k):
        open_ = np.flatnonzero(np.isfinite(distance[:, c]) & ~within[todo])
        if not len(open_):
            continue
        i = thin[near[open_, c]]
        x = points[todo[open_]]
        along = np.einsum("ij,ij->i", x - poses.points[i], poses.travel[i])
        i = np.clip(i + np.round(along / poses.spacing[i]).astype(np.int64), poses.first[i], poses.last[i])
        _test(points, normals, todo[open_], i, poses, setup, swept, within)


def _test(
    points: Array,
    normals: Array,
    sample: Ints,
    pose: Ints,
    poses: _Poses,
    setup: Setup,
    swept: NDArray[np.bool_],
    within: NDArray[np.bool_],
) -> None:
    """Mark samples that lie under the motion from the poses to their successors, or from their predecessors."""
    half = setup.probe.swath_mm / 2.0
    least = np.cos(np.radians(setup.tolerances.tilt_deg))
    # By coordinate: rows of three take numpy several times as long.
    at, travel = poses.columns["points"], poses.columns["travel"]
    x = [points[sample, k] for k in range(3)]
    past = _past(x, at, travel, pose)
    ahead = past >= 0.0
    a = np.where(ahead, pose, np.maximum(pose - 1, poses.first[pose]))
    b = np.where(ahead, np.minimum(pose + 1, poses.last[pose]), pose)
    # Between the planes of the two array positions: signed distances past the first and short of the second.
    rest = _past(x, at, travel, np.where(ahead, b, a))
    past, short = np.where(ahead, past, rest), np.where(ahead, -rest, -past)
    between = np.flatnonzero((past >= -_EPS_MM) & (short >= -_EPS_MM) & (a != b))
    s, i, j = sample[between], a[between], b[between]
    f = (past[between] / np.maximum(past[between] + short[between], 1e-9)).clip(0.0, 1.0)

    def mean(name: str) -> list[Array]:
        return [(1.0 - f) * c[i] + f * c[j] for c in poses.columns[name]]

    middle, array, up = mean("points"), mean("arrays"), mean("normals")
    off = [x[k][between] - middle[k] for k in range(3)]
    scale = 1.0 / np.sqrt(_dot(up, up))
    height = np.abs(_dot(off, up)) * scale
    facing = _dot(up, [normals[s, k] for k in range(3)]) * scale
    hit = (np.abs(_dot(off, array)) <= half) & (height <= half + setup.standoff_mm) & (facing > 0.0)
    swept[s[hit]] = True
    within[s[hit & (facing >= least) & (height <= setup.tolerances.standoff_mm)]] = True


def _past(x: list[Array], at: Array, travel: Array, pose: Ints) -> Array:
    """Return how far (n,), mm, points by coordinate stand past poses along their travel."""
    return _dot([x[k] - at[k][pose] for k in range(3)], [travel[k][pose] for k in range(3)])


def _dot(a: Sequence[Array], b: Sequence[Array]) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _summary(
    curved: CurvedSurface,
    samples: Samples,
    points: Array,
    swept: NDArray[np.bool_],
    within: NDArray[np.bool_],
    kept: NDArray[np.bool_],
    setup: Setup,
) -> Coverage:
    area = samples.area_mm2
    asked = float(area[~kept].sum())
    margin = setup.inspection.edge_margin_mm
    missed = np.flatnonzero(~within & ~kept)
    at, keep = points[missed], keep_outs_of(curved.surface, setup)
    edge, beside = np.zeros(len(missed), dtype=bool), np.zeros(len(missed), dtype=bool)
    if margin > 0.0:
        edge = np.isfinite(PathMesh.of(curved.surface).boundary_distance(at, margin))
    if len(keep):
        beside = ~edge & (keep.room_mm(at, LEAD_MM) < 0.0)
    beyond = swept[missed] & ~edge & ~beside
    return Coverage(
        area_mm2=float(area.sum()),
        swept_mm2=float(area[swept].sum()),
        swept_share=float(area[swept].sum()) / max(asked, 1e-300),
        within_tolerance_mm2=float(area[within].sum()),
        within_share=float(area[within].sum()) / max(asked, 1e-300),
        missed_mm2=float(area[missed].sum()),
        margin_mm2=float(area[missed][edge].sum()),
        beside_mm2=float(area[missed][beside].sum()),
        beyond_mm2=float(area[missed][beyond].sum()),
        kept_out_mm2=float(area[kept].sum()),
        seen=Seen(curved.surface, samples, swept, within),
    )
