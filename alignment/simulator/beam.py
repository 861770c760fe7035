"""Amplitude: how much of the beam falls on the face, and how much its tilt loses."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import owens_t

from planner.frames import Array
from planner.setup import Probe

# The -6 dB width of a Gaussian is this many sigmas: 2 sqrt(2 ln 2).
WIDTH_SIGMAS = 2.0 * np.sqrt(2.0 * np.log(2.0))
REACH_SIGMAS = 5.0
NEAR_SEGMENTS = 24
# A foot this close to the rim counts as just inside: rounding must not put it inside one edge and outside the next.
RIM_MM = 1e-7


def beam_sigma_mm(probe: Probe) -> float:
    """Return the standard deviation (mm) of the Gaussian beam whose -6 dB width is `beam_width_mm`."""
    return probe.beam_width_mm / WIDTH_SIGMAS


def tilt_deg(beams: Array, arrays: Array, normals: Array) -> tuple[Array, Array]:
    """Return the tilts B and C (deg, (n,)) of the surface seen from the TCP: turns about TCP y and about TCP x.

    beams, arrays (n, 3): TCP z and x; normals (n, 3): outward.
    """
    along = -np.einsum("ij,ij->i", normals, beams)
    across = -np.einsum("ij,ij->i", normals, arrays)
    side = -np.einsum("ij,ij->i", normals, np.cross(beams, arrays))
    return np.degrees(np.arctan2(across, along)), np.degrees(np.arctan2(side, along))


def tilt_loss_db(b_deg: Array, c_deg: Array, probe: Probe) -> Array:
    """Return the loss (dB, positive) of tilts in two axes: k alpha^2 each."""
    k = probe.tilt_loss_db_per_deg2
    return k.b * b_deg**2 + k.c * c_deg**2


def share_on_face(
    feet: Array, normals: Array, on_rim_side: NDArray[np.bool_], rim_a: Array, rim_b: Array, sigma_mm: float
) -> Array:
    """Return the share (n,) of a Gaussian beam, centred on each foot, that falls inside the rim.

    feet, normals (n, 3); on_rim_side (n,): True where a foot away from any rim lies on the face. rim_a, rim_b (r, 3).
    Exact for a flat face with a polygonal rim: the Gaussian mass of a polygon is its winding number less the sum over
    its edges of Owen's T function (D. B. Owen, Ann. Math. Stat. 27 (1956) 1075, doi:10.1214/aoms/1177728074), so the
    -6 dB crossing of a straight edge lies under the centre of the beam, and a corner takes three quarters of it.
    """
    share = on_rim_side.astype(np.float64)
    if len(rim_a) == 0 or len(feet) == 0:
        return share
    reach = REACH_SIGMAS * sigma_mm
    half = 0.5 * float(np.linalg.norm(rim_b - rim_a, axis=1).max())
    tree = cKDTree(0.5 * (rim_a + rim_b))
    near = np.flatnonzero(tree.query(feet, distance_upper_bound=reach + half, workers=-1)[0] < np.inf)
    if len(near) == 0:
        return share
    k = min(NEAR_SEGMENTS, len(rim_a))
    index = tree.query(feet[near], k=k, distance_upper_bound=reach + half, workers=-1)[1].reshape(len(near), k)
    share[near] = _near_rim(feet[near], normals[near], index, rim_a, rim_b, sigma_mm)
    return share


def _near_rim(
    feet: Array, normals: Array, index: NDArray[np.int64], rim_a: Array, rim_b: Array, sigma_mm: float
) -> Array:
    valid = index < len(rim_a)
    index = np.where(valid, index, 0)
    z = normals[:, None, :]
    a, b = rim_a[index] - feet[:, None, :], rim_b[index] - feet[:, None, :]
    a = a - np.einsum("nkj,nkj->nk", a, np.broadcast_to(z, a.shape))[:, :, None] * z
    b = b - np.einsum("nkj,nkj->nk", b, np.broadcast_to(z, b.shape))[:, :, None] * z
    edge = b - a
    length = np.maximum(np.linalg.norm(edge, axis=2), 1e-12)
    along = edge / length[:, :, None]
    inward = np.cross(np.broadcast_to(z, along.shape), along)
    h, ta, tb, gap = _seen(a, b, along, inward, valid)
    nearest = gap.min(axis=1, keepdims=True)
    tied = gap <= nearest + RIM_MM
    # On the rim itself rounding could put the foot inside one edge and outside the next: it is moved inside both.
    into = np.where((tied & (nearest < RIM_MM))[:, :, None], inward, 0.0).sum(axis=1, keepdims=True)
    if into.any():
        h, ta, tb, gap = _seen(a - 2.0 * RIM_MM * into, b - 2.0 * RIM_MM * into, along, inward, valid)
    inside = np.where(tied, h / np.maximum(gap, 1e-12), 0.0).sum(axis=1) >= 0.0
    size = np.maximum(np.abs(h), 1e-12)
    tail = np.sign(h) * (owens_t(size / sigma_mm, tb / size) - owens_t(size / sigma_mm, ta / size))
    share = inside - np.where(valid, tail, 0.0).sum(axis=1)
    # Within rounding of the rim, inside and h may disagree; the two answers are exactly one apart.
    share = np.where(share > 1.2, share - 1.0, np.where(share < -0.2, share + 1.0, share))
    return np.asarray(np.clip(share, 0.0, 1.0))


def _seen(
    a: Array, b: Array, along: Array, inward: Array, valid: NDArray[np.bool_]
) -> tuple[Array, Array, Array, Array]:
    """How a foot sees rim segments from a to b: h, its distance inside their line; both ends along it; the distance."""
    h = -np.einsum("nkj,nkj->nk", a, inward)
    ta, tb = np.einsum("nkj,nkj->nk", a, along), np.einsum("nkj,nkj->nk", b, along)
    gap = np.where(valid, np.hypot(h, np.maximum(0.0, np.maximum(ta, -tb))), np.inf)
    return h, ta, tb, gap
