"""What tilt alone leaves of the echo at every pose and law: at the rim of a curved part it falls as steeply as at an edge.

Over a radius of 200 mm the outer laws of a 30 mm array stand 4 deg off the normal, and two dB per deg2 take 20 dB and more. The
crossing of half the amplitude is then that of tilt and edge together, some tenths of a millimetre inside the edge.
"""

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.pose_line import PoseLine
from alignment.estimate.problem import Problem
from alignment.metrics.figures import loss_db, tilts_deg
from planner.frames import Array, Transform
from planner.probe import law_offsets_mm

# Tilt changes slowly: it is looked up at this many laws, and at poses not nearer than this (mm), and interpolated.
LAWS, SPACING_MM = 9, 2.0
# Losses beyond this (dB) are not told from the floor.
MOST_DB = 20.0


def expected_at_edges(
    cloud: PointCloud, line: PoseLine, problem: Problem, T_base_part: Transform
) -> tuple[Array, Array, Array]:
    """Return the loss (m, laws), dB, positive, that the set-up lets one expect of the tilt of the placed surface, twice.

    And the distance (m, laws), mm, of that surface, continued flat past its rim; NaN where there is no beam.

    k alpha^2 per axis (`probe.tilt_loss_db_per_deg2`). A beam over the rim has its echo from what is still under it: the
    tilt is taken as that at the rim; or, the other extreme, as that of the surface bent on as it ends.
    """
    probe = problem.setup.probe
    x = law_offsets_mm(probe)
    at = np.unique(np.linspace(0, len(x) - 1, LAWS).round().astype(np.intp))
    rows = np.flatnonzero(line.present & (np.linalg.norm(line.beam_base, axis=1) > 0))
    loss = np.zeros((len(line.present), len(x)))
    expected = np.full(loss.shape, np.nan)
    if not len(rows):
        return loss, loss.copy(), expected
    step = max(1, round(SPACING_MM / max(line.spacing_mm, 1e-3)))
    some = np.unique(np.r_[rows[::step], rows[-1]])
    z, a = line.beam_base[some], line.array_base[some]
    origins = line.position_base[some, None] + x[at][:, None] * a[:, None]
    points_part = T_base_part.inv().points(origins.reshape(-1, 3))
    foot = problem.curved.closest(points_part)
    off = points_part - foot.points
    height = np.einsum("ij,ij->i", off, foot.normals)
    beyond = off - height[:, None] * foot.normals
    bent = foot.normals + np.einsum("nij,nj->ni", problem.curved.shape_operator(foot.face, foot.bary), beyond)
    bent /= np.linalg.norm(bent, axis=1, keepdims=True)
    # Linear between the laws looked up; a pose takes the tilt of the next one looked up.
    weights = np.stack([np.interp(np.arange(len(x)), at, one) for one in np.eye(len(at))])
    place = np.minimum(np.searchsorted(some, rows), len(some) - 1)
    beams, arrays = (np.repeat(v, len(at), axis=0) for v in (z, a))
    out = []
    for normals in (foot.normals, bent):
        tilts = tilts_deg(beams, arrays, T_base_part.directions(normals))
        b, c = (v.reshape(len(some), len(at)) @ weights for v in tilts)
        out.append(np.zeros_like(loss))
        out[-1][rows] = np.minimum(-loss_db(b, c, probe), MOST_DB)[place]
    expected[rows] = (height.reshape(len(some), len(at)) @ weights)[place]
    return out[0], out[1], expected
