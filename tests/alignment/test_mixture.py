"""The region claimed of a mixture of noise models, against Student's t, which is a mixture of Gaussians."""

import numpy as np
import pytest
from scipy.stats import chi2, f, gamma

from alignment.estimate.mixture import Mixture, solve, tail_scale

FINE = 1e6


def students_t(freedom: float, unknowns: int = 6, models: int = 4000) -> Mixture:
    """Gaussians whose precisions are gamma distributed: together a multivariate t."""
    precision = FINE * gamma.ppf((np.arange(models) + 0.5) / models, freedom / 2, scale=2 / freedom)
    return Mixture(
        np.full(models, 1 / models),
        np.zeros((models, 1, unknowns)),
        (precision - 1.0)[:, None, None] * np.eye(unknowns),
    )


@pytest.mark.parametrize("freedom", [5.0, 10.0, 40.0])
@pytest.mark.parametrize("held", [0, 3])
def test_the_region_of_students_t_holds_95_percent(freedom, held):
    dims, fixed = 6 - held, np.eye(6)[:, :held]
    mix = students_t(freedom)
    covariance = solve(mix, np.zeros(1), np.zeros(6), fixed).covariance[held:, held:]
    # Covariance of t is freedom / (freedom - 2) times its scale matrix; x' S^-1 x / dims is F distributed.
    assert np.allclose(covariance, np.eye(dims) / FINE * freedom / (freedom - 2), rtol=0.02, atol=1e-12)
    wanted = dims * f.ppf(0.95, dims, freedom) * (freedom - 2) / freedom / chi2.ppf(0.95, dims)
    assert tail_scale(mix, np.zeros(1), np.zeros(6), fixed) == pytest.approx(max(1.0, wanted), rel=0.03)


def test_one_noise_model_needs_no_wider_region():
    mix = Mixture(np.ones(1), np.zeros((1, 1, 8)), 1e4 * np.eye(8)[None])
    assert tail_scale(mix, np.zeros(1), np.zeros(8), np.zeros((8, 0))) == pytest.approx(1.0, abs=0.02)
