"""The field of parts whose shape is a formula: what an inspection that follows it sees."""

import numpy as np
import pytest

from app.steps.non_rigid import unfollowed
from tests.non_rigid import cases
from tests.non_rigid.cases import CYLINDER, PLATE, inspect, measured, spread

SHAPES = [
    (CYLINDER, cases.bend),
    (CYLINDER, cases.dent),
    (CYLINDER, cases.step),
    (PLATE, cases.twist),
    (PLATE, cases.dent),
    (PLATE, cases.bend),
]


@pytest.mark.parametrize(("part", "shape"), SHAPES, ids=lambda v: getattr(v, "__name__", None))
def test_moved_and_sprung_back_with_outliers(part, shape):
    fit, rigid, curved = measured(part, shape, outliers=0.1, dropouts=0.2)
    assert fit.field is not None, fit.reason
    seen = inspect(part, shape, curved, fit.T_base_part, fit.field)
    std, width = spread(seen)
    assert std <= 0.05
    assert width <= 0.5
    assert np.abs(seen.off_mm.mean()) <= 0.05
    assert (seen.tilt_deg <= 1.0).all()
    assert (seen.loss_db <= 2.0).all()
    rigid_std, _ = spread(inspect(part, shape, curved, rigid))
    assert std < 0.25 * rigid_std
    assert fit.cv_mm < fit.cv_rigid_mm


@pytest.mark.slow
@pytest.mark.parametrize("shape", [cases.bend, cases.dent], ids=lambda f: f.__name__)
def test_the_claimed_deviation_is_that_of_the_truth(shape):
    inside, total = 0, 0
    for seed in range(4):
        fit, _, curved = measured(CYLINDER, shape, seed=seed)
        seen = inspect(CYLINDER, shape, curved, fit.T_base_part, fit.field)
        foot = curved.closest(seen.points)
        sd, _ = fit.field.deviation(foot.points, foot.normals, curved.shape_operator(foot.face, foot.bary))
        z = np.abs(seen.off_mm) / sd
        inside, total = inside + int((z < 2.0).sum()), total + len(z)
        assert np.sqrt(np.mean(z**2)) > 0.3, "the claim is inflated"
    assert inside / total > 0.9


@pytest.mark.slow
def test_nothing_to_adapt_is_never_worse_than_rigid():
    followed = 0
    for seed in range(20):
        fit, rigid, curved = measured(
            CYLINDER, cases.nothing, seed=seed, correlation_mm=(10.0, 30.0, 150.0)[seed % 3], spacing_mm=6.0
        )
        before = spread(inspect(CYLINDER, cases.nothing, curved, rigid))[0]
        after = spread(inspect(CYLINDER, cases.nothing, curved, fit.T_base_part, fit.field))[0]
        followed += fit.field is not None
        assert after <= before + 1e-9
    assert followed == 0


def test_a_hole_in_the_data_is_bridged_where_that_is_known_to_be_safe_and_said_where_not():
    def outside(p):
        return (p[:, 0] - 150.0) ** 2 + p[:, 1] ** 2 > 40.0**2

    fit, _, curved = measured(CYLINDER, cases.bend, keep=outside)
    assert fit.field is not None
    std, width = spread(inspect(CYLINDER, cases.bend, curved, fit.T_base_part, fit.field))
    assert std <= 0.05
    assert width <= 0.5


def test_half_of_the_part_unscanned_falls_back_to_rigid_there():
    fit, rigid, curved = measured(CYLINDER, cases.dent, u=(5.0, 215.0))
    assert fit.field is not None
    support = fit.field.support
    assert 0.4 < support.share < 0.95
    far = support.points_part[:, 0] > 290.0
    assert not support.inside[far].any()
    near = (support.points_part[:, 0] > 20.0) & (support.points_part[:, 0] < 195.0)
    near &= np.abs(support.points_part[:, 1]) < 85.0
    assert support.inside[near].all()
    assert np.array_equal(support.covers(support.points_part[far]), np.zeros(far.sum(), dtype=bool))
    # Beyond the scan the part is soon taken as rigid again; the inspection is no worse for it than the rigid one.
    before = inspect(CYLINDER, cases.dent, curved, rigid)
    after = inspect(CYLINDER, cases.dent, curved, fit.T_base_part, fit.field)
    assert spread(after)[0] < spread(before)[0]
    assert after.tilt_deg.max() < before.tilt_deg.max()


@pytest.mark.parametrize(("width_mm", "word"), [(20.0, "foretell"), (12.0, "hardly anywhere")])
def test_a_dent_under_a_single_pass_is_not_followed_and_not_called_noise(width_mm, word):
    def small(p, part):
        x, y = part.unit(p)
        return -0.6 * np.exp(-((x * 150 - 30) ** 2) / (2 * 30.0**2) - (y * part.half_mm + 30) ** 2 / (2 * width_mm**2))

    fit, rigid, _ = measured(CYLINDER, small)
    assert fit.field is None
    assert fit.seen
    assert word in fit.reason
    assert np.array_equal(fit.T_base_part.matrix, rigid.matrix)
    issue = unfollowed(fit)
    assert (issue.severity, issue.code) == ("warning", "sprung-back-unfollowed")
    assert word in issue.message
    assert not measured(CYLINDER, cases.nothing)[0].seen


@pytest.mark.parametrize("passes", [1, 2])
def test_too_few_passes_are_refused_with_the_reason(passes):
    fit, rigid, _ = measured(CYLINDER, cases.bend, passes=passes, reach=0.5)
    assert fit.field is None
    assert "passes" in fit.reason
    assert np.array_equal(fit.T_base_part.matrix, rigid.matrix)


def test_without_free_directions_the_placement_stays():
    fit, rigid, curved = measured(PLATE, cases.dent, directions=())
    assert fit.field is not None
    assert np.abs(fit.T_base_part.matrix - rigid.matrix).max() < 1e-9
    assert spread(inspect(PLATE, cases.dent, curved, fit.T_base_part, fit.field))[0] <= 0.05


def test_the_rigid_part_goes_to_the_base():
    fit, _, _ = measured(PLATE, cases.dent)
    around = fit.samples
    f, _ = fit.field.on(around.face, around.bary)
    design = np.column_stack([np.ones(len(f)), around.points[:, :2] - around.points[:, :2].mean(axis=0)])
    left = np.linalg.lstsq(design, f, rcond=None)[0]
    assert np.abs(left[0]) < 2e-3
    assert np.abs(np.degrees(left[1:])).max() < 2e-3
    # The mean of a dent and its tilt are a motion; a motion along the plate explains nothing of it.
    turn, slide = (fit.T_base_part.inv().directions(v) for v in (fit.motion_base[:3], fit.motion_base[3:]))
    assert abs(turn[2]) < 1e-6
    assert np.abs(slide[:2]).max() < np.linalg.norm(turn) * abs(slide[2]), "more than the second order"
    assert abs(slide[2]) > 0.05
