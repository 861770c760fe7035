"""From the nominal placement to within the scatter of the readings, whatever the offset in the capture range."""

from dataclasses import dataclass

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.consensus import BETTER_AGREEMENT, SUSPICIOUS_AGREEMENT, agreement, consensus_starts
from alignment.estimate.problem import Problem
from alignment.estimate.readings import model_readings, reading_weights, sample_rows
from alignment.estimate.robust import huber_weights, mad_sigma, tukey_weights
from alignment.estimate.surface_rows import Rows, Track
from planner.frames import Array, Transform
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
    scale of the day, which drops what belongs to something else. Where many readings still disagree, as when a quarter of
    the part is not there and the probe saw the table, the search begins again from what most stretches of the scan agree on.
    """
    rows = sample_rows(len(cloud), size)
    origins, distance = model_readings(cloud, problem.setup.alignment.point_model, rows)
    beams = None if cloud.beams_base is None else cloud.beams_base[rows]
    heard = reading_weights(cloud, rows)
    T = problem.T_base_nominal if start is None else start
    every = Track(problem.curved, origins, distance, beams)
    few = np.arange(0, len(rows), max(1, len(rows) // FEW))

    def descend(start: Transform, convex_steps: int) -> tuple[Captured, Rows]:
        track = every
        if len(few) < len(rows):
            follower = Follower(problem.curved, loose=True)
            track = Track(problem.curved, origins[few], distance[few], None if beams is None else beams[few], follower)
        return _descend(problem, track, every, heard, heard[few], start, convex_steps)

    found, left = descend(T, CONVEX_STEPS)
    agree, on_surface = agreement(left, heard)
    if on_surface < SUSPICIOUS_AGREEMENT:
        for other in consensus_starts(every.rows(T, problem.centre_mm(T)), heard, problem, T):
            again, rest = descend(other, 0)
            better = agreement(rest, heard)[0]
            if again.converged and better > agree + BETTER_AGREEMENT:
                found, agree = again, better
    return found


def _descend(
    problem: Problem, few: Track, every: Track, all_heard: Array, few_heard: Array, T: Transform, convex_steps: int
) -> tuple[Captured, Rows]:
    """Return where the steps from T lead, first on few readings, then on all, and the last residuals of all."""
    track = few
    scatter, valid_share, inlier_share, converged = np.inf, 0.0, 0.0, False
    last, last_z, share = np.inf, np.zeros(6), 1.0
    for i in range(STEPS):
        heard = all_heard if track is every else few_heard
        found = track.rows(T, problem.centre_mm(T))
        use = found.valid & (heard > 0)
        valid_share = float(use.mean())
        if use.sum() < LEAST_VALID:
            if track is every:
                break
            track = every
            continue
        r, x = found.r[use], found.jacobian[use] * problem.prior_sigma
        scatter = mad_sigma(r, 1e-3, about_zero=True)
        sigma = max(scatter, FLOOR_MM)
        robust = huber_weights(r, sigma) if i < convex_steps else tukey_weights(r, sigma)
        inlier_share = float((np.abs(r) < 4.0 * sigma).mean())
        weight = len(all_heard) / len(heard) * heard[use] * robust / READING_SIGMA_MM**2
        normal = (x * weight[:, None]).T @ x + np.eye(6)
        z = np.asarray(np.linalg.solve(normal, -(x * weight[:, None]).T @ r - problem.total(T)))
        moves = problem.moves_mm(z)
        # Readings that come and go with the scale can make the steps swing to and fro: then shorter ones. Steps that only
        # creep, as along what a part that sprang back hardly shows, go on as they are.
        if i > convex_steps and moves > 0.8 * last and z @ last_z < 0.0:
            share = max(0.5 * share, LEAST_SHARE)
        last, last_z = moves, z
        T = problem.step(T, share * z)
        if i >= convex_steps and share * moves < 0.2 * FLOOR_MM:
            if track is every:
                converged = True
                break
            track, last, share = every, np.inf, 1.0
    # A part that sprang back lets the steps creep on along it, by less than its shape differs: near enough to go on from.
    converged = converged or (track is every and last < max(scatter, FLOOR_MM))
    left = every.rows(T, problem.centre_mm(T))
    return Captured(T, converged, float(scatter), valid_share, inlier_share), left
