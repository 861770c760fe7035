"""The field given the noise and the smoothness: nodes that do not belong left out, and how well passes foretell each other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve

from alignment.non_rigid.covariance import ACROSS, ALONG, FIELD, NodeCovariance, scaling
from alignment.non_rigid.field import Field
from alignment.non_rigid.nodes import Nodes
from planner.errors import fail
from planner.frames import Array, Transform
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

# A node this many standard deviations from what all others say of it is not of the part.
REJECT = 5.0
ROUNDS = 4
# Nodes left out at a time, so that one bad node does not take its neighbours along.
SHARE_AT_ONCE = 0.03
BLOCKS = 12


@dataclass(frozen=True, eq=False)
class Solved:
    """Of n nodes: lower (n, n), alpha (n,) = K^-1 deviation, inverse (n, n) = K^-1."""

    lower: Array
    alpha: Array
    inverse: Array


def solve_nodes(nodes: Nodes, theta: Array, axes: Array, with_field: bool = True) -> Solved:
    """Return the factored covariance of the nodes and what follows from it."""
    covariance = NodeCovariance(nodes, axes)
    k = covariance.noise(theta)[0] + covariance.rigid
    if with_field:
        k = k + covariance.field(theta)[0]
    try:
        lower = np.linalg.cholesky(k)
    except LinAlgError:
        raise fail(
            "non-rigid-singular",
            "the readings give no usable covariance for a deformation field.",
            "Run the alignment as rigid.",
            "scan",
        ) from None
    alpha = cho_solve((lower, True), nodes.deviation_mm, check_finite=False)
    return Solved(np.asarray(lower), alpha, cho_solve((lower, True), np.eye(len(nodes)), check_finite=False))


def belonging(nodes: Nodes, theta: Array, axes: Array) -> NDArray[np.bool_]:
    """Return which nodes (n,) agree with what the others foretell of them, each left out in turn.

    Leave-one-out residuals in closed form: alpha_i / (K^-1)_ii with variance 1 / (K^-1)_ii (Rasmussen and Williams 2006,
    eq. 5.12). The scale is judged by the nodes themselves where they scatter more than the model believes.
    """
    keep = np.ones(len(nodes), dtype=bool)
    for _ in range(ROUNDS):
        at = np.flatnonzero(keep)
        solved = solve_nodes(nodes.only(keep), theta, axes)
        z = np.abs(solved.alpha) / np.sqrt(np.diag(solved.inverse))
        scale = max(1.0, 1.4826 * float(np.median(z)))
        bad = np.flatnonzero(z > REJECT * scale)
        if not len(bad) or len(at) < 10:
            break
        worst = bad[np.argsort(-z[bad])][: max(1, int(SHARE_AT_ONCE * len(at)))]
        keep[at[worst]] = False
    return keep


def foretold_rms_mm(nodes: Nodes, solved: Solved) -> float:
    """Return the rms (mm) of the error with which each pass is foretold by all others (blocks in space without passes)."""
    if nodes.track.known:
        group = nodes.track.pass_id[nodes.track.block]
    else:
        flat = nodes.points_part - nodes.points_part.mean(axis=0)
        along = flat @ np.linalg.svd(flat, full_matrices=False)[2][0]
        group = (np.argsort(np.argsort(along)) * BLOCKS // len(along)).astype(np.int32)
    error = np.zeros(len(nodes))
    for name in np.unique(group):
        at = np.flatnonzero(group == name)
        error[at] = np.linalg.solve(solved.inverse[np.ix_(at, at)], solved.alpha[at])
    return float(np.sqrt(np.mean(error**2)))


def field_of(
    nodes: Nodes, theta: Array, axes: Array, solved: Solved, curved: CurvedSurface, T_base_part: Transform, setup: Setup
) -> Field:
    """Return the posterior field relative to the placement `T_base_part` that the nodes were taken at."""
    turn = T_base_part.rotation_matrix
    fixture = setup.fixture
    prior = np.repeat([np.radians(fixture.sigma_deg), fixture.sigma_mm], 3)
    # The prior is the same about and along all axes, so it may be turned into those of the part.
    design = np.hstack([nodes.design[:, :3] @ turn, nodes.design[:, 3:] @ turn])
    motion = prior * (design.T @ solved.alpha)
    return Field(
        curved, nodes.points_part, solved.alpha, motion, float(np.exp(theta[FIELD])),
        scaling(axes, theta[[ALONG, ACROSS]]), solved.lower, design, prior,
    )  # fmt: skip
