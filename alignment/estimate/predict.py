"""The accuracy an alignment scan will give, from its path and the setup alone, before the robot moves."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from alignment.correction import AxisResult
from alignment.estimate.directions import Direction, directions, held_basis, named_statuses
from alignment.estimate.map import condense_cloud, edge_data
from alignment.estimate.mixture import mixture, solve
from alignment.estimate.motion import motion_rows, named_axes
from alignment.estimate.noise_fit import NoiseFit
from alignment.estimate.noise_kernel import NAMES
from alignment.estimate.pose_line import pose_line
from alignment.estimate.problem import Problem
from alignment.estimate.robust_fit import LEAST_CROSSINGS
from alignment.estimate.synthetic import expected_cloud
from alignment.estimate.system import EdgeData, System
from planner.frames import AXES, Array, Transform
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.toolpath import ToolPath

# The reference noise of every published figure (simulated): pose 0.03 mm per axis and 0.005 deg, correlated over 10 mm;
# ToF 0.01 mm. Crossings of edges scatter by about 0.025 mm beside the pose.
REFERENCE_MM = {
    "nugget_mm": 0.01,
    "path_mm": 0.03,
    "path_length_mm": 10.0,
    "gap_mm": 60.0,
    "tilt_mm": 0.0013,
    "field_mm": 0.0005,
    "field_length_mm": 50.0,
    "edge_nugget_mm": 0.025,
    "edge_path_mm": 0.03,
}
MOST_POINTS = 5000
# The largest error expected over the surface: this many standard deviations where it is largest.
SIGMAS = 2.0


@dataclass(frozen=True, eq=False)
class Prediction:
    """Planned accuracy, simulated noise. axes: x, y, z, a, b, c about the BASE origin. covariance as in `Correction`.

    normal_error_mm: two standard deviations of the normal displacement where on the surface it is largest.
    crossings: edge crossings expected.
    """

    axes: tuple[AxisResult, ...]
    directions: tuple[Direction, ...]
    covariance: Array
    centroid_mm: Array
    normal_error_mm: float
    readings: int
    crossings: int

    def to_json(self) -> dict[str, Any]:
        """Return what plan.json says of it."""
        return {
            "dof": {n: {"status": a.status, "sigma": a.sigma} for n, a in zip(AXES, self.axes, strict=True)},
            "directions": [d.to_json() for d in self.directions],
            "covariance": self.covariance.tolist(),
            "centroid_mm": self.centroid_mm.tolist(),
            "normal_error_mm": self.normal_error_mm,
            "readings": self.readings,
            "crossings": self.crossings,
            "noise": "simulated: pose 0.03 mm, 0.005 deg, correlated over 10 mm; ToF 0.01 mm",
        }


def predict(path: ToolPath, curved: CurvedSurface, setup: Setup) -> Prediction:
    """Return the accuracy of an alignment that follows `path`, if the cell has the reference noise."""
    problem = Problem(curved, setup)
    T = problem.T_base_nominal
    cloud = expected_cloud(path, curved, setup)
    line = pose_line(cloud, setup.probe)
    patches = condense_cloud(cloud, problem, T, line)
    edges = _expected_edges(edge_data(cloud, problem, line, T), problem, T) if setup.alignment.edges else None
    system = System(problem, patches, np.ones(len(patches), dtype=bool), edges)
    used = system.surface(T).valid
    system = System(problem, patches, used, edges)
    theta = np.log([REFERENCE_MM[name] for name in NAMES])
    fit = NoiseFit(theta, theta[None], np.ones(1), 1.0)
    k = system.unknowns
    if used.sum() < 1:
        covariance = np.eye(6)
        held = held_basis(covariance, problem.lock_rows(T))
    else:
        rows = system.rows(T, np.zeros(k - 6))
        mix = mixture(rows, fit)
        free = solve(mix, np.zeros(len(rows)), np.zeros(k), np.zeros((k, 0)))
        held = held_basis(free.covariance[:6, :6], problem.lock_rows(T))
        wide = np.vstack([held, np.zeros((k - 6, held.shape[1]))])
        covariance = solve(mix, np.zeros(len(rows)), np.zeros(k), wide).covariance[:6, :6]
    scale = problem.prior_sigma
    found = directions(covariance, held, problem.lock_rows(T), scale, problem.moments_base(T), setup.tolerances)
    full = covariance * np.outer(scale, scale)
    centre = problem.centre_mm(T)
    to_axes = named_axes(problem.T_base_basecorr(T), centre)
    sigma = np.sqrt(np.diag(to_axes @ full @ to_axes.T)) * np.r_[np.ones(3), np.degrees(np.ones(3))]
    statuses = named_statuses(found, to_axes, scale)
    return Prediction(
        tuple(AxisResult(s, float(v)) for s, v in zip(statuses, sigma, strict=True)),
        found,
        full,
        centre,
        SIGMAS * normal_sigma_mm(curved, T, full, centre),
        len(cloud),
        0 if edges is None else int(edges.used.sum()),
    )


def normal_sigma_mm(curved: CurvedSurface, T_base_part: Transform, covariance: Array, centre_mm: Array) -> float:
    """Return the largest standard deviation over the surface of its displacement along its normal, mm."""
    points, normals = curved.vertex_fit.points, curved.vertex_fit.normals
    pick = np.unique(np.linspace(0, len(points) - 1, min(len(points), MOST_POINTS)).astype(np.intp))
    rows = motion_rows(T_base_part.points(points[pick]), T_base_part.directions(normals[pick]), centre_mm)
    return float(np.sqrt(np.einsum("ni,ij,nj->n", rows, covariance, rows).max()))


def _expected_edges(edges: EdgeData | None, problem: Problem, T: Transform) -> EdgeData | None:
    if edges is None:
        return None
    valid = edges.rows(problem, T).valid
    if valid.sum() < LEAST_CROSSINGS:
        return None
    return EdgeData(edges.points, edges.map, valid, edges.bias_sigma_mm)
