"""What tilt alone leaves of the echo at every pose and law: at the rim of a curved part it falls as steeply as at an edge.

Over a radius of 200 mm the outer laws of a 30 mm array stand 4 deg off the normal, and two dB per deg2 take 20 dB and more. The
crossing of half the amplitude is then that of tilt and edge together, some tenths of a millimetre inside the edge.
"""

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.pose_line import PoseLine
from alignment.estimate.problem import Problem
from planner.frames import Array, Transform
from planner.probe import law_offsets_mm
from planner.setup import Probe

# Tilt changes slowly: it is looked up at this many laws, and at poses not nearer than this (mm), and interpolated.
LAWS, SPACING_MM = 9, 2.0
# Losses beyond this (dB) are not told from the floor.
MOST_DB = 20.0


def tilt_loss_db(cloud: PointCloud, line: PoseLine, problem: Problem, T_base_part: Transform) -> tuple[Array, Array]:
    """Return the loss (m, laws), dB, positive, that the set-up lets one expect of the tilt of the placed surface, twice.

    k alpha^2 per axis (`probe.tilt_loss_db_per_deg2`). A beam over the rim has its echo from what is still under it: the
    tilt is taken as that at the rim; or, the other extreme, as that of the surface bent on as it ends.
    """
    probe = problem.setup.probe
    x = law_offsets_mm(probe)
    at = np.unique(np.linspace(0, len(x) - 1, LAWS).round().astype(np.intp))
    rows = np.flatnonzero(line.present & (np.linalg.norm(line.beam_base, axis=1) > 0))
    loss = np.zeros((len(line.present), len(x)))
    if not len(rows):
        return loss, loss.copy()
    step = max(1, round(SPACING_MM / max(line.spacing_mm, 1e-3)))
    some = np.unique(np.r_[rows[::step], rows[-1]])
    z, a = line.beam_base[some], line.array_base[some]
    origins = line.position_base[some, None] + x[at][:, None] * a[:, None]
    points_part = T_base_part.inv().points(origins.reshape(-1, 3))
    foot = problem.curved.closest(points_part)
    off = points_part - foot.points
    beyond = off - np.einsum("ij,ij->i", off, foot.normals)[:, None] * foot.normals
    bent = foot.normals + np.einsum("nij,nj->ni", problem.curved.shape_operator(foot.face, foot.bary), beyond)
    bent /= np.linalg.norm(bent, axis=1, keepdims=True)
    every = np.arange(len(x))
    k = np.clip(np.searchsorted(at, every, side="right") - 1, 0, max(len(at) - 2, 0))
    share = (every - at[k]) / np.maximum(at[np.minimum(k + 1, len(at) - 1)] - at[k], 1)
    between = lambda v: v[:, k] * (1.0 - share) + v[:, np.minimum(k + 1, len(at) - 1)] * share  # noqa: E731
    nearest = np.clip(np.searchsorted(some, rows), 0, len(some) - 1)
    out = []
    for normals in (foot.normals, bent):
        n = T_base_part.directions(normals).reshape(origins.shape)
        facing = -np.einsum("mki,mi->mk", n, z)
        b = np.degrees(np.arctan2(np.einsum("mki,mi->mk", n, a), facing))
        c = np.degrees(np.arctan2(np.einsum("mki,mi->mk", n, np.cross(z, a)), facing))
        out.append(np.zeros_like(loss))
        out[-1][rows] = loss_of(between(b), between(c), probe)[nearest]
    return out[0], out[1]


def loss_of(b_deg: Array, c_deg: Array, probe: Probe) -> Array:
    """Return the loss (dB, positive) of tilts in the two axes of the array (deg), down to the floor."""
    per = probe.tilt_loss_db_per_deg2
    return np.asarray(np.minimum(per.b * b_deg**2 + per.c * c_deg**2, MOST_DB))
