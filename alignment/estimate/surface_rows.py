"""Residuals of patches against the placed surface, and how they change as the part moves."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from alignment.estimate.motion import motion_between, motion_rows
from alignment.estimate.patches import Patches
from planner.frames import Array, Transform
from planner.surface.closest import Foot
from planner.surface.curved import CurvedSurface
from planner.surface.follow import Follower

# A beam this far off the normal meets another surface, or none.
FACING_COS = np.cos(np.radians(45.0))
# Within so small a motion (mm) residuals change linearly: what is left out is 0.5 * curvature * motion^2, 1e-6 mm at a
# radius of 10 mm.
LINEAR_MM = 5e-3
# How well residuals found by following feet have to agree with those found afresh (mm).
FOLLOWED_MM = 1e-4
MANY_PATCHES = 1_500
# Placements whose residuals are remembered.
REMEMBERED = 4


@dataclass(frozen=True, eq=False)
class Rows:
    """r (n,): residuals, mm (measured minus expected distance). jacobian (n, 6): dr / dxi. valid (n,): on the surface.

    foot_base, normal_base (n, 3): where on the placed surface.
    """

    r: Array
    jacobian: Array
    valid: NDArray[np.bool_]
    foot_base: Array
    normal_base: Array


class Track:
    """The residuals of the same n readings or patches at one placement after another. Arguments as of `distance_rows`."""

    def __init__(
        self,
        curved: CurvedSurface,
        origins_base: Array,
        distance_mm: Array,
        beams_base: Array | None,
        follower: Follower | None = None,
    ) -> None:
        self.origins_base, self.distance_mm, self.beams_base = origins_base, distance_mm, beams_base
        self.follower = Follower(curved) if follower is None else follower
        self._reach_mm = float(np.ptp(origins_base, axis=0).max(initial=0.0))
        self._known: list[tuple[Transform, Array, Rows]] = []

    def rows(self, T_base_part: Transform, centre_mm: Array) -> Rows:
        """Return the residuals at a placement, motions about `centre_mm`; linear from a known one if that is very near."""
        for T_known, centre_known, rows in reversed(self._known):
            turned = np.abs(T_base_part.rotation_matrix - T_known.rotation_matrix).max()
            if self._reach_mm * turned > LINEAR_MM:
                continue
            xi = motion_between(T_known, T_base_part, centre_known)
            if np.linalg.norm(xi[3:]) + self._reach_mm * np.linalg.norm(xi[:3]) < LINEAR_MM:
                return replace(rows, r=rows.r + rows.jacobian @ xi)
        foot = self.follower.closest(T_base_part.inv().points(self.origins_base))
        found = _rows_at(foot, T_base_part, centre_mm, self.distance_mm, self.beams_base)
        self._known = [*self._known[1 - REMEMBERED :], (T_base_part, centre_mm, found)]
        return found


def distance_rows(
    curved: CurvedSurface,
    T_base_part: Transform,
    centre_mm: Array,
    origins_base: Array,
    distance_mm: Array,
    beams_base: Array | None,
) -> Rows:
    """Return residuals distance - dist(origin, placed surface) of n readings or patches.

    The distance to a surface changes by minus the normal component of the surface's own motion at the foot (the foot's
    sliding is of second order), so dr = n . (v + w x (foot - c)). Feet on the boundary are not surface data, nor are
    feet whose normal does not face the beam.
    """
    foot = curved.closest(T_base_part.inv().points(origins_base))
    return _rows_at(foot, T_base_part, centre_mm, distance_mm, beams_base)


def _rows_at(
    foot: Foot, T_base_part: Transform, centre_mm: Array, distance_mm: Array, beams_base: Array | None
) -> Rows:
    normal = T_base_part.directions(foot.normals)
    point = T_base_part.points(foot.points)
    valid = foot.interior.copy()
    if beams_base is not None:
        length = np.linalg.norm(beams_base, axis=1)
        valid &= (np.einsum("ij,ij->i", beams_base, normal) < -FACING_COS * length) | (length == 0)
    return Rows(distance_mm - foot.distance_mm, motion_rows(point, normal, centre_mm), valid, point, normal)


def joined_rows(parts: Sequence[Rows]) -> Rows:
    """Return rows one after the other."""
    return Rows(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Rows)))


def same_afresh(patches: Patches, curved: CurvedSurface, T_base_part: Transform, rows: Rows) -> bool:
    """Return whether the residuals of patches are those that the whole surface gives, looked at afresh.

    Of many patches every third is looked at: where a fold misleads it misleads all around.
    """
    if not curved.triangles.is_fine:
        return True
    look = slice(None, None, 3 if len(patches) > MANY_PATCHES else 1)
    foot = curved.closest(T_base_part.inv().points(patches.origins_base[look]))
    r = (patches.distance_mm - patches.bend_mm)[look] - foot.distance_mm
    return not bool((rows.valid[look] & (np.abs(r - rows.r[look]) > FOLLOWED_MM)).any())


def patch_rows(patches: Patches, curved: CurvedSurface, T_base_part: Transform, centre_mm: Array) -> Rows:
    """Return the residuals of patches; those without a usable reading are not valid."""
    track = patches.tracks.get(id(curved))
    if track is None:
        follower = patches.follower if patches.follower is not None and patches.follower.curved is curved else None
        expected_mm = patches.distance_mm - patches.bend_mm
        track = Track(curved, patches.origins_base, expected_mm, patches.beams_base, follower)
        patches.tracks[id(curved)] = track
    rows = track.rows(T_base_part, centre_mm)
    return replace(rows, valid=rows.valid & (patches.count > 0))
