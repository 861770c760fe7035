"""From surface points in runs to a `ToolPath`: contact frames, lead-in and lead-out, approach and retract."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array, Transform
from planner.path.isolines import Ints
from planner.surface.normals import lengths
from planner.toolpath import PathKind, Role, ToolPath

CLEARANCE_MM = 50.0
"""How much higher than the standoff a pass is approached and left."""
LEAD_MM = 10.0
"""Length of lead-in and lead-out: what the robot needs to reach 200 mm/s at 2 m/s2."""
_LEAD_TURN_RAD = np.radians(10.0)


@dataclass(frozen=True, eq=False)
class DataRuns:
    """n DATA poses in k passes: points, normals, travel (n, 3) in `part`; face (n,) rows of `part.faces` (-1: off the
    surface), bary (n, 3); run (n,) ascending; heading (k,) +1 or -1."""

    points: Array
    normals: Array
    travel: Array
    face: NDArray[np.int32]
    bary: Array
    run: Ints
    heading: NDArray[np.int8]

    def with_heading(self, heading: NDArray[np.int8]) -> "DataRuns":
        """Return the same runs with other headings."""
        return replace(self, heading=heading)


def contact_frames(points: Array, normals: Array, travel: Array) -> Transform:
    """Return `Ts_part_contact`: z along the normal, x along travel made square to it."""
    x = _square(travel, normals)
    return Transform.from_axes("part", "contact", x, np.cross(normals, x), normals, points)


def _square(travel: Array, normals: Array) -> Array:
    x = travel - np.einsum("ij,ij->i", travel, normals)[:, None] * normals
    return np.asarray(x / lengths(x)[:, None])


def headings(points: Array, normals: Array, travel: Array, run: Ints, across: Array | None) -> NDArray[np.int8]:
    """Return the heading of each pass (k,).

    With `across` (n, 3), the direction of the array in space, it is the side of contact y that looks along it. Without,
    the array turns as little as possible (at most 90 deg) from one pass to the next.
    """
    y = np.cross(normals, travel)
    if across is not None:
        side = np.bincount(run, np.einsum("ij,ij->i", y, across))
        return np.where(side >= 0, 1, -1).astype(np.int8)
    first = np.flatnonzero(np.concatenate([[True], np.diff(run) > 0]))
    last = np.append(first[1:], len(run)) - 1
    keeps = np.einsum("ij,ij->i", y[last[:-1]], y[first[1:]]) >= 0
    return np.concatenate([[1], np.where(keeps, 1, -1)]).cumprod().astype(np.int8)


def assemble(data: DataRuns, kind: PathKind, standoff_mm: float, spacing_mm: float) -> ToolPath:
    """Return the path of all passes: APPROACH, LEAD_IN, DATA, LEAD_OUT, RETRACT each.

    The leads go on tangentially with the curvature the pass has at its ends, so that the motion has no kink where data
    begin. They are off the surface (face -1), as are approach and retract, which stand above the outer lead poses.
    """
    k = len(data.heading)
    first = np.searchsorted(data.run, np.arange(k))
    last = np.searchsorted(data.run, np.arange(k), side="right") - 1
    before = _leads(data, first, last, +1, spacing_mm)
    after = _leads(data, last, first, -1, spacing_mm)
    leads = len(before) // k
    rank = np.arange(leads)
    n = len(data.run)
    lead_axes = np.concatenate([before.rotation_matrix, after.rotation_matrix])
    x = np.concatenate([_square(data.travel, data.normals), lead_axes[:, :, 0]])
    z = np.concatenate([data.normals, lead_axes[:, :, 2]])
    p = np.concatenate([data.points, before.xyz_mm, after.xyz_mm])
    size = last - first + 1
    total = size + 2 * leads + 2
    offset = np.concatenate([[0], np.cumsum(total)])[:-1]
    row = np.zeros(int(total.sum()), dtype=np.int64)
    role = np.full(len(row), int(Role.DATA), dtype=np.uint8)
    row[(np.arange(n) - first[data.run]) + offset[data.run] + 1 + leads] = np.arange(n)
    # Leads come nearest first; a lead-in is travelled from its far end.
    lead_in = (offset[:, None] + 1 + rank[None, ::-1]).ravel()
    lead_out = (offset[:, None] + 1 + leads + size[:, None] + rank[None, :]).ravel()
    row[lead_in], role[lead_in] = n + np.arange(k * leads), Role.LEAD_IN
    row[lead_out], role[lead_out] = n + k * leads + np.arange(k * leads), Role.LEAD_OUT
    up, down = offset, offset + total - 1
    row[up], role[up] = row[up + 1], Role.APPROACH
    row[down], role[down] = row[down - 1], Role.RETRACT
    face = np.concatenate([data.face, np.full(2 * k * leads, -1, dtype=np.int32)])
    bary = np.concatenate([data.bary, np.zeros((2 * k * leads, 3))])
    face, bary, x, z = face[row], bary[row], x[row], z[row]
    off = role != Role.DATA
    face[off], bary[off] = -1, 0.0
    above = (role == Role.APPROACH) | (role == Role.RETRACT)
    run = np.repeat(np.arange(k), total)
    return ToolPath(
        kind=kind,
        Ts_part_contact=Transform.from_axes("part", "contact", x, np.cross(z, x), z, p[row]),
        standoff_mm=np.where(above, standoff_mm + CLEARANCE_MM, standoff_mm),
        heading=data.heading[run],
        pass_id=run.astype(np.int32),
        role=role,
        face=face.astype(np.int32),
        bary=bary,
    )


def extrapolate(at: Transform, toward: Transform, steps: Array, turn_limit_rad: float) -> Transform:
    """Return the frames `at` (k) continued away from `toward` (k) by signed `steps` (k, l) mm of travel: stack k * l.

    The motion goes on as the screw that leads from `at` to `toward` a few mm inside; its turn over the whole length is
    limited. Straight where the pass is straight.
    """
    turn = (at.inv() @ toward).exp[:, :3]
    inside = np.linalg.norm(toward.xyz_mm - at.xyz_mm, axis=1)
    rate = turn / np.maximum(inside, 1e-9)[:, None]
    longest = np.abs(steps).max(axis=1)
    scale = np.minimum(1.0, turn_limit_rad / np.maximum(np.linalg.norm(rate, axis=1) * longest, 1e-12))
    rate = np.where(inside[:, None] > 0, rate * scale[:, None], 0.0)
    twist = np.zeros((*steps.shape, 6))
    twist[..., :3] = rate[:, None, :] * np.abs(steps)[..., None] * -1.0
    twist[..., 3] = steps
    start = np.repeat(np.arange(len(steps)), steps.shape[1])
    return at[start] @ Transform.from_exp("contact", "contact", twist.reshape(-1, 6))


def _leads(data: DataRuns, at: Ints, end: Ints, inward: int, spacing_mm: float) -> Transform:
    """Return lead poses of every pass, nearest first."""
    count = max(int(np.ceil(LEAD_MM / spacing_mm)), 2)
    steps = np.tile(-inward * LEAD_MM * np.arange(1, count + 1) / count, (len(at), 1))
    inside = max(round(4.0 / spacing_mm), 2)
    toward = np.where(inward > 0, np.minimum(at + inside, end), np.maximum(at - inside, end))
    here, inner = (contact_frames(data.points[i], data.normals[i], data.travel[i]) for i in (at, toward))
    return extrapolate(here, inner, steps, _LEAD_TURN_RAD)
