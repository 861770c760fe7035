"""The MAP estimate: where the part most probably is, given the distances, the edges, the fixture and the noise."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.estimate.capture import Captured, capture
from alignment.estimate.cells import cells_along_passes, cells_in_space
from alignment.estimate.directions import Direction, directions, held_basis
from alignment.estimate.mixture import mixture, solve
from alignment.estimate.noise_fit import NoiseFit, fit_noise, noise_prior
from alignment.estimate.noise_rows import noise_rows
from alignment.estimate.patches import Patches, condense
from alignment.estimate.pose_line import PoseLine, pose_line
from alignment.estimate.problem import Problem
from alignment.estimate.robust import mad_sigma, tukey_weights
from alignment.estimate.surface_rows import Rows, patch_rows
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

CELL_MM = 8.0
MOST_CELLS = 30_000
ROBUST_STEPS = 30
ROBUST_FLOOR_MM = 0.01
# Beyond this many robust standard deviations a patch belongs to something else.
REJECT = 5.0
SOLVE_STEPS = 8
SOLVED_MM = 2e-5


@dataclass(frozen=True, eq=False)
class MapFit:
    """The estimate and all that is needed to judge it.

    covariance (6, 6): of xi = (rx, ry, rz, x, y, z), rad and mm, axes of base, about `centre_mm`, held directions at their
    prior. rows: residuals of `patches`; used (p,): those the estimate rests on.
    """

    T_base_part: Transform
    centre_mm: Array
    covariance: Array
    directions: tuple[Direction, ...]
    patches: Patches
    rows: Rows
    used: NDArray[np.bool_]
    noise: NoiseFit
    captured: Captured
    converged: bool
    edges: dict[str, Any] | None = None
    issues: tuple[Issue, ...] = field(default=())


def align_map(cloud: PointCloud, curved: CurvedSurface, setup: Setup, edges: bool = True) -> MapFit | Captured:
    """Return the estimate, or what the capture came to where nothing can be estimated."""
    problem = Problem(curved, setup)
    captured = capture(cloud, problem)
    if not captured.converged:
        return captured
    patches = condense_cloud(cloud, problem, captured.T_base_part)
    T, used, settled = robust_fit(patches, problem, captured.T_base_part)
    if used.sum() < 6:
        return captured
    rows = patch_rows(patches, curved, T, problem.centre_mm(T))
    size = float(np.ptp(curved.surface.vertices, axis=0).max())
    swath = setup.probe.swath_mm

    def system(T_now: Transform):
        now = patch_rows(patches, curved, T_now, problem.centre_mm(T_now))
        return noise_rows(patches, now, used, problem.prior_sigma, swath)

    prior = noise_prior(patches.sigma_mm, size)
    first = system(T)
    noise = fit_noise(first, prior)
    mix = mixture(first, noise)
    T, _ = _settle(T, system, mix, problem, np.zeros((6, 0)))
    final = system(T)
    mix = mixture(final, noise)
    held = held_basis(solve(mix, final.r, problem.total(T), np.zeros((6, 0))).covariance, problem.lock_rows(T))
    T, converged = _settle(T, system, mix, problem, held)
    # Directions turn with the part: judge them where it came to rest.
    final = system(T)
    mix = mixture(final, noise)
    free = solve(mix, final.r, problem.total(T), np.zeros((6, 0)))
    held = held_basis(free.covariance, problem.lock_rows(T))
    T, converged = _settle(T, system, mix, problem, held)
    post = solve(mix, system(T).r, problem.total(T), held)
    rows = patch_rows(patches, curved, T, problem.centre_mm(T))
    scale = problem.prior_sigma
    found = directions(post.covariance, held, problem.lock_rows(T), scale, problem.moments_base(T), setup.tolerances)
    return MapFit(
        T,
        problem.centre_mm(T),
        post.covariance * np.outer(scale, scale),
        found,
        patches,
        rows,
        used & rows.valid,
        noise,
        captured,
        settled and converged,
    )


def condense_cloud(
    cloud: PointCloud, problem: Problem, T_base_part: Transform, line: PoseLine | None = None
) -> Patches:
    """Return the patches of a cloud: along its passes, or in space where it has none."""
    setup = problem.setup
    size = CELL_MM
    while True:
        if cloud.beams_base is None:
            cells = cells_in_space(cloud.origins_base, size)
        else:
            cells = cells_along_passes(cloud, line or pose_line(cloud, setup.probe), setup.probe, size)
        if len(cells) <= MOST_CELLS:
            break
        size *= 1.25
    return condense(cloud, cells, problem.curved, T_base_part, setup.alignment.point_model)


def robust_fit(patches: Patches, problem: Problem, start: Transform) -> tuple[Transform, NDArray[np.bool_], bool]:
    """Return the placement of a robust fit to patches, the patches that belong to the part, and whether it settled."""
    T, settled = start, False
    used = np.zeros(len(patches), dtype=bool)
    weight = np.minimum(patches.count, 50.0) / (1.0 + np.minimum(patches.count, 50.0))
    for _ in range(ROBUST_STEPS):
        rows = patch_rows(patches, problem.curved, T, problem.centre_mm(T))
        valid = rows.valid
        if valid.sum() < 6:
            return T, valid, False
        r, x = rows.r[valid], rows.jacobian[valid] * problem.prior_sigma
        sigma = mad_sigma(r, ROBUST_FLOOR_MM, about_zero=True)
        used = valid.copy()
        used[valid] = np.abs(r) < REJECT * sigma
        w = weight[valid] * tukey_weights(r, sigma) / (0.1 + sigma) ** 2
        z = np.linalg.solve((x * w[:, None]).T @ x + np.eye(6), -(x * w[:, None]).T @ r - problem.total(T))
        T = problem.step(T, z)
        if problem.moves_mm(z) < 1e-3:
            settled = True
            break
    return T, used, settled


def _settle(T: Transform, system, mix, problem: Problem, held: Array) -> tuple[Transform, bool]:
    """Step until the part no longer moves, with the noise as it is."""
    for _ in range(SOLVE_STEPS):
        step = solve(mix, system(T).r, problem.total(T), held).step
        T = problem.step(T, step)
        if problem.moves_mm(step) < SOLVED_MM:
            return T, True
    return T, problem.moves_mm(step) < 100 * SOLVED_MM
