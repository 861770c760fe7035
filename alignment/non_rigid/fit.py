"""`fit_field`: the residuals of a rigid alignment in, the shape of a part that sprang back out; or why there is none."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.estimate.directions import Direction
from alignment.estimate.map import condense_cloud
from alignment.estimate.motion import moved
from alignment.estimate.patches import Patches
from alignment.estimate.problem import Problem
from alignment.estimate.robust import mad_sigma
from alignment.estimate.surface_rows import Rows, patch_rows
from alignment.non_rigid.evidence import Evidence, weigh
from alignment.non_rigid.field import Field
from alignment.non_rigid.nodes import Nodes, believable, gather
from alignment.non_rigid.posterior import belonging, field_of, foretold_rms_mm, solve_nodes
from alignment.non_rigid.samples import Surroundings, samples_of, supported
from alignment.non_rigid.split import rigid_part
from planner.frames import Array, Transform
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

# Nodes to learn the smoothness from, and to carry the field.
LEARNED, CARRIED = 280, 900
LEAST_NODES, LEAST_PASSES = 20, 3
# The field must be this much likelier than noise alone (logarithm).
LEAST_GAIN = 8.0
LEAST_SUPPORT = 0.02
# Deviations beyond so many `tolerances.position_mm` are worth a word even where they cannot be followed.
MUCH = 3.0
# Patches this many robust standard deviations off the deformed part belong to something else; scatter is at least this.
REJECT, SCATTER_MM = 5.0, 0.01


@dataclass(frozen=True, eq=False)
class FieldFit:
    """field: None where there is nothing to follow; `reason` says why. T_base_part: the placement it is relative to, with
    the rigid part of the field in it, `motion_base` (6,), rad and mm, if it was split off.

    patches, rows at that placement; used (p,): those that belong to the part; rest_mm (p,): measured minus expected
    distance with the field followed, mm. gain: log evidence. cv_mm, cv_rigid_mm: rms with which passes foretell each other.
    seen: a field far likelier than noise, and larger than any noise, is there, followed or not.
    """

    field: Field | None
    reason: str | None
    T_base_part: Transform
    motion_base: Array
    patches: Patches
    rows: Rows
    used: NDArray[np.bool_]
    rest_mm: Array
    gain: float = 0.0
    cv_mm: float | None = None
    cv_rigid_mm: float | None = None
    samples: Surroundings | None = None
    seen: bool = False


def fit_field(
    cloud: PointCloud,
    curved: CurvedSurface,
    setup: Setup,
    T_base_part: Transform,
    directions: Sequence[Direction] = (),
) -> FieldFit:
    """Return the displacement field of a part that is already placed as well as a rigid part can be.

    directions: those of the rigid step; the rigid part of the field along the ones not held is split off and the placement
    moved by it. Without any the placement stays as it is. Never raises for a scan that says too little: then there is no
    field, and a reason.
    """
    problem = Problem(curved, setup)
    patches = condense_cloud(cloud, problem, T_base_part)
    rows = patch_rows(patches, curved, T_base_part, problem.centre_mm(T_base_part))
    used = believable(patches, rows, setup)

    def nothing(reason: str, found: Evidence | None = None, seen: bool = False) -> FieldFit:
        gain = 0.0 if found is None else found.gain
        return FieldFit(None, reason, T_base_part, np.zeros(6), patches, rows, used, rows.r, gain, seen=seen)

    if used.sum() < LEAST_NODES:
        return nothing(f"only {int(used.sum())} patches of readings lie on the surface")
    few = gather(patches, rows, used, T_base_part, setup, LEARNED)
    too_few = _too_few(few)
    if too_few:
        return nothing(too_few)
    few, evidence = _learn(few, 2.0 * problem.half_size_mm, setup.probe.swath_mm)
    cv, cv_rigid = _foretold(few, evidence)
    if evidence.gain < LEAST_GAIN:
        return nothing("what is left after the rigid alignment is explained by noise", evidence)
    large = float(np.abs(rows.r[used]).max()) > MUCH * setup.tolerances.position_mm
    if cv >= cv_rigid:
        return nothing("the passes lie too far apart to foretell each other", evidence, large)
    around = samples_of(curved)
    carry = _Carrier(curved, setup, patches, evidence.theta, evidence.axes, around)
    field = carry.field(rows, used, T_base_part, None)
    if field.support is None or field.support.share < LEAST_SUPPORT:
        return nothing("the readings determine a deformation hardly anywhere on the surface", evidence, large)
    xi = rigid_part(field, around, T_base_part, tuple(directions))
    T = moved(T_base_part, xi, problem.centre_mm(T_base_part))
    rows = patch_rows(patches, curved, T, problem.centre_mm(T))
    field = replace(field, motion=field.motion - _turned(xi, T))
    field = carry.field(rows, used, T, field)
    rest = carry.rest(rows, field, T)
    used = used & rows.valid & (np.abs(rest) < REJECT * mad_sigma(rest[used], SCATTER_MM, about_zero=True))
    return FieldFit(field, None, T, xi, patches, rows, used, rest, evidence.gain, cv, cv_rigid, around, True)


def _learn(nodes: Nodes, size_mm: float, swath_mm: float) -> tuple[Nodes, Evidence]:
    """Return nodes that belong, and the smoothness learned from them."""
    found = weigh(nodes, size_mm, swath_mm)
    keep = belonging(nodes, found.theta, found.axes)
    if keep.all():
        return nodes, found
    nodes = nodes.only(keep)
    return nodes, weigh(nodes, size_mm, swath_mm)


def _too_few(nodes: Nodes) -> str | None:
    """Return why these nodes cannot tell a deformation, if they cannot."""
    if len(nodes) < LEAST_NODES:
        return f"the readings amount to {len(nodes)} independent places, fewer than {LEAST_NODES}"
    if nodes.track.known and nodes.passes < LEAST_PASSES:
        return f"{nodes.passes} passes, fewer than {LEAST_PASSES}, cannot tell a deformation from the robot's wandering"
    return None


def _foretold(nodes: Nodes, found: Evidence) -> tuple[float, float]:
    """Return how well (rms, mm) passes foretell each other with a field, and without."""
    with_field = solve_nodes(nodes, found.theta, found.axes)
    without = solve_nodes(nodes, found.without, found.axes, with_field=False)
    return foretold_rms_mm(nodes, with_field), foretold_rms_mm(nodes, without)


def _turned(xi_base: Array, T_base_part: Transform) -> Array:
    """Return a motion about the centroid in axes of `part`."""
    inverse = T_base_part.inv()
    return np.concatenate([inverse.directions(xi_base[:3]), inverse.directions(xi_base[3:])])


@dataclass(frozen=True, eq=False)
class _Carrier:
    """What all rounds of the fit share."""

    curved: CurvedSurface
    setup: Setup
    patches: Patches
    theta: Array
    axes: Array
    around: Surroundings

    def field(self, rows: Rows, used: NDArray[np.bool_], T: Transform, before: Field | None) -> Field:
        """Return the field of residuals at a placement; `before`: a first field, whose slope lengthens the distances."""
        if before is not None:
            rows = replace(rows, r=rows.r + self.lengthened(rows, before, T))
        nodes = gather(self.patches, rows, used, T, self.setup, CARRIED)
        nodes = nodes.only(belonging(nodes, self.theta, self.axes))
        solved = solve_nodes(nodes, self.theta, self.axes)
        found = field_of(nodes, self.theta, self.axes, solved, self.curved, T, self.setup)
        return supported(found, self.around, self.setup)

    def lengthened(self, rows: Rows, field: Field, T: Transform) -> Array:
        """Return by how much slopes shorten the perpendicular distance (p,): h |grad f|^2 / 2, to second order, mm."""
        _, g = self._at(rows, field, T)
        return 0.5 * np.maximum(self.patches.distance_mm, 0.0) * (g**2).sum(axis=1)

    def rest(self, rows: Rows, field: Field, T: Transform) -> Array:
        """Return measured minus expected distances (p,) with the field followed, mm."""
        f, g = self._at(rows, field, T)
        return rows.r + f + 0.5 * np.maximum(self.patches.distance_mm, 0.0) * (g**2).sum(axis=1)

    def _at(self, rows: Rows, field: Field, T: Transform) -> tuple[Array, Array]:
        foot = self.curved.closest(T.inv().points(rows.foot_base))
        return field.on(foot.face, foot.bary)
