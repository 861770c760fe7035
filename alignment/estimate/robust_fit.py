"""The robust fit before the careful one: which patches and crossings belong to the part."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from alignment.estimate.patches import Patches
from alignment.estimate.problem import Problem
from alignment.estimate.robust import mad_sigma, tukey_weights
from alignment.estimate.surface_rows import patch_rows
from alignment.estimate.system import NUISANCES, EdgeData, nuisance_columns
from planner.frames import Array, Transform

STEPS = 60
SURFACE_FLOOR_MM = 0.01
EDGE_FLOOR_MM = 0.05
# Beyond this many robust standard deviations a patch or a crossing belongs to something else.
REJECT = 5.0
EDGE_REJECT = 4.0
LEAST_CROSSINGS = 12
# The scale of crossings: wide at first (mm), then narrower by this factor a step, and free from step ANNEALED on.
WIDE_MM, WIDE_STEPS, NARROWER, ANNEALED = 3.0, 3, 0.7, 15
# A row is never taken to know more than this (mm): noise is shared between rows.
SHARED_MM = 0.1
# Of a part that sprang back: how far its shape may be off (mm, one sigma), and in how many ways, each as good as one reading of
# it; and how far crossings may be off for it (mm, one sigma).
SHAPE_MM, SHAPE_FREEDOM, FIRM_FLOOR_MM = 0.5, 30.0, 0.2
SETTLED_MM = 1e-3
LEAST_SHARE = 1.0 / 32.0


@dataclass(frozen=True, eq=False)
class RobustFit:
    """Placement, patches used (p,), crossings used with their edges (None: too few), and whether the steps died out."""

    T_base_part: Transform
    used: NDArray[np.bool_]
    edges: EdgeData | None
    settled: bool


def robust_fit(
    patches: Patches, problem: Problem, start: Transform, edges: EdgeData | None, firm: bool = False
) -> RobustFit:
    """Return the placement of a robust fit (Tukey's biweight, scales from the data) of patches and crossings together.

    firm: the part has another shape than its CAD. Then the edges say where it is, and of the surface all patches count, but
    together for no more than a shape has degrees of freedom: it must not outvote edges and fixture.
    """
    T, settled = start, False
    last, last_z, share = np.inf, np.zeros(6), 1.0
    used = np.zeros(len(patches), dtype=bool)
    base = np.minimum(patches.count, 50.0)
    base = base / (1.0 + base)
    k = 6 if edges is None else 6 + NUISANCES
    nuisance = np.zeros(k - 6)
    for i in range(STEPS):
        rows = patch_rows(patches, problem.curved, T, problem.centre_mm(T))
        if rows.valid.sum() < 6:
            return RobustFit(T, rows.valid, None, False)
        r, x = rows.r[rows.valid], rows.jacobian[rows.valid] * problem.prior_sigma
        sigma = mad_sigma(r, SHAPE_MM if firm else SURFACE_FLOOR_MM, about_zero=True)
        used = rows.valid.copy()
        used[rows.valid] = np.abs(r) < REJECT * sigma
        w = base[rows.valid] * tukey_weights(r, sigma) / (SHARED_MM + sigma) ** 2
        if firm:
            w *= min(1.0, SHAPE_FREEDOM / (w.sum() * sigma**2))
        normal, pull = np.eye(k), -np.r_[problem.total(T), nuisance]
        normal[:6, :6] += (x * w[:, None]).T @ x
        pull[:6] -= (x * w[:, None]).T @ r
        if edges is not None:
            edges = _add_edges(edges, problem, T, nuisance, normal, pull, _scale_limits(i, firm))
        z = share * np.linalg.solve(normal, pull)
        T = problem.step(T, z[:6])
        nuisance = nuisance + z[6:]
        moves = problem.moves_mm(z[:6])
        # Rows that come and go with the scale can make the steps swing to and fro: then shorter ones.
        if i > ANNEALED and moves > 0.8 * last and z[:6] @ last_z < 0.0:
            share = max(0.5 * share, LEAST_SHARE)
        last, last_z = moves, z[:6]
        if moves < SETTLED_MM and i >= (3 if edges is None else ANNEALED):
            settled = True
            break
    if edges is not None and (edges.used.sum() < LEAST_CROSSINGS or not settled):
        # Crossings that do not agree on a place say nothing; the surface alone says what it can.
        return robust_fit(patches, problem, start, None, firm)
    return RobustFit(T, used, edges, settled)


def _scale_limits(i: int, firm: bool) -> tuple[float, float]:
    """Return the least and the largest scale (mm) of the crossings at step i: wide, then narrower step by step, then free.

    The scale of a poor start lets false crossings in, which keep the start poor; narrowing it whatever the residuals say
    (graduated non-convexity, A. Blake, A. Zisserman, Visual Reconstruction, MIT Press 1987) leads to where most agree.
    """
    floor_mm = FIRM_FLOOR_MM if firm else EDGE_FLOOR_MM
    if i < WIDE_STEPS:
        return WIDE_MM, np.inf
    if i < ANNEALED:
        return floor_mm, max(floor_mm, WIDE_MM * NARROWER ** (i - WIDE_STEPS))
    return floor_mm, np.inf


def _add_edges(
    edges: EdgeData,
    problem: Problem,
    T: Transform,
    nuisance: Array,
    normal: Array,
    pull: Array,
    limits_mm: tuple[float, float],
) -> EdgeData:
    """Add the crossings to the normal equations in place; return the edges with the crossings that belong."""
    found = edges.rows(problem, T)
    columns = nuisance_columns(edges, found)
    r = found.r + columns @ nuisance
    valid = found.valid
    if valid.sum() < LEAST_CROSSINGS:
        return replace(edges, used=valid & False)
    sigma = float(np.clip(mad_sigma(r[valid], EDGE_FLOOR_MM, about_zero=True), *limits_mm))
    weight = edges.points.weight
    # What is poorly known may lie farther off.
    off = np.abs(r) * np.sqrt(np.minimum(weight, 1.0))
    used = valid & (off < EDGE_REJECT * sigma)
    x = np.hstack([found.jacobian * problem.prior_sigma, columns])[used]
    w = weight[used] * tukey_weights(off[used], sigma) / (SHARED_MM + sigma) ** 2
    normal += (x * w[:, None]).T @ x
    pull -= (x * w[:, None]).T @ r[used]
    return replace(edges, used=used)
