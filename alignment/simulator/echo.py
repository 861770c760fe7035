"""What each law hears of the true part, before any noise."""

import numpy as np
from numpy.typing import NDArray

from alignment.simulator.beam import beam_sigma_mm, share_on_face, tilt_deg, tilt_loss_db
from alignment.simulator.body import TrueBody
from alignment.simulator.shape import TrueFace
from alignment.simulator.truth import Noise
from planner.frames import Array
from planner.setup import Setup

# Every so many laws the foot is searched from afar; between them it is searched near the interpolated guess.
LAW_STRIDE = 8
# A foot this far aside changes the distance by a millionth of a mm.
ASIDE_MM = 3e-3
CLEAR_MM = 1.0
"""What stands this much in front of the inspected face hides it."""


def echoes(
    body: TrueBody, origins: Array, beams: Array, arrays: Array, setup: Setup, noise: Noise
) -> tuple[Array, Array]:
    """Return distances (m, laws), mm, NaN where nothing is heard, and amplitudes (m, laws), %FSH.

    origins, beams, arrays (m, laws, 3): law origins, TCP z and TCP x in `part`. The inspected face answers with its
    perpendicular distance and the share of the beam on it; where the beam falls beside it, or something stands before
    it, the rest of the part may answer instead, if it faces the beam. The stronger echo is the one recorded.
    """
    shape = origins.shape[:2]
    feet, normals = _feet(body, origins)
    o, z, x = (v.reshape(-1, 3) for v in (origins, beams, arrays))
    distance, share = _of_face(body, o, z, feet, normals, setup, noise)
    amplitude = _strength(share, z, x, normals, setup, noise)
    if body.rest is not None:
        first, reach = body.first_met(o, z)
        amplitude[first & (reach < distance - CLEAR_MM)] = 0.0
        beside = np.flatnonzero(first & (amplitude < 0.98 * setup.reference_amplitude_pct) & (share < 0.98))
        hidden = np.flatnonzero(first & (reach < distance - CLEAR_MM) & (share >= 0.98))
        for rows, left in ((beside, 1.0 - share[beside]), (hidden, np.ones(len(hidden)))):
            _answer_of_rest(body.rest, rows, left, o, z, x, reach, distance, amplitude, setup, noise)
    heard = amplitude >= noise.detection_pct
    return np.where(heard, distance, np.nan).reshape(shape), np.where(heard, amplitude, 0.0).reshape(shape)


def _feet(body: TrueBody, origins: Array) -> tuple[Array, Array]:
    """Closest points and normals of the inspected face, (m * laws, 3) each."""
    flat = origins.reshape(-1, 3)
    if body.analytic is not None:
        return body.analytic.foot(flat)
    m, laws = origins.shape[:2]
    if laws < 2 * LAW_STRIDE:
        return body.face.foot(flat)
    # From afar many triangles are nearly equally near and the search is slow; from just above the surface it is not.
    coarse = np.unique(np.append(np.arange(0, laws, LAW_STRIDE), laws - 1))
    points, normals = (v.reshape(m, len(coarse), 3) for v in body.face.foot(origins[:, coarse].reshape(-1, 3)))
    place = np.interp(np.arange(laws), coarse, np.arange(len(coarse)))
    left = np.minimum(place.astype(np.int64), len(coarse) - 2)
    weight = (place - left)[None, :, None]
    guess = (points[:, left] * (1.0 - weight) + points[:, left + 1] * weight).reshape(-1, 3)
    points, normals = body.face.foot(guess)
    active = np.arange(len(flat))
    for _ in range(8):
        along = _along(flat[active], points[active], normals[active])
        aside = np.einsum("ij,ij->i", along, along) > ASIDE_MM**2
        active, along = active[aside], along[aside]
        if len(active) == 0:
            return points, normals
        moved, turned = body.face.foot(points[active] + along)
        # On the rim the foot stays beside the normal however often it is searched.
        still = np.linalg.norm(moved - points[active], axis=1) < 0.1 * ASIDE_MM
        points[active], normals[active] = moved, turned
        active = active[~still]
    points[active], normals[active] = body.face.foot(flat[active])
    return points, normals


def _along(origins: Array, points: Array, normals: Array) -> Array:
    """The part of origin - point that runs along the surface (n, 3), mm: nothing at the foot."""
    offset = origins - points
    return np.asarray(offset - np.einsum("ij,ij->i", offset, normals)[:, None] * normals)


def _of_face(
    body: TrueBody, o: Array, z: Array, feet: Array, normals: Array, setup: Setup, noise: Noise
) -> tuple[Array, Array]:
    """Perpendicular distance to the face, extended past its rim by its tangent plane, and the share of the beam on it."""
    distance = np.einsum("ij,ij->i", o - feet, normals)
    on_plane = o - distance[:, None] * normals
    facing = -np.einsum("ij,ij->i", normals, z) > np.cos(np.radians(noise.lost_deg))
    near = np.flatnonzero(facing & (distance > 0.0))
    sigma = beam_sigma_mm(setup.probe)
    nearest = body.face.foot(on_plane[near])[0] if body.analytic is not None else feet[near]
    inside = np.linalg.norm(on_plane[near] - nearest, axis=1) < 3.0 * sigma
    share = np.zeros(len(o))
    share[near] = share_on_face(on_plane[near], normals[near], inside, body.face.rim_a, body.face.rim_b, sigma)
    return distance, share


def _strength(share: Array, z: Array, x: Array, normals: Array, setup: Setup, noise: Noise) -> Array:
    loss = np.minimum(tilt_loss_db(*tilt_deg(z, x, normals), setup.probe), noise.floor_db)
    return np.asarray(setup.reference_amplitude_pct * 10.0 ** (-loss / 20.0) * share)


def _answer_of_rest(
    rest: TrueFace,
    rows: NDArray[np.intp],
    share: Array,
    o: Array,
    z: Array,
    x: Array,
    reach: Array,
    distance: Array,
    amplitude: Array,
    setup: Setup,
    noise: Noise,
) -> None:
    """Let the rest of the part answer for `rows` with what is left of the beam; keep the stronger echo."""
    if len(rows) == 0:
        return
    o, z, x = o[rows], z[rows], x[rows]
    points, normals = rest.foot(o + reach[rows, None] * z)
    for _ in range(4):
        offset = o - points
        points, normals = rest.foot(points + offset - np.einsum("ij,ij->i", offset, normals)[:, None] * normals)
    d = np.einsum("ij,ij->i", o - points, normals)
    facing = (-np.einsum("ij,ij->i", normals, z) > np.cos(np.radians(noise.lost_deg))) & (d > 0.0)
    level = np.where(facing, _strength(share, z, x, normals, setup, noise), 0.0)
    louder = level > amplitude[rows]
    distance[rows[louder]], amplitude[rows[louder]] = d[louder], level[louder]
