"""The MAP estimate: where the part most probably is, given the distances, the edges, the fixture and the noise."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.estimate.capture import Captured, capture
from alignment.estimate.cells import Cells, cells_along_passes, cells_in_space
from alignment.estimate.directions import Direction, directions, held_basis
from alignment.estimate.edge_curve import locate
from alignment.estimate.edge_gain import expected_at_edges
from alignment.estimate.edge_points import edge_points
from alignment.estimate.edge_report import edge_report, off_edges
from alignment.estimate.edge_rows import EdgeMap
from alignment.estimate.locks import LockStrain, lock_strain
from alignment.estimate.mixture import Mixture, Posterior, mixture, solve, tail_scale
from alignment.estimate.noise_fit import NoiseFit, fit_noise
from alignment.estimate.noise_prior import noise_prior
from alignment.estimate.patches import Patches, condense
from alignment.estimate.pose_line import PoseLine, pose_line
from alignment.estimate.problem import Problem
from alignment.estimate.readings import Readings, look_at
from alignment.estimate.robust_fit import robust_fit
from alignment.estimate.sprung import Sprung, beyond_limits, sprung_fit
from alignment.estimate.surface_rows import Rows, same_afresh
from alignment.estimate.system import BIAS_SHARE, EdgeData, System
from planner.frames import Array, Transform
from planner.setup import Setup
from planner.surface.boundary import boundary
from planner.surface.curved import CurvedSurface
from planner.surface.follow import Follower

CELL_MM = 8.0
MOST_CELLS = 5_000
SOLVE_STEPS = 10
SOLVED_MM = 2e-5
# A step this long (mm), after the capture, is the data pulling against a lock that cannot hold.
RUNAWAY_MM = 30.0
# Directions turn with the part as held ones go back to nominal; they are judged again where it came to rest.
ROUNDS = 2
# A misfit (rms, mm) that no robot's noise explains, and how much more of it than needed an estimate may leave.
SHAPE_MM = 0.1
MUCH_WORSE = 1.1
# Tails that the data show widen the claim by a few per cent; more comes of the prior's own doubt about long correlations, which
# the covariance has in it already (docs/alignment.md, Calibration).
MOST_WIDER = 1.1
# A fall of the echo that misses the beam's S-curve by more than this (mean square of shares, each at most 0.01) is no edge's
# alone: three of its eight readings are elsewhere, as where the tilt of a part that sprang back takes some of it.
MOST_MISFIT = 3.5e-3
# Noise models that are enough to step with; the last round takes them all.
FEW = 8


@dataclass(frozen=True, eq=False)
class MapFit:
    """The estimate and all that is needed to judge it.

    covariance (6, 6): of xi = (rx, ry, rz, x, y, z), rad and mm, axes of base, about `centre_mm`, held directions at their
    prior. rows: residuals of `patches`; used (p,): those the estimate rests on. edges: what the crossings say, or None.
    strain: what the readings say of the locked axes.
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
    strain: LockStrain | None = None


@dataclass(frozen=True, eq=False)
class State:
    """A placement, and the edges' bias, lag and tilt loss (3,) or nothing (0,), in their sigmas."""

    T_base_part: Transform
    nuisance: Array


def align_map(
    cloud: PointCloud, curved: CurvedSurface, setup: Setup, edges: bool = True, stay_on_edges: bool = False
) -> MapFit | Captured:
    """Return the estimate, or what the capture came to where nothing can be estimated.

    stay_on_edges: of a part that sprang back, say where its edges put it, because its shape will be followed; else where
    least of the shape is left, even if that is a slide off the edges: the covariance then reaches to where they put it.
    """
    problem = Problem(curved, setup)
    # The capture is many small steps, the rest few large ones that let go of the interpreter: side by side.
    with ThreadPoolExecutor(1) as beside:
        ahead = beside.submit(_ahead, cloud, problem)
        captured = capture(cloud, problem)
        line, readings, cells = ahead.result()
    if not captured.converged:
        return captured
    patches = condense(readings, cells, curved, captured.T_base_part)
    crossed = edge_data(cloud, problem, line, captured.T_base_part) if edges else None
    found = fit_captured(problem, captured, patches, crossed)
    if isinstance(found, MapFit) and not same_afresh(patches, curved, found.T_base_part, found.rows):
        # Feet that were followed over a fold: now every patch asks the whole surface at every step.
        patches = replace(patches, follower=Follower(curved))
        found = fit_captured(problem, captured, patches, crossed)
    if not isinstance(found, MapFit) or not _may_have_sprung(found, problem):
        return found
    # A slide along the shape of a part that sprang back and a late clock explain each other: then the clock is right.
    as_said = None if crossed is None else crossed.as_said()
    start = found.T_base_part
    if beyond_limits(problem, start):
        start = problem.T_base_nominal
        patches = condense(readings, cells, curved, start)
    sprung = sprung_fit(patches, problem, start, found.T_base_part, as_said, stay_on_edges)
    return found if sprung is None else fit_captured(problem, captured, patches, as_said, sprung)


