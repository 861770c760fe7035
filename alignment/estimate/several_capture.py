"""From the nominal placement to within the scatter of the readings, for the scans of several surfaces together."""

from collections.abc import Sequence

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.capture import CONVEX_STEPS, FLOOR_MM, LEAST_VALID, READING_SIGMA_MM, SAMPLE, STEPS, Captured
from alignment.estimate.problem import Problem
from alignment.estimate.readings import model_readings, reading_weights, sample_rows
from alignment.estimate.robust import huber_weights, mad_sigma, tukey_weights
from alignment.estimate.several_rows import Member
from alignment.estimate.surface_rows import Rows, Track
from planner.frames import Array
from planner.setup import Setup

LEAST_SHARE = 1.0 / 16.0


def capture_several(
    members: Sequence[Member], clouds: Sequence[PointCloud], setups: Sequence[Setup], problem: Problem
) -> list[Captured]:
    """Return for each scan what `capture` returns for one, all at the one placement (first plan's base) that fits them all.

    The same robust fit of samples of readings. Every scan has as many samples as any other and a scale of its own: a short
    scan of a flange counts as much as a long one of the skin, and one that fits badly does not loosen the others.
    """
    tracks, heard = [], []
    for member, cloud, setup in zip(members, clouds, setups, strict=True):
        rows = sample_rows(len(cloud), SAMPLE)
        origins, distance = model_readings(cloud, setup.alignment.point_model, rows)
        beams = None if cloud.beams_base is None else cloud.beams_base[rows]
        tracks.append(Track(member.curved, origins, distance, beams))
        heard.append(reading_weights(cloud, rows))
    T, share, last, last_z = problem.T_base_nominal, 1.0, np.inf, np.zeros(6)
    converged, figures = False, [(np.inf, 0.0, 0.0)] * len(tracks)
    for i in range(STEPS):
        normal, pull = np.eye(6), -problem.total(T)
        centre = problem.centre_mm(T)
        figures = []
        for member, track, weight in zip(members, tracks, heard, strict=True):
            found = member.in_first(track.rows(member.placed(T), member.T_first_own.inv().points(centre)), centre)
            figures.append(_add(found, weight, problem.prior_sigma, i < CONVEX_STEPS, normal, pull))
        z = np.asarray(np.linalg.solve(normal, pull))
        moves = problem.moves_mm(z)
        if i > CONVEX_STEPS and moves > 0.8 * last and z @ last_z < 0.0:
            share = max(0.5 * share, LEAST_SHARE)
        last, last_z = moves, z
        T = problem.step(T, share * z)
        if i >= CONVEX_STEPS and share * moves < 0.2 * FLOOR_MM:
            converged = True
            break
    converged = converged or last < max(FLOOR_MM, *(scatter for scatter, _, _ in figures))
    return [Captured(T, converged and np.isfinite(scatter), scatter, *shares) for scatter, *shares in figures]


def _add(
    found: Rows, heard: Array, prior_sigma: Array, convex: bool, normal: Array, pull: Array
) -> tuple[float, float, float]:
    """Add one scan's sample to the normal equations in place; return its scatter (mm, inf: too few) and shares."""
    use = found.valid & (heard > 0)
    if use.sum() < LEAST_VALID:
        return np.inf, float(use.mean()), 0.0
    r, x = found.r[use], found.jacobian[use] * prior_sigma
    scatter = mad_sigma(r, 1e-3, about_zero=True)
    sigma = max(scatter, FLOOR_MM)
    robust = huber_weights(r, sigma) if convex else tukey_weights(r, sigma)
    weight = heard[use] * robust / READING_SIGMA_MM**2
    normal += (x * weight[:, None]).T @ x
    pull -= (x * weight[:, None]).T @ r
    return float(scatter), float(use.mean()), float((np.abs(r) < 4.0 * sigma).mean())
