"""From the nominal placement to within the scatter of the readings, whatever the offset in the capture range."""

from dataclasses import dataclass

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.patches import model_readings, reading_weights, sample_rows
from alignment.estimate.problem import Problem
from alignment.estimate.robust import huber_weights, mad_sigma, tukey_weights
from alignment.estimate.surface_rows import Track
from planner.frames import Transform
from planner.surface.follow import Follower

SAMPLE = 1500
# Of the sample so many find the way; all of it says where it ends.
FEW = 500
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


def capture(cloud: PointCloud, problem: Problem, start: Transform | None = None, size: int = SAMPLE) -> Captured:
    """Return the placement that a robust point-to-surface fit of a sample of readings converges to.

    Gauss-Newton on distances along the normal (Y. Chen, G. Medioni, Image Vision Comput. 10 (1992) 145,
    doi:10.1016/0262-8856(92)90066-C): Huber's convex loss first, which does not care where it starts, then Tukey's with the
    scale of the day, which drops what belongs to something else.
    """
    rows = sample_rows(len(cloud), size)
    origins, distance = model_readings(cloud, problem.setup.alignment.point_model, rows)
    beams = None if cloud.beams_base is None else cloud.beams_base[rows]
    heard = reading_weights(cloud, rows)
    T = problem.T_base_nominal if start is None else start
    every = Track(problem.curved, origins, distance, beams)
    few = np.arange(0, len(rows), max(1, len(rows) // FEW))
    track = every
    if len(few) < len(rows):
        follower = Follower(problem.curved, loose=True)
        track = Track(problem.curved, origins[few], distance[few], None if beams is None else beams[few], follower)
    scatter, valid_share, inlier_share, converged = np.inf, 0.0, 0.0, False
    last, last_z, share = np.inf, np.zeros(6), 1.0
    for i in range(STEPS):
        weighed = heard if track is every else heard[few]
        found = track.rows(T, problem.centre_mm(T))
        use = found.valid & (weighed > 0)
        valid_share = float(use.mean())
        if use.sum() < LEAST_VALID:
            if track is every:
                break
            track = every
            continue
        r, x = found.r[use], found.jacobian[use] * problem.prior_sigma
        scatter = mad_sigma(r, 1e-3, about_zero=True)
        sigma = max(scatter, FLOOR_MM)
        robust = huber_weights(r, sigma) if i < CONVEX_STEPS else tukey_weights(r, sigma)
        inlier_share = float((np.abs(r) < 4.0 * sigma).mean())
        weight = len(heard) / len(weighed) * weighed[use] * robust / READING_SIGMA_MM**2
        normal = (x * weight[:, None]).T @ x + np.eye(6)
        z = np.asarray(np.linalg.solve(normal, -(x * weight[:, None]).T @ r - problem.total(T)))
        moves = problem.moves_mm(z)
        # Readings that come and go with the scale can make the steps swing to and fro: then shorter ones. Steps that only
        # creep, as along what a part that sprang back hardly shows, go on as they are.
        if i > CONVEX_STEPS and moves > 0.8 * last and z @ last_z < 0.0:
            share = max(0.5 * share, LEAST_SHARE)
        last, last_z = moves, z
        T = problem.step(T, share * z)
        if i >= CONVEX_STEPS and share * moves < 0.2 * FLOOR_MM:
            if track is every:
                converged = True
                break
            track, last, share = every, np.inf, 1.0
    # A part that sprang back lets the steps creep on along it, by less than its shape differs: near enough to go on from.
    converged = converged or (track is every and last < max(scatter, FLOOR_MM))
    return Captured(T, converged, float(scatter), valid_share, inlier_share)