def _may_have_sprung(found: MapFit, problem: Problem) -> bool:
    if beyond_limits(problem, found.T_base_part):
        return True
    return found.edges is not None and (_shape_mm(found) > MUCH_WORSE * SHAPE_MM or off_edges(found.edges))


def _shape_mm(found: MapFit) -> float:
    """Return what the estimate leaves of the patches it rests on (rms, mm)."""
    used = found.used
    return float(np.sqrt(np.average(found.rows.r[used] ** 2, weights=found.patches.count[used]))) if used.any() else 0.0


def fit_captured(
    problem: Problem, captured: Captured, patches: Patches, crossed: EdgeData | None, sprung: Sprung | None = None
) -> MapFit | Captured:
    """Return the estimate from where the capture led; sprung: the part is taken to have another shape than its CAD."""
    setup, curved = problem.setup, problem.curved
    taken = sprung is not None and sprung.taken
    robust = sprung.fit if sprung and taken else robust_fit(patches, problem, captured.T_base_part, crossed)
    if robust.edges is not None and not taken:
        # Now that the edges are known, so is the angle at which they were crossed.
        known = robust.edges.rows(problem, robust.T_base_part)
        sharper = locate(robust.edges.points, known.cosine, setup.probe.beam_width_mm)
        robust = robust_fit(patches, problem, robust.T_base_part, replace(robust.edges, points=sharper))
    if robust.used.sum() < 6:
        return captured
    system = System(problem, patches, robust.used, robust.edges).grouped(robust.T_base_part)
    state = State(robust.T_base_part, np.zeros(system.unknowns - 6))
    size = float(curved.surface.extents_mm.max())
    rows = system.rows(state.T_base_part, state.nuisance)
    noise = fit_noise(rows, noise_prior(patches.sigma_mm, size, setup.probe.swath_mm))
    mix = mixture(rows, noise, FEW)
    state, _ = _settle(state, system, mix, np.zeros((6, 0)))
    strain = None
    for i in range(ROUNDS):
        T = state.T_base_part
        mix = mixture(system.rows(T, state.nuisance), noise, FEW if i < ROUNDS - 1 else None)
        free = _solve(state, system, mix, np.zeros((6, 0)))
        # Only now is nothing held: afterwards the locked axes stand where the lock says.
        strain = lock_strain(problem, T, free.covariance[:6, :6]) if i == 0 else strain
        held = held_basis(free.covariance[:6, :6], problem.lock_rows(T))
        state, converged = _settle(state, system, mix, held)
    plain = problem.step(robust.T_base_part, -(held @ (held.T @ problem.total(robust.T_base_part))))
    kept = replace(state, T_base_part=plain) if taken else _plain_if_sprung(state, system, plain)
    # The plain fit has settled, even where the careful one ran off after the shape.
    state, converged = kept, converged or kept is not state
    T = state.T_base_part
    post = _solve(state, system, mix, held)
    scale = problem.prior_sigma
    covariance = _claimed(state, system, mix, held, post.covariance[:6, :6])
    if sprung is not None:
        covariance = covariance + sprung.doubt(problem, T, held)
    found = directions(covariance, held, problem.lock_rows(T), scale, problem.moments_base(T), setup.tolerances)
    now = system.surface(T)
    of_edges = edge_report(system, T, state.nuisance, post.covariance)
    return MapFit(
        T, problem.centre_mm(T), covariance * np.outer(scale, scale), found, patches, now, robust.used & now.valid,
        noise, captured, robust.settled and converged, of_edges, strain,
    )  # fmt: skip


