"""Patches and crossings of several surfaces of one part as if they were of one: each asks only the surface of its own plan.

A reading over a crease, inside a channel or on either side of a thin wall is nearest to whatever it is nearest to; its own
plan knows which surface it was taken of. Every scan stays in its plan's own base; what is handed on is in the first's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.cells import Cells
from alignment.estimate.edge_points import EdgePoints
from alignment.estimate.edge_rows import EdgeRows, edge_rows
from alignment.estimate.motion import motion_rows
from alignment.estimate.patches import Patches
from alignment.estimate.problem import Problem
from alignment.estimate.sample import Sample, Sampler, sampler
from alignment.estimate.surface_rows import Rows, joined_rows, patch_rows
from alignment.estimate.system import EdgeData
from planner.frames import Array, Transform
from planner.surface.curved import CurvedSurface

# Path put between the scans (mm): what wandered in one of them says nothing of the next.
BETWEEN_MM = 1e4
# Numbers set aside for the passes of one scan.
PASSES = 100_000


@dataclass(frozen=True, eq=False)
class Member:
    """One plan's surface, and its base as seen from the first plan's: `T_first_own`, from its `base` to the first's."""

    curved: CurvedSurface
    T_first_own: Transform

    def placed(self, T_base_part: Transform) -> Transform:
        """Return the placement in the plan's own base for one in the first plan's."""
        return Transform("base", "part", (self.T_first_own.inv() @ T_base_part).rigid)

    def in_first(self, rows: Rows, centre_mm: Array) -> Rows:
        """Return rows found in the plan's own base in the first plan's, motions about `centre_mm` there."""
        point, normal = self.T_first_own.points(rows.foot_base), self.T_first_own.directions(rows.normal_base)
        return Rows(rows.r, motion_rows(point, normal, centre_mm), rows.valid, point, normal)

    def sampler(self, cloud: PointCloud, point_model: str) -> Sampler:
        """Return the sample of a cloud on the plan's surface, as seen in the first plan's base."""
        own = sampler(cloud, self.curved, point_model)
        return Sampler(self._seen(own.every), lambda: self._seen(own.few()))

    def _seen(self, sample: Sample) -> Sample:
        def rows(T_base_part: Transform, centre_mm: Array) -> Rows:
            own_centre = self.T_first_own.inv().points(centre_mm)
            return self.in_first(sample.rows(self.placed(T_base_part), own_centre), centre_mm)

        return Sample(sample.heard, rows)


class SeveralTracks:
    """The residuals of the patches of several scans (as `Track` for one): each against the surface of its plan."""

    def __init__(self, members: Sequence[Member], patches: Sequence[Patches]) -> None:
        self.members, self.patches = tuple(members), tuple(patches)

    def each(self, T_base_part: Transform, centre_mm: Array) -> list[Rows]:
        """Return the rows of each scan in its own base, motions about the same centre."""
        out = []
        for member, patches in zip(self.members, self.patches, strict=True):
            own = member.T_first_own.inv().points(centre_mm)
            out.append(patch_rows(patches, member.curved, member.placed(T_base_part), own))
        return out

    def rows(self, T_base_part: Transform, centre_mm: Array) -> Rows:
        """Return the rows of all scans, one after the other, in the first plan's base."""
        found = self.each(T_base_part, centre_mm)
        return joined_rows([m.in_first(r, centre_mm) for m, r in zip(self.members, found, strict=True)])


