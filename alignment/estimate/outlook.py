"""What the corrected inspection will see: the estimate's own error included, for no correction leaves nothing behind."""

import numpy as np
from scipy.stats import norm, qmc

from alignment.estimate.patches import distance_hessian
from alignment.metrics import expected
from alignment.metrics.figures import WITHIN_DB, Prediction, loss_db, spread, tilts_deg
from planner.frames import Array, Transform
from planner.placement import assume_nominal
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.normals import unit
from planner.toolpath import ToolPath

DRAWS = 64
MOST_POSES = 3000


def after_correction(
    curved: CurvedSurface, path: ToolPath, setup: Setup, T_base_part: Transform, covariance: Array
) -> Prediction:
    """Return what `path`, run in the corrected base, is expected to see of the part.

    covariance (6, 6): of the motion about the area centroid, rad and mm, axes of base, about the estimate `T_base_part`.
    The path meets the part as planned but for that motion: the mean over fixed draws from it (root mean square for the
    standard deviation). To first order in the motion the distance of a pose changes by the normal displacement at its foot;
    its tilt by the turn, and by the normal's own change as the foot slides (second derivative of the distance). The robot's
    own wander on the day is not in it.
    """
    data = path.take(path.is_data)
    if len(data) > MOST_POSES:
        data = data.take(np.unique(np.linspace(0, len(data) - 1, MOST_POSES).astype(np.intp)))
    Ts = data.Ts_part_tcp
    arrays, beams = Ts.rotation_matrix[:, :, 0], Ts.rotation_matrix[:, :, 2]
    origin = Ts.xyz_mm - setup.probe.face_offset_mm * beams
    foot = curved.closest(origin)
    on = foot.interior
    if not on.any():
        return expected(curved, path, setup, assume_nominal(setup.T_base_partnom)).summary
    arrays, beams, origin, normal = arrays[on], beams[on], origin[on], foot.normals[on]
    bend = distance_hessian(curved.shape_operator(foot.face[on], foot.bary[on]), foot.distance_mm[on])
    arm = origin - curved.surface.centroid_part
    std2, rest = [], []
    for w, v in _draws(covariance, T_base_part):
        moved = v + np.cross(w, arm)
        distance = foot.distance_mm[on] - np.einsum("ij,ij->i", moved, normal)
        turned = unit(normal + np.cross(w, normal) - np.einsum("nij,nj->ni", bend, moved))
        b_deg, c_deg = tilts_deg(beams, arrays, turned)
        std, width = spread(distance)
        sine = np.linalg.norm(np.cross(turned, beams), axis=1)
        tilt = np.degrees(np.arctan2(sine, -np.einsum("ij,ij->i", turned, beams)))
        std2.append(std**2)
        db = loss_db(b_deg, c_deg, setup.probe)
        rest.append([width, tilt.max(), (db >= -WITHIN_DB).mean(), np.abs(db).mean()])
    width, tilt_max, within, mean_abs_db = (float(v) for v in np.mean(rest, axis=0))
    return Prediction(float(np.sqrt(np.mean(std2))), width, tilt_max, within, mean_abs_db)


def _draws(covariance: Array, T_base_part: Transform) -> list[tuple[Array, Array]]:
    """Return turns (3,) and shifts (3,) of the part in its own axes, always the same ones for the same covariance."""
    scale = np.sqrt(np.diag(covariance))
    value, vector = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vector * np.sqrt(np.maximum(value, 0.0))
    unit_draws = norm.ppf(qmc.Sobol(6, scramble=True, rng=np.random.default_rng(20261)).random(DRAWS))
    turn = T_base_part.rotation_matrix
    return [(xi[:3] @ turn, xi[3:] @ turn) for xi in unit_draws @ root.T]
