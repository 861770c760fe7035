"""Key points: put on the surface, judged, and (in `suggest`) chosen."""

import numpy as np

from planner.errors import EchoBaseError
from planner.issues import Issue
from planner.keypoint import KeyPoint
from planner.path.mesh import PathMesh
from planner.path.places import flat_radius_mm, too_curved
from planner.path.suggest import suggest
from planner.setup import Setup
from planner.surface.closest import Foot
from planner.surface.curved import CurvedSurface
from planner.surface.keepouts import keep_outs_of

__all__ = ["kept_out", "snap", "suggest", "verdicts"]

SNAP_MM = 2.0
_SAME_MM = 0.5
_MANY = 4


def _feet(curved: CurvedSurface, keypoints: tuple[KeyPoint, ...]) -> Foot:
    return curved.closest(np.array([k.xyz() for k in keypoints], dtype=np.float64).reshape(-1, 3))


def snap(curved: CurvedSurface, keypoints: tuple[KeyPoint, ...]) -> tuple[KeyPoint, ...]:
    """Return the key points moved to the closest point of the inspection surface.

    Raises `EchoBaseError` naming every key point that is farther than 2 mm from it, and ids used twice.
    """
    if not keypoints:
        return ()
    foot = _feet(curved, keypoints)
    away = np.linalg.norm(foot.points - np.array([k.xyz() for k in keypoints]), axis=1)
    ids = [k.id for k in keypoints]
    issues = [
        Issue(
            "error",
            "keypoint-off-surface",
            f"Key point {k.id} is {d:.2f} mm from the inspection surface (at most {SNAP_MM:g} mm).",
            "Move it onto the surface, or check the unit of the part and the frame of the key points (part).",
            f"keypoints: {k.id}",
        )
        for k, d in zip(keypoints, away, strict=True)
        if not d <= SNAP_MM
    ]
    issues += [
        Issue("error", "keypoint-id-twice", f"Two key points are called {i}.", "Rename one.", f"keypoints: {i}")
        for i in sorted({i for i in ids if ids.count(i) > 1})
    ]
    if issues:
        raise EchoBaseError(*issues)
    return tuple(
        k.model_copy(update={"x_mm": float(p[0]), "y_mm": float(p[1]), "z_mm": float(p[2])})
        for k, p in zip(keypoints, foot.points, strict=True)
    )


def verdicts(curved: CurvedSurface, keypoints: tuple[KeyPoint, ...], setup: Setup) -> list[Issue]:
    """Return what speaks against each key point: off the surface, near an edge, too curved for a plane, duplicate.

    All warnings but the first: they cost accuracy of the key-point method, not safety. A plane fitted within the search
    radius r of a surface of curvature k lies k r^2 / 4 off on average, and its rim is turned by k r.
    """
    if not keypoints:
        return []
    foot, radius = _feet(curved, keypoints), setup.alignment.search_radius_mm
    asked = np.array([k.xyz() for k in keypoints])
    away = np.linalg.norm(foot.points - asked, axis=1)
    edge = PathMesh.of(curved.surface).boundary_distance(foot.points, radius)
    bend = np.abs(np.linalg.eigvalsh(curved.shape_operator(foot.face, foot.bary))).max(axis=1)
    offset = bend * radius**2 / 4.0
    curved_there = too_curved(bend, setup)
    out: list[Issue] = kept_out(curved, keypoints, setup)
    for i, k in enumerate(keypoints):
        where = f"keypoints: {k.id}"
        if away[i] > SNAP_MM:
            out.append(
                Issue(
                    "error",
                    "keypoint-off-surface",
                    f"Key point {k.id} is {away[i]:.2f} mm from the inspection surface.",
                    "Move it onto the surface.",
                    where,
                )
            )
            continue
        if edge[i] < radius:
            out.append(
                Issue(
                    "warning",
                    "keypoint-near-edge",
                    f"Key point {k.id} is {edge[i]:.1f} mm from an edge, inside its search radius of {radius:g} mm.",
                    "Move it inwards, or give a smaller alignment.search_radius_mm.",
                    where,
                )
            )
        if curved_there[i]:
            out.append(
                Issue(
                    "warning",
                    "keypoint-curved",
                    f"At key point {k.id} the surface (radius {1.0 / max(bend[i], 1e-9):.0f} mm) leaves a plane by "
                    f"{offset[i]:.2f} mm on average within {radius:g} mm.",
                    "Move it to a flatter place, or give an alignment.search_radius_mm of at most "
                    f"{np.floor(10.0 * flat_radius_mm(float(bend[i]), setup)) / 10.0:g} mm.",
                    where,
                )
            )
        out += _too_close(keypoints, foot, i, radius)
    return _gathered(out) + _spread(foot)


def kept_out(curved: CurvedSurface, keypoints: tuple[KeyPoint, ...], setup: Setup) -> list[Issue]:
    """Return an error for every key point inside a keep-out region or its margin: no data are taken there."""
    keep = keep_outs_of(curved.surface, setup)
    if not len(keep) or not keypoints:
        return []
    room = keep.each_room_mm(_feet(curved, keypoints).points)
    nearest = room.argmin(axis=0)
    return [
        Issue(
            "error",
            "keypoint-kept-out",
            f"Key point {k.id} lies {'in' if gap < 0.0 else 'within the margin of'} the keep-out region "
            f"'{keep.label(int(nearest[i]))}': no data are taken there.",
            f"Move it by {-room[nearest[i], i]:.1f} mm or more, or correct inspection.keep_outs.",
            f"keypoints: {k.id}",
        )
        for i, (k, gap) in enumerate(
            zip(keypoints, keep.gaps_mm(_feet(curved, keypoints).points).min(axis=0), strict=True)
        )
        if room[nearest[i], i] < 0.0
    ]


def _gathered(issues: list[Issue]) -> list[Issue]:
    """Return the issues, those that many key points share as one."""
    out: list[Issue] = []
    for code in dict.fromkeys(i.code for i in issues):
        same = [i for i in issues if i.code == code]
        if len(same) <= _MANY or same[0].severity == "error":
            out += same
            continue
        ids = ", ".join(i.where.removeprefix("keypoints: ") for i in same)
        text = f"{len(same)} key points, for one: {same[0].message}"
        out.append(Issue(same[0].severity, code, text, same[0].remedy, f"keypoints: {ids}"))
    return out


def _too_close(keypoints: tuple[KeyPoint, ...], foot: Foot, i: int, radius: float) -> list[Issue]:
    distance = np.linalg.norm(foot.points[:i] - foot.points[i], axis=1)
    if not len(distance) or distance.min() >= radius:
        return []
    j = int(distance.argmin())
    same = distance[j] < _SAME_MM
    text = "is a duplicate of" if same else f"is only {distance[j]:.1f} mm from"
    return [
        Issue(
            "warning",
            "keypoint-duplicate" if same else "keypoint-overlap",
            f"Key point {keypoints[i].id} {text} {keypoints[j].id}: they use the same readings.",
            "Remove one, or move them apart by more than the search radius.",
            f"keypoints: {keypoints[i].id}",
        )
    ]


def _spread(foot: Foot) -> list[Issue]:
    centred = foot.points - foot.points.mean(axis=0)
    size = np.linalg.svd(centred, compute_uv=False) if len(centred) else np.zeros(3)
    if len(foot.points) >= 3 and size[1] > 0.02 * max(float(size[0]), 1e-9):
        return []
    return [
        Issue(
            "warning",
            "keypoints-on-a-line",
            "The key points are fewer than three or lie on a line: a turn about it cannot be found from them.",
            "Add key points away from the line.",
            "keypoints",
        )
    ]
