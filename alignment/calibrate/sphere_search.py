"""Which echoes are of the sphere at all: most may come from what it stands on."""

import numpy as np
from numpy.typing import NDArray

from alignment.calibrate.sphere_model import SphereViews
from alignment.calibrate.sphere_views import MIN_POSES, MIN_READINGS
from planner.errors import fail
from planner.frames import Array

# Centres that echoes point to lie this close together, as the TCP may be off by some mm and a deg or two.
CLOUD_MM = 8.0
# Radii looked at where none is stated.
RADII_MM = np.geomspace(3.0, 150.0, 14)


def on_sphere(views: SphereViews, radius_mm: float | None, name: str) -> tuple[SphereViews, tuple[float, Array]]:
    """Return the echoes of the sphere, and its radius (mm) and centre (3,), roughly.

    An echo points to a centre: a radius beyond the surface along the beam. Those of the sphere meet, seen from wherever;
    those of a table, or a clamp, move along with the probe. So the place is where most poses, each counted once, point to.
    Raises EchoBaseError `tcp-readings` where too few meet.
    """
    rotation, beam = views.rotation[views.pose], views.rotation[views.pose, :, 2]
    face = views.origin_base[views.pose] + np.einsum("nij,nj->ni", rotation, views.law_tcp)
    surface = face + views.distance_mm[:, None] * beam
    radii = RADII_MM if radius_mm is None else np.array([radius_mm])
    radius, (_, centre) = max(
        ((r, _meeting(surface + r * beam, views.pose)) for r in radii), key=lambda found: found[1][0]
    )
    near = _near(surface + radius * beam, centre, CLOUD_MM)
    if radius_mm is None:
        for _ in range(4):
            radius = _radius(surface[near], beam[near])
            pointed = surface + radius * beam
            near = _near(pointed, np.median(pointed[near], axis=0), CLOUD_MM)
    poses = len(np.unique(views.pose[near]))
    if poses < MIN_POSES or near.sum() < MIN_READINGS:
        raise fail(
            "tcp-readings",
            f"Only {poses} poses agree on one sphere, in {int(near.sum())} echoes.",
            "Check radius and tool as taught (to 5 mm and 3 deg, beam_axis), and pass over the sphere from more directions.",
            name,
        )
    return views.subset(near), (float(radius), np.median((surface + radius * beam)[near], axis=0))


def _meeting(pointed: Array, pose: NDArray[np.int32]) -> tuple[float, Array]:
    """Return how many poses point to the most pointed-to cube of space, and the middle (3,) of what they point to.

    A little less for what is spread wide, so that of two radii the one that brings points closer together is taken.
    """
    best: tuple[float, Array] = (-1.0, np.zeros(3))
    for shift in (0.0, 0.5 * CLOUD_MM):
        cube = np.unique(np.floor((pointed + shift) / CLOUD_MM).astype(np.int64), axis=0, return_inverse=True)[
            1
        ].ravel()
        pairs = np.unique(np.column_stack([cube, pose]), axis=0)
        fullest = int(np.argmax(np.bincount(pairs[:, 0])))
        middle = np.median(pointed[cube == fullest], axis=0)
        near = _near(pointed, middle, CLOUD_MM)
        spread = float(np.mean(np.linalg.norm(pointed[near] - middle, axis=1)))
        score = len(np.unique(pose[near])) * (1.0 - 0.5 * spread / CLOUD_MM)
        if score > best[0]:
            best = score, middle
    return best


def _near(pointed: Array, centre: Array, reach_mm: float) -> NDArray[np.bool_]:
    return np.linalg.norm(pointed - centre, axis=1) <= reach_mm


def _radius(surface: Array, beam: Array) -> float:
    """Return the radius (mm) at which the points surface + radius beam (n, 3) lie closest together."""
    s, b = surface - surface.mean(axis=0), beam - beam.mean(axis=0)
    return float(np.clip(-(s * b).sum() / max(float((b * b).sum()), 1e-12), RADII_MM[0], RADII_MM[-1]))
