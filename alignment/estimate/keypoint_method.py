"""The paper's method, faithful: match key points to the readings around them, then the best rigid transform.

R. Riise, C. Mineo, S. G. Pierce, P. I. Nicholson, I. Cooper, "Adapting Robot Paths for Automated NDT of Complex
Structures using Ultrasonic Alignment". It treats the mean of the readings around a key point as that very point, though
the surface tells nothing about the directions along itself; it is the baseline everything else is compared with.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from alignment.cloud import PointCloud
from alignment.rigid import fit_rigid
from planner.couplant import tof_us
from planner.errors import EchoBaseError
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.keypoint import KeyPoint
from planner.placement import assume_nominal
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

PLANE_READINGS = 3
# The perpendicular points depend on the normal they define; each round gains three digits.
NORMAL_ROUNDS = 3


@dataclass(frozen=True)
class KeyPointMatch:
    """What the readings around one key point say.

    status matched or rejected, with the reason. Lengths mm, `base`; residual_mm: distance of the
    matched point from the key point on the placed part, NaN until a placement is known.
    """

    id: str
    status: str
    reason: str | None
    nominal_base: tuple[float, float, float]
    normal_base: tuple[float, float, float]
    readings: int = 0
    amplitude_pct: float = float("nan")
    tof_us: float = float("nan")
    normal_angle_deg: float = float("nan")
    point_base: tuple[float, float, float] | None = None
    residual_mm: float = float("nan")

    @property
    def matched(self) -> bool:
        """True if the point counts."""
        return self.status == "matched"


@dataclass(frozen=True, eq=False)
class KeyPointFit:
    """Matches, and the placement they give; None with an issue where they do not give one."""

    matches: tuple[KeyPointMatch, ...]
    T_base_part: Transform | None
    issues: tuple[Issue, ...] = ()


def align_keypoints(
    cloud: PointCloud, curved: CurvedSurface, keypoints: Sequence[KeyPoint], setup: Setup
) -> KeyPointFit:
    """Return the paper's estimate: two checks per key point, then Arun's fit of at least three of them."""
    T_nominal = assume_nominal(setup.T_base_partnom)
    matches = match_keypoints(cloud, curved, keypoints, setup, T_nominal)
    good = [m for m in matches if m.matched]
    try:
        nominal = np.array([m.nominal_base for m in good]).reshape(-1, 3)
        measured = np.array([m.point_base for m in good]).reshape(-1, 3)
        rotation, offset = fit_rigid(nominal, measured)
    except EchoBaseError as error:
        said = Issue(
            "error",
            "keypoints-too-few",
            f"{len(good)} of {len(matches)} key points match, and they do not fix a rigid transform "
            f"({error.issues[0].message.rstrip('.')}).",
            "Add key points that are apart in two directions, or use the method 'map'.",
            "key points",
        )
        return KeyPointFit(matches, None, (said,))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, offset
    off = np.linalg.norm(nominal @ rotation.T + offset - measured, axis=1)
    residual = {m.id: float(d) for m, d in zip(good, off, strict=True)}
    matches = tuple(replace(m, residual_mm=residual.get(m.id, m.residual_mm)) for m in matches)
    return KeyPointFit(matches, Transform.from_matrix("base", "base", matrix) @ T_nominal)


def match_keypoints(
    cloud: PointCloud, curved: CurvedSurface, keypoints: Sequence[KeyPoint], setup: Setup, T_base_part: Transform
) -> tuple[KeyPointMatch, ...]:
    """Return each key point's match among the readings within the search radius of where it is on the placed part."""
    if not keypoints:
        return ()
    part = np.array([k.xyz() for k in keypoints])
    foot = curved.closest(part)
    places, normals = T_base_part.points(foot.points), T_base_part.directions(foot.normals)
    points = cloud.axial_points_base
    return tuple(
        _match(k.id, place, normal, points, cloud, setup)
        for k, place, normal in zip(keypoints, places, normals, strict=True)
    )


def _match(name: str, place: Array, normal: Array, points: Array, cloud: PointCloud, setup: Setup) -> KeyPointMatch:
    settings = setup.alignment
    box = np.abs(points[:, 0] - place[0]) <= settings.search_radius_mm
    near = np.flatnonzero(box)
    near = near[((points[near] - place) ** 2).sum(axis=1) <= settings.search_radius_mm**2]
    at = (tuple(map(float, place)), tuple(map(float, normal)))
    if len(near) < PLANE_READINGS:
        reason = f"{len(near)} readings within {settings.search_radius_mm:g} mm of it"
        return KeyPointMatch(name, "rejected", reason, *at, readings=len(near))  # type: ignore[arg-type]
    known = cloud.amplitude_pct[near]
    known = known[np.isfinite(known)]
    amplitude = float(known.mean()) if len(known) else float("nan")
    distance = cloud.distance_mm[near]
    tof = float(np.mean(tof_us(distance, setup.couplant))) if cloud.beams_base is not None else float("nan")
    q, plane = points[near], _plane_normal(points[near], normal)
    if cloud.beams_base is not None and settings.point_model == "perpendicular":
        for _ in range(NORMAL_ROUNDS):
            q = cloud.origins_base[near] - distance[:, None] * plane
            plane = _plane_normal(q, normal)
    dot = float(np.clip(plane @ normal, -1.0, 1.0))
    refusal: str | None = None
    if amplitude < settings.min_amplitude_pct:
        refusal = f"mean amplitude {amplitude:.1f} % is below {settings.min_amplitude_pct:g} %"
    elif dot < settings.min_normal_dot:
        refusal = f"the readings' plane is turned by {np.degrees(np.arccos(dot)):.2f} deg from the CAD normal"
    return KeyPointMatch(
        name,
        "matched" if refusal is None else "rejected",
        refusal,
        *at,  # type: ignore[arg-type]
        readings=len(near),
        amplitude_pct=amplitude,
        tof_us=tof,
        normal_angle_deg=float(np.degrees(np.arccos(dot))),
        point_base=tuple(map(float, q.mean(axis=0))),  # type: ignore[arg-type]
    )


def _plane_normal(points: Array, towards: Array) -> Array:
    """Return the unit normal (3,) of the least-squares plane: the smallest singular vector, signed by `towards`."""
    centred = points - points.mean(axis=0)
    n = np.linalg.svd(centred.T @ centred)[2][-1]
    return n if n @ towards >= 0 else -n
