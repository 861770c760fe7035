"""From the nominal placement to within the scatter of the readings, whatever the offset in the capture range."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.estimate.patches import model_readings, reading_weights
from alignment.estimate.problem import Problem
from alignment.estimate.robust import huber_weights, mad_sigma, tukey_weights
from alignment.estimate.surface_rows import distance_rows
from planner.frames import Transform

SAMPLE = 3000
CONVEX_STEPS = 5
STEPS = 40
# What a single reading is taken to know (mm): more than it does, so that weak directions do not run off on noise.
READING_SIGMA_MM = 0.3
FLOOR_MM = 0.05
LEAST_VALID = 12
LEAST_SHARE = 1.0 / 16.0


@dataclass(frozen=True, eq=False)
class Captured:
    """The placement found, and whether the steps died out.

    scatter_mm: robust scatter of the sample. valid_share, inlier_share: of it that meets the surface, and that agrees.
    """

    T_base_part: Transform
    converged: bool
    scatter_mm: float
    valid_share: float
    inlier_share: float


def sample_rows(n: int, size: int = SAMPLE) -> NDArray[np.int64]:
    """Return at most `size` row numbers spread over n rows, always the same ones.

    The step is irrational to the rhythm of laws and poses (golden ratio), so that no law is favoured.
    """
    if n <= size:
        return np.arange(n)
    golden = 0.6180339887498949
    return np.unique((np.arange(size) + np.modf(np.arange(size) * golden)[0]) * n // size).astype(np.int64)


def capture(cloud: PointCloud, problem: Problem, start: Transform | None = None, size: int = SAMPLE) -> Captured:
    """Return the placement that a robust point-to-surface fit of a sample of readings converges to.

    Gauss-Newton on distances along the normal (Y. Chen, G. Medioni, Image Vision Comput. 10 (1992) 145,
    doi:10.1016/0262-8856(92)90066-C): Huber's convex loss first, which does not care where it starts, then Tukey's with the
    scale of the day, which drops what belongs to something else.
    """
    rows = sample_rows(len(cloud), size)
    origins, distance = (v[rows] for v in model_readings(cloud, problem.setup.alignment.point_model))
    beams = None if cloud.beams_base is None else cloud.beams_base[rows]
    heard = reading_weights(cloud)[rows]
    T = problem.T_base_nominal if start is None else start
    scatter, valid_share, inlier_share, converged = np.inf, 0.0, 0.0, False
    last, share = np.inf, 1.0
    for i in range(STEPS):
        found = distance_rows(problem.curved, T, problem.centre_mm(T), origins, distance, beams)
        use = found.valid & (heard > 0)
        valid_share = float(use.mean())
        if use.sum() < LEAST_VALID:
            break
        r, x = found.r[use], found.jacobian[use] * problem.prior_sigma
        scatter = mad_sigma(r, 1e-3, about_zero=True)
        sigma = max(scatter, FLOOR_MM)
        robust = huber_weights(r, sigma) if i < CONVEX_STEPS else tukey_weights(r, sigma)
        inlier_share = float((np.abs(r) < 4.0 * sigma).mean())
        weight = heard[use] * robust / READING_SIGMA_MM**2
        normal = (x * weight[:, None]).T @ x + np.eye(6)
        z = np.asarray(np.linalg.solve(normal, -(x * weight[:, None]).T @ r - problem.total(T)))
        moves = problem.moves_mm(z)
        # Readings that come and go with the scale can make the steps swing to and fro: then shorter ones.
        if i > CONVEX_STEPS and moves > 0.8 * last:
            share = max(0.5 * share, LEAST_SHARE)
        last = moves
        T = problem.step(T, share * z)
        if i >= CONVEX_STEPS and share * moves < 0.2 * FLOOR_MM:
            converged = True
            break
    return Captured(T, converged, float(scatter), valid_share, inlier_share)
