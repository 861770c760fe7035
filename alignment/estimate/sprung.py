"""Where a part is that sprang back: by its edges and its fixture, not by the motion that explains most of its shape.

A bend or a twist of a millimetre or two is also a slide of a curved surface by many millimetres, with less left of it than any
shape would leave. Counted one by one, the patches of a scan would buy that slide at any price; but a shape has few degrees of
freedom, and a fixture that holds parts to a millimetre or two makes a slide of fifty far less likely than a bend of two.
"""

from dataclasses import dataclass, replace

import numpy as np

from alignment.estimate.edge_shape import foot_shift_mm
from alignment.estimate.patches import Patches
from alignment.estimate.problem import Problem
from alignment.estimate.robust_fit import RobustFit, robust_fit
from alignment.estimate.surface_rows import patch_rows
from alignment.estimate.system import EdgeData
from alignment.estimate.verdict import limit_issues, nominal_shift
from planner.frames import Array, Transform

# Rounds of slope of the shape, shift of the feet of crossings, and placement.
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Sprung:
    """The fit that allows for a shape; whether the estimate is to be it; other placements that may be the true one."""

    fit: RobustFit
    taken: bool
    rivals: tuple[Transform, ...]

    def doubt(self, problem: Problem, T_base_part: Transform, held: Array) -> Array:
        """Return what the rivals add to the covariance (6, 6) of an estimate, whitened by the prior."""
        out = np.zeros((6, 6))
        for rival in (*self.rivals, self.fit.T_base_part):
            apart = problem.total(rival) - problem.total(T_base_part)
            apart = apart - held @ (held.T @ apart)
            out += np.outer(apart, apart)
        return out


def beyond_limits(problem: Problem, T_base_part: Transform) -> bool:
    """Return whether the part would have moved farther than the setup's limits allow."""
    setup = problem.setup
    return bool(limit_issues(*nominal_shift(setup, T_base_part, problem.curved.surface.centroid_part), setup))


def sprung_fit(
    patches: Patches,
    problem: Problem,
    start: Transform,
    T_rigid: Transform,
    crossed: EdgeData | None,
    stay_on_edges: bool,
) -> Sprung | None:
    """Return the fit that allows for a shape; None where it tells nothing that the rigid one does not.

    T_rigid: the placement that leaves least. It remains the estimate unless the part is to stay on its edges or would have
    left the limits.
    """
    away = beyond_limits(problem, T_rigid)
    on_cad = robust_fit(patches, problem, start, crossed, firm=True)
    fit = on_cad
    for _ in range(ROUNDS):
        if fit.edges is None:
            break
        T = fit.T_base_part
        rows = patch_rows(patches, problem.curved, T, problem.centre_mm(T))
        shift_mm = foot_shift_mm(rows, fit.edges.cad_rows(problem, T))
        fit = robust_fit(patches, problem, T, replace(fit.edges, shift_mm=shift_mm), firm=True)
    if beyond_limits(problem, fit.T_base_part) or (fit.edges is None and not away):
        return None
    # How far the shape moved the crossings is known about as well as it is large.
    rivals = (on_cad.T_base_part,) if fit.edges is not None else (T_rigid,)
    return Sprung(fit, stay_on_edges or away, rivals)