def edge_data(cloud: PointCloud, problem: Problem, line: PoseLine | None, T_base_part: Transform) -> EdgeData | None:
    """Return the crossings of a cloud and the CAD edges they may belong to; None where there is nothing to match."""
    if line is None:
        return None
    probe = problem.setup.probe
    edges = EdgeMap(boundary(problem.curved.surface), probe.beam_width_mm)
    if len(edges) == 0:
        return None
    points = edge_points(cloud, line, probe, *expected_at_edges(cloud, line, problem, T_base_part))
    if len(points) == 0:
        return None
    points = locate(points, np.ones(len(points)), probe.beam_width_mm)
    points = points.take(points.misfit < MOST_MISFIT)
    return EdgeData(points, edges, np.zeros(len(points), dtype=bool), BIAS_SHARE * probe.beam_width_mm)


def condense_cloud(
    cloud: PointCloud, problem: Problem, T_base_part: Transform, line: PoseLine | None = None
) -> Patches:
    """Return the patches of a cloud: along its passes, or in space where it has none."""
    return condense(
        *_gathered(cloud, problem, _line(cloud, problem) if line is None else line), problem.curved, T_base_part
    )


def _line(cloud: PointCloud, problem: Problem) -> PoseLine | None:
    return None if cloud.beams_base is None else pose_line(cloud, problem.setup.probe)


def _gathered(cloud: PointCloud, problem: Problem, line: PoseLine | None) -> tuple[Readings, Cells]:
    readings = look_at(cloud, problem.setup.alignment.point_model)
    if line is None:
        return readings, cells_in_space(readings.origins_base, CELL_MM, MOST_CELLS)
    return readings, cells_along_passes(readings, line, problem.setup.probe, CELL_MM, MOST_CELLS)


def _ahead(cloud: PointCloud, problem: Problem) -> tuple[PoseLine | None, Readings, Cells]:
    """Return what does not hang on where the part is; of the surface, have it ready."""
    problem.curved.get_ready()
    line = _line(cloud, problem)
    readings, cells = _gathered(cloud, problem, line)
    _ = problem.moments_part
    return line, readings, cells


def _solve(state: State, system: System, mix: Mixture, held: Array) -> Posterior:
    """Return the posterior at a state; held (6, h) are directions of the motion."""
    return solve(*_asked(state, system, mix, held))


def _asked(state: State, system: System, mix: Mixture, held: Array) -> tuple[Mixture, Array, Array, Array, Array]:
    rows = system.rows(state.T_base_part, state.nuisance)
    z = np.r_[system.problem.total(state.T_base_part), state.nuisance]
    wide = np.vstack([held, np.zeros((system.unknowns - 6, held.shape[1]))])
    return mix, rows.r, z, wide, system.problem.off_nominal(state.T_base_part, held)


def _claimed(state: State, system: System, mix: Mixture, held: Array, covariance: Array) -> Array:
    """Return the covariance (6, 6) whose 95 % ellipsoid holds 95 %; held directions stay at their prior."""
    free = np.eye(6) - held @ held.T
    own = free @ covariance @ free
    wider = min(tail_scale(*_asked(state, system, mix, held)), MOST_WIDER)
    return np.asarray(covariance + (wider - 1.0) * own)


def _settle(state: State, system: System, mix: Mixture, held: Array) -> tuple[State, bool]:
    """Step until the part no longer moves, with the noise as it is."""
    moves = np.inf
    for _ in range(SOLVE_STEPS):
        step = _solve(state, system, mix, held).step
        moves = system.problem.moves_mm(step[:6])
        if not moves < RUNAWAY_MM:
            return state, False
        state = State(system.problem.step(state.T_base_part, step[:6]), state.nuisance + step[6:])
        if moves < SOLVED_MM:
            break
    return state, moves < 100.0 * SOLVED_MM


def _plain_if_sprung(state: State, system: System, T_plain: Transform) -> State:
    """Return the plain robust fit instead, where the careful one took the shape of a part that sprang back for noise.

    What is left is then no noise of a robot, and the best rigid placement is the one that leaves least of it.
    """
    left = _rms_mm(system, state.T_base_part)
    if left <= MUCH_WORSE * SHAPE_MM:
        return state
    least = _rms_mm(system, T_plain)
    return replace(state, T_base_part=T_plain) if least > SHAPE_MM and left > MUCH_WORSE * least else state


def _rms_mm(system: System, T_base_part: Transform) -> float:
    rows = system.surface(T_base_part)
    used = system.used & rows.valid
    return float(np.sqrt(np.average(rows.r[used] ** 2, weights=system.patches.count[used]))) if used.any() else np.inf