def joined_patches(members: Sequence[Member], parts: Sequence[Patches], curved: CurvedSurface) -> Patches:
    """Return the patches of several scans in the first plan's base; asked about `curved` they ask their own surfaces."""
    turns = [m.T_first_own.rotation_matrix for m in members]
    join = lambda values: np.concatenate(list(values))  # noqa: E731
    turned = lambda name: join(t @ getattr(p, name) @ t.T for t, p in zip(turns, parts, strict=True))  # noqa: E731
    both = list(zip(members, parts, strict=True))
    sizes = np.array([p.total for p in parts])
    before = np.cumsum(sizes) - sizes
    joined = Patches(
        origins_base=join(m.T_first_own.points(p.origins_base) for m, p in both),
        distance_mm=join(p.distance_mm for p in parts),
        spread=turned("spread"),
        hessian_base=turned("hessian_base"),
        count=join(p.count for p in parts),
        scatter_mm=join(p.scatter_mm for p in parts),
        amplitude_pct=join(p.amplitude_pct for p in parts),
        beams_base=join(m.T_first_own.directions(p.beams_base) for m, p in both),
        cells=_joined_cells([p.cells for p in parts]),
        looked_at=join(p.looked_at + n for p, n in zip(parts, before, strict=True)),
        total=int(sizes.sum()),
        kept=join(p.kept for p in parts),
        sigma_mm=float(np.sqrt(np.average([p.sigma_mm**2 for p in parts], weights=sizes))),
    )
    joined.tracks[id(curved)] = SeveralTracks(members, parts)
    return joined


def _joined_cells(parts: Sequence[Cells]) -> Cells:
    cells, passes, blocks, out = 0, 0, 0, []
    for i, c in enumerate(parts):
        moved = replace(
            c,
            of_reading=(c.of_reading + cells).astype(np.int32),
            pass_id=(c.pass_id + passes).astype(np.int32),
            s_from_mm=c.s_from_mm + i * BETWEEN_MM,
            s_to_mm=c.s_to_mm + i * BETWEEN_MM,
            block=(c.block + blocks).astype(np.int32),
        )
        out.append(moved)
        cells, blocks = cells + len(c), blocks + 1 + int(c.block.max(initial=-1))
        passes += PASSES
    return Cells(*(np.concatenate([getattr(c, f.name) for c in out]) for f in fields(Cells)))


@dataclass(frozen=True, eq=False)
class SeveralEdges(EdgeData):
    """The crossings of several scans; `points` are theirs one after the other in the first plan's base.

    parts: of each scan in its own base, or None where it crosses no edge.
    """

    members: tuple[Member, ...] = ()
    parts: tuple[EdgeData | None, ...] = ()

    def cad_rows(self, problem: Problem, T_base_part: Transform) -> EdgeRows:
        """Return the residuals of all crossings, each against the edges of its own plan's surface."""
        centre, out, first = problem.centre_mm(T_base_part), [], 0
        for member, part in zip(self.members, self.parts, strict=True):
            if part is None:
                continue
            # Places along the steps are found anew for all together.
            points = replace(part.points, at=self.points.at[first : first + len(part.points)])
            first += len(points)
            own = member.T_first_own.inv().points(centre)
            found = edge_rows(points, part.map, member.curved, member.placed(T_base_part), own)
            point = member.T_first_own.points(found.point_base)
            conormal = member.T_first_own.directions(found.jacobian[:, 3:])
            out.append(replace(found, jacobian=motion_rows(point, conormal, centre), point_base=point))
        return EdgeRows(*(np.concatenate([getattr(r, f.name) for r in out]) for f in fields(EdgeRows)))


def joined_edges(members: Sequence[Member], parts: Sequence[EdgeData | None]) -> SeveralEdges | None:
    """Return the crossings of several scans together; None where none crosses an edge."""
    points = []
    for i, (member, part) in enumerate(zip(members, parts, strict=True)):
        if part is None:
            continue
        T, p = member.T_first_own, part.points
        moved = replace(
            p,
            on_base=T.points(p.on_base),
            off_base=T.points(p.off_base),
            travel_base=T.directions(p.travel_base),
            pass_id=(p.pass_id + i * PASSES).astype(np.int32),
            s_mm=p.s_mm + i * BETWEEN_MM,
        )
        points.append(moved)
    given = [p for p in parts if p is not None]
    if not given:
        return None
    every = EdgePoints(*(np.concatenate([getattr(p, f.name) for p in points]) for f in fields(EdgePoints)))
    none = np.zeros(len(every), dtype=bool)
    return SeveralEdges(
        every, given[0].map, none, given[0].bias_sigma_mm, given[0].lag_sigma_mm, None, tuple(members), tuple(parts)
    )
