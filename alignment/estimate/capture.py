"""From the nominal placement to within the scatter of the readings, whatever the offset in the capture range."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.consensus import BETTER_AGREEMENT, SUSPICIOUS_AGREEMENT, agreement, consensus_starts
from alignment.estimate.problem import Problem
from alignment.estimate.robust import huber_weights, mad_sigma, tukey_weights
from alignment.estimate.sample import SAMPLE, Sample, Sampler, sampler
from alignment.estimate.surface_rows import Rows, joined_rows
from planner.frames import Array, Transform

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
    """Return the placement that a robust point-to-surface fit of a sample of readings converges to."""
    sample = sampler(cloud, problem.curved, problem.setup.alignment.point_model, size)
    return capture_together([sample], problem, start)[0]


def capture_together(samplers: Sequence[Sampler], problem: Problem, start: Transform | None = None) -> list[Captured]:
    """Return for each scan the placement that the samples of all of them converge to together.

    Gauss-Newton on distances along the normal (Y. Chen, G. Medioni, Image Vision Comput. 10 (1992) 145,
    doi:10.1016/0262-8856(92)90066-C): Huber's convex loss first, which does not care where it starts, then Tukey's with the
    scale of the day, which drops what belongs to something else. Where many readings still disagree, as when a quarter of
    the part is not there and the probe saw the table, the search begins again from what most stretches of the scans agree on.
    Every scan has a scale of its own, so that one that fits badly does not loosen the others.
    """
    T = problem.T_base_nominal if start is None else start
    every = [s.every for s in samplers]
    heard = np.concatenate([s.heard for s in every])
    found, left = _descend(problem, [s.few() for s in samplers], every, T, CONVEX_STEPS)
    agree, on_surface = agreement(left, heard)
    if on_surface < SUSPICIOUS_AGREEMENT:
        for other in consensus_starts(_all_rows(every, T, problem), heard, problem, T):
            again, rest = _descend(problem, [s.few() for s in samplers], every, other, 0)
            better = agreement(rest, heard)[0]
            if all(c.converged for c in again) and better > agree + BETTER_AGREEMENT:
                found, agree = again, better
    return found


def _all_rows(samples: Sequence[Sample], T: Transform, problem: Problem) -> Rows:
    return joined_rows([s.rows(T, problem.centre_mm(T)) for s in samples])


def _descend(
    problem: Problem, few: Sequence[Sample], every: Sequence[Sample], T: Transform, convex_steps: int
) -> tuple[list[Captured], Rows]:
    """Return where the steps from T lead, first on few readings, then on all, and the last residuals of all."""
    samples, converged = few, False
    last, last_z, share = np.inf, np.zeros(6), 1.0
    told: list[_Told] = []
    for i in range(STEPS):
        normal, pull, centre = np.eye(6), -problem.total(T), problem.centre_mm(T)
        told = []
        for sample, whole in zip(samples, every, strict=True):
            added = _Told.of(sample, sample.rows(T, centre), problem.prior_sigma, i < convex_steps)
            told.append(added)
            normal += len(whole) / len(sample) * added.normal
            pull -= len(whole) / len(sample) * added.pull
        if all(t.scatter_mm == np.inf for t in told):
            if samples is every:
                break
            samples = every
            continue
        z = np.asarray(np.linalg.solve(normal, pull))
        moves = problem.moves_mm(z)
        # Readings that come and go with the scale can make the steps swing to and fro: then shorter ones. Steps that only
        # creep, as along what a part that sprang back hardly shows, go on as they are.
        if i > convex_steps and moves > 0.8 * last and z @ last_z < 0.0:
            share = max(0.5 * share, LEAST_SHARE)
        last, last_z = moves, z
        T = problem.step(T, share * z)
        if i >= convex_steps and share * moves < 0.2 * FLOOR_MM:
            if samples is every:
                converged = True
                break
            samples, last, share = every, np.inf, 1.0
    # A part that sprang back lets the steps creep on along it, by less than its shape differs: near enough to go on from.
    converged = converged or (
        samples is every and last < max([FLOOR_MM, *(t.scatter_mm for t in told if np.isfinite(t.scatter_mm))])
    )
    return [
        Captured(T, bool(converged and np.isfinite(t.scatter_mm)), t.scatter_mm, t.valid_share, t.inlier_share)
        for t in told
    ], _all_rows(every, T, problem)


@dataclass(frozen=True, eq=False)
class _Told:
    """What one sample adds to the normal equations (6, 6), (6,); scatter_mm: infinite where it says too little."""

    normal: Array
    pull: Array
    scatter_mm: float
    valid_share: float
    inlier_share: float

    @classmethod
    def of(cls, sample: Sample, found: Rows, prior_sigma: Array, convex: bool) -> "_Told":
        use = found.valid & (sample.heard > 0)
        if use.sum() < LEAST_VALID:
            return cls(np.zeros((6, 6)), np.zeros(6), np.inf, float(use.mean()), 0.0)
        r, x = found.r[use], found.jacobian[use] * prior_sigma
        scatter = mad_sigma(r, 1e-3, about_zero=True)
        sigma = max(scatter, FLOOR_MM)
        robust = huber_weights(r, sigma) if convex else tukey_weights(r, sigma)
        weight = sample.heard[use] * robust / READING_SIGMA_MM**2
        weighted = x * weight[:, None]
        inliers = float((np.abs(r) < 4.0 * sigma).mean())
        return cls(weighted.T @ x, weighted.T @ r, float(scatter), float(use.mean()), inliers)
