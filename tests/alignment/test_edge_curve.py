"""Where an edge lies between readings: beams whose S-curve is known in closed form, met at any phase."""

import numpy as np
import pytest
from scipy.special import erf

from alignment.estimate.edge_curve import Beam, Shares, fit_beam, place
from alignment.estimate.edge_rows import EdgeMap
from planner.surface.boundary import boundary
from tests.alignment.clouds import curved_of
from tests.loop.surfaces import plane

WIDTH_MM = 3.0
LEAST_HEARD = 0.04


def disc(depth_mm):
    """Share of a disc of diameter WIDTH_MM on the part when its middle is this deep inside (a circle's segment)."""
    x = np.clip(2.0 * depth_mm / WIDTH_MM, -1.0, 1.0)
    return 1.0 - (np.arccos(x) - x * np.sqrt(1.0 - x * x)) / np.pi


def gauss(depth_mm):
    """The same for a Gaussian of that full width at half maximum."""
    return 0.5 * (1.0 + erf(depth_mm / (WIDTH_MM / np.sqrt(8.0 * np.log(2.0))) / np.sqrt(2.0)))


def windows(share, gap_mm, at, rng, noise):
    value = share((at[:, None] - np.arange(-3, 5)) * gap_mm) * (1.0 + noise * rng.standard_normal((len(at), 8)))
    return np.where(value < LEAST_HEARD, 0.0, value)


def around(window, gap_mm, scatter=0.02, dropout=1e-3):
    return Shares(window, np.full(len(window), gap_mm), scatter, dropout)


@pytest.mark.parametrize(("share", "blend"), [(disc, 1.0), (gauss, 0.0)])
@pytest.mark.parametrize("gap_mm", [0.6, 1.0, 2.0])
def test_the_place_does_not_depend_on_where_the_readings_stand(share, blend, gap_mm):
    at = np.linspace(0.02, 0.98, 97)
    shares = around(windows(share, gap_mm, at, np.random.default_rng(0), 0.0), gap_mm)
    beam = fit_beam(shares, 1.2 * WIDTH_MM)
    assert abs(beam.width_mm / WIDTH_MM - 1.0) < 0.02
    assert abs(beam.blend - blend) < 0.15
    error_mm = gap_mm * (place(shares, beam).at - at)
    assert np.abs(error_mm).max() < 0.02


def test_noise_of_the_amplitude_averages_out_and_a_splash_is_left_aside():
    rng = np.random.default_rng(1)
    at = rng.uniform(0.05, 0.95, 2000)
    window = windows(disc, 2.0, at, rng, 0.02)
    window[::4, 1] = 0.6
    error_mm = 2.0 * (place(around(window, 2.0), Beam(1.0, WIDTH_MM)).at - at)
    assert abs(error_mm.mean()) < 0.004
    assert error_mm.std() < 0.05


@pytest.mark.parametrize(("share", "blend"), [(disc, 1.0), (gauss, 0.0)])
@pytest.mark.parametrize("gap_mm", [0.6, 1.0])
def test_lost_echoes_and_splash_cost_no_more_than_the_readings_lost(share, blend, gap_mm):
    """One share in ten is none of the edge's, one echo in five is lost: where the edge is remains known as well as said."""
    rng = np.random.default_rng(2)
    at = rng.uniform(0.0, 1.0, 3000)
    window = windows(share, gap_mm, at, rng, 0.02)
    # A splash is mostly told by its distance (NaN), but not always.
    fate = rng.random(window.shape)
    window = np.where(fate < 0.01, rng.random(window.shape), np.where(fate < 0.1, np.nan, window))
    window = np.where(fate > 0.8, 0.0, window)
    shares = around(window, gap_mm, dropout=0.2)
    beam = fit_beam(shares, 0.9 * WIDTH_MM)
    assert abs(beam.width_mm / WIDTH_MM - 1.0) < 0.03
    found = place(shares, beam)
    error_mm, sigma_mm = gap_mm * (found.at - at), gap_mm / np.sqrt(np.maximum(found.information, 1e-12))
    told = sigma_mm < 0.1
    assert told.mean() > 0.7
    assert 1.4826 * np.median(np.abs(error_mm[told] / sigma_mm[told])) < 1.4
    weight = 1.0 / (sigma_mm[told] ** 2 + 0.02**2)
    assert abs(np.average(np.clip(error_mm[told], -0.15, 0.15), weights=weight)) < 0.005
    assert np.mean(np.abs(error_mm[told]) > 0.3) < 0.03


def test_crossings_near_a_corner_say_nothing():
    edges = EdgeMap(boundary(curved_of(plane()).surface), WIDTH_MM)
    along = np.array([[0.5, 0, 0], [2.5, 0, 0], [3.5, 0, 0], [75, 0, 0], [150, 99, 0], [150, 50, 0]], dtype=float)
    assert edges.near_corner(along).tolist() == [True, True, False, False, True, False]
