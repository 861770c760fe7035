"""Nominal BASE from touched points."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from planner.base_fit import fit_base
from planner.errors import EchoBaseError
from planner.frames import Transform

PLACEMENT = Transform.from_xyzabc("base", "partnom", [40.0, -25.0, 12.0, 30.0, 5.0, -8.0])
TRUTH = Transform.from_xyzabc("world", "base", [924.1, 1099.0, 527.8, -89.8, 2.3, -1.1])
CAD = np.array([[0.0, 0, 0], [300, 10, 0], [20, 150, 5], [280, 160, -30], [150, 80, 60]])


def touched(cad: np.ndarray = CAD) -> np.ndarray:
    return (TRUTH @ PLACEMENT).points(cad)


@pytest.mark.parametrize("count", [3, 4, 5])
def test_exact_points_give_the_exact_base(count: int) -> None:
    fit = fit_base(CAD[:count], touched()[:count], PLACEMENT)
    assert np.abs(fit.T_world_base.matrix - TRUTH.matrix).max() < 1e-9
    assert (fit.T_world_base.dst, fit.T_world_base.src) == ("world", "base")
    assert fit.residuals_mm.max() < 1e-9
    assert fit.issues == ()


def test_noisy_points_give_the_least_squares_solution_of_a_general_optimiser() -> None:
    noisy = touched() + np.random.default_rng(4).normal(0, 0.3, CAD.shape)
    fit = fit_base(CAD, noisy, PLACEMENT)

    def residual(xi: np.ndarray) -> np.ndarray:
        turned = RigidTransform.from_exp_coords(xi) * (TRUTH @ PLACEMENT).rigid
        return (turned.apply(CAD) - noisy).ravel()

    best = least_squares(residual, np.zeros(6), x_scale=[1e-3] * 3 + [1.0] * 3, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert (fit.residuals_mm**2).sum() == pytest.approx(2.0 * best.cost, rel=1e-9)
    assert fit.rms_mm == pytest.approx(np.sqrt(2.0 * best.cost / 5))


def test_sigma_is_honest_over_many_touches() -> None:
    rng = np.random.default_rng(8)
    sigmas = [fit_base(CAD, touched() + rng.normal(0, 0.2, CAD.shape), PLACEMENT).sigma_mm ** 2 for _ in range(400)]
    # 9 degrees of freedom each: the mean of 400 is known to 2.4 %, four of which are allowed here.
    assert np.mean(sigmas) == pytest.approx(0.04, rel=0.1)


def test_never_a_reflection() -> None:
    mirrored = touched() * [1.0, 1.0, -1.0]
    fit = fit_base(CAD, mirrored, PLACEMENT)
    assert np.linalg.det(fit.T_world_base.rotation_matrix) == pytest.approx(1.0)
    assert fit.rms_mm > 1.0
    flat = CAD * [1.0, 1.0, 0.0]
    fit = fit_base(flat, (TRUTH @ PLACEMENT).points(flat), PLACEMENT)
    assert np.abs(fit.T_world_base.matrix - TRUTH.matrix).max() < 1e-9


def test_one_bad_point_is_named() -> None:
    points = touched()
    points[3] += [4.0, -3.0, 2.0]
    fit = fit_base(CAD, points, PLACEMENT)
    assert [i.code for i in fit.issues] == ["base-residual"]
    assert fit.issues[0].where == "pair 4"
    assert fit.left_out_mm[3] == pytest.approx(np.sqrt(29.0), rel=1e-6)
    assert fit.left_out_mm[3] > fit.residuals_mm[3]


def test_swapped_points_are_recognised() -> None:
    points = touched()[[0, 2, 1, 3, 4]]
    fit = fit_base(CAD, points, PLACEMENT)
    assert "1, 3, 2, 4, 5" in fit.issues[0].remedy
    three = fit_base(CAD[:3], touched()[[1, 0, 2]], PLACEMENT)
    assert "2, 1, 3" in three.issues[0].remedy


def test_points_almost_on_a_line_are_a_warning() -> None:
    thin = np.array([[0.0, 0, 0], [300, 0, 0], [150, 8, 0]])
    fit = fit_base(thin, (TRUTH @ PLACEMENT).points(thin), PLACEMENT)
    assert [i.code for i in fit.issues] == ["base-thin"]


def test_the_other_side_of_the_placement_is_a_different_base() -> None:
    fit = fit_base(CAD, touched(), PLACEMENT.inv().renamed("base", "partnom"))
    assert np.abs(fit.T_world_base.matrix - TRUTH.matrix).max() > 1.0


@pytest.mark.parametrize(
    "cad, points, code",
    [
        (CAD[:2], touched()[:2], "base-pairs"),
        (CAD, touched()[:4], "base-pairs"),
        (CAD[:, :2], touched()[:, :2], "base-pairs"),
        (CAD, np.where(np.eye(5, 3, dtype=bool), np.nan, touched()), "base-pairs"),
        (CAD[[0, 1, 1, 3]], touched()[[0, 1, 2, 3]], "base-duplicate"),
        (np.array([[0.0, 0, 0], [1, 0, 0], [5, 0, 0]]), touched()[:3], "base-line"),
        (CAD[:3], np.array([[0.0, 0, 0], [1, 1, 0], [2, 2, 0.001]]), "base-line"),
    ],
)
def test_what_cannot_fix_a_base_is_said(cad: np.ndarray, points: np.ndarray, code: str) -> None:
    with pytest.raises(EchoBaseError) as error:
        fit_base(cad, points, PLACEMENT)
    assert error.value.issues[0].code == code


def test_any_rotation_between_cad_and_world() -> None:
    for rotation in Rotation.random(50, rng=np.random.default_rng(5)):
        there = rotation.apply(CAD) + np.array([5.0, -3.0, 900.0])
        fit = fit_base(CAD, there, Transform.identity("base", "partnom"))
        assert np.abs(fit.T_world_base.rotation_matrix - rotation.as_matrix()).max() < 1e-10
