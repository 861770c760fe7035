"""Where the part is by the word of most stretches of the scan, though the others agree on something else.

A quarter of the readings that see one and the same wrong thing (the table where the part ends, a clamp) pull every fit that
starts from all of them, and at the end of a lever no robust loss lets go of them again. So stretches are taken three at a
time (random sample consensus, M. A. Fischler, R. C. Bolles, Commun. ACM 24 (1981) 381, doi:10.1145/358669.358692; here all
triples, so that the same scan gives the same answer), and what agrees with the most readings is where to start.
"""

from itertools import combinations

import numpy as np

from alignment.estimate.problem import Problem
from alignment.estimate.surface_rows import Rows
from planner.frames import Array, Transform

# A reading agrees with a placement if it stands no farther off than this (mm); the first is what linear steps are good for.
ROUGHLY_MM, AGREES_MM = 0.8, 0.3
# With so few readings on the surface in agreement it is worth looking for another placement; that must have so many more.
SUSPICIOUS_AGREEMENT, BETTER_AGREEMENT = 0.85, 0.05
STRETCHES = 14
STARTS = 3
READING_SIGMA_MM = 0.3
# Starts whose motions differ by less than this, in prior standard deviations, are one.
SAME = 0.25
LINEAR_STEPS = 4


def agreement(rows: Rows, heard: Array) -> tuple[float, float]:
    """Return the share of the heard readings (n,) that agree with the placement, and of those of them on the surface."""
    use = heard > 0
    on = use & rows.valid
    agree = float((np.abs(rows.r[on]) < AGREES_MM).sum())
    return agree / max(1, int(use.sum())), agree / max(1, int(on.sum()))


def consensus_starts(rows: Rows, heard: Array, problem: Problem, T_base_part: Transform) -> list[Transform]:
    """Return the placements, best first, that most readings roughly agree with, from triples of stretches of the scan.

    rows: residuals of readings in the order they were taken, at the placement. Linear about it: a start, not an answer.
    """
    use = np.flatnonzero(rows.valid & (heard > 0))
    if len(use) < 6 * STRETCHES:
        return []
    r, x = rows.r[use], rows.jacobian[use] * problem.prior_sigma
    parts = np.array_split(np.arange(len(use)), STRETCHES)
    w = 1.0 / READING_SIGMA_MM**2
    normal = np.stack([w * x[p].T @ x[p] for p in parts])
    pull = np.stack([-w * x[p].T @ r[p] for p in parts])
    triples = np.array(list(combinations(range(STRETCHES), 3)))
    total = problem.total(T_base_part)
    z = np.linalg.solve(normal[triples].sum(axis=1) + np.eye(6), (pull[triples].sum(axis=1) - total)[..., None])[..., 0]
    left = np.abs(r + z @ x.T)
    score = (left < ROUGHLY_MM).mean(axis=1) - left.clip(max=ROUGHLY_MM).mean(axis=1) / ROUGHLY_MM
    chosen: list[Array] = []
    for k in np.argsort(-score, kind="stable"):
        if all(np.abs(z[k] - c).max() > SAME for c in chosen):
            chosen.append(z[k])
        if len(chosen) == STARTS:
            break
    return [problem.step(T_base_part, _refined(c, r, x, total)) for c in chosen]


def _refined(z: Array, r: Array, x: Array, total: Array) -> Array:
    """Return the motion fitted to all the readings that roughly agree with it."""
    for _ in range(LINEAR_STEPS):
        near = np.abs(r + x @ z) < ROUGHLY_MM
        w = near / READING_SIGMA_MM**2
        z = np.asarray(np.linalg.solve((x * w[:, None]).T @ x + np.eye(6), -(x * w[:, None]).T @ r - total))
    return z
