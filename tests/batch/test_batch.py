"""What serial parts have in common: claims against a drawn fixture, outliers, what is not seen, and the patch."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignment.batch import PartShape, advice, batch, common_shape, evidence_of
from alignment.batch.scatter import common
from planner.errors import EchoBaseError
from planner.setup import Setup
from tests.batch.serial_parts import CENTRE, EDGES, FLAT, PRIOR, correction, placement, six

SCATTER = np.r_[np.radians([0.02, 0.05, 0.03]), 0.15, 0.3, 0.1]
OFFSET = np.r_[np.radians([0.3, -0.2, 0.4]), 1.1, -0.7, 0.9]


def drawn(k, rng, scan=EDGES, scatter=SCATTER, offset=OFFSET, turn=None, **more):
    """Return evidence of k parts, and where each truly is."""
    truth = offset + scatter * rng.standard_normal((k, 6))
    contents = [correction(x, scan * rng.uniform(0.7, 1.6), rng, turn, **more) for x in truth]
    return [evidence_of(f"part {i}", c) for i, c in enumerate(contents, start=1)], truth


def test_a_correction_gives_back_what_its_scan_alone_said() -> None:
    rng = np.random.default_rng(1)
    weak = EDGES * 40.0  # a scan hardly sharper than the fixture: its correction leans to nominal by a tenth
    off = []
    for _ in range(400):
        found = evidence_of("p", correction(OFFSET, weak, rng))
        assert np.allclose(found.centre_mm, CENTRE, atol=1e-9)
        off.append((found.values - found.seen.T @ (OFFSET / PRIOR)) / found.sigma)
    off = np.array(off)
    # Unbiased, and as uncertain as said: three sigma of 2,400 standard normal values.
    assert abs(off.mean()) < 3.0 / np.sqrt(off.size)
    assert abs((off**2).mean() - 1.0) < 3.0 * np.sqrt(2.0 / off.size)


@pytest.mark.parametrize(
    ("k", "scan", "axes", "seed"),
    [(8, EDGES, 6, 2), (3, EDGES, 6, 3), (8, FLAT, 3, 4), (8, EDGES * 20, 6, 5)],
)
def test_the_fixture_lies_in_the_claimed_intervals(k, scan, axes, seed) -> None:
    rng = np.random.default_rng(seed)
    mean = scatter = ahead = count = 0
    for _ in range(120):
        offset = 0.7 * PRIOR * rng.standard_normal(6)
        parts, _ = drawn(k, rng, scan, offset=offset)
        found = batch(parts)
        assert len(found.axes) == axes
        for axis, c in zip(found.axes, found.common, strict=True):
            true = axis.vector @ (offset / PRIOR) * axis.scale
            spread = np.sqrt(axis.vector**2 @ (SCATTER / PRIOR) ** 2) * axis.scale
            mean += abs(c.mean - true) <= c.half_95
            scatter += c.scatter_95[0] <= spread <= c.scatter_95[1]
            ahead += abs(true + spread * rng.standard_normal() - c.mean) <= 2.0 * c.next_sigma
            count += 1
    # Three sigma of a share of 95 % among those that are independent.
    room = 3.0 * np.sqrt(0.95 * 0.05 / count)
    assert abs(mean / count - 0.95) < room
    assert abs(scatter / count - 0.95) < room
    assert ahead / count > 0.95 - room


def test_parts_that_do_not_differ_have_a_scatter_of_zero_in_its_interval() -> None:
    rng = np.random.default_rng(6)
    for _ in range(20):
        parts, _ = drawn(6, rng, scatter=0.0 * SCATTER)
        assert sum(c.scatter_95[0] == 0.0 for c in batch(parts).common) >= 4


def test_the_odd_part_is_named_and_no_other() -> None:
    rng = np.random.default_rng(7)
    false = 0
    for _ in range(100):
        parts, _ = drawn(7, rng)
        false += batch(parts).odd.any()
    assert false <= 13  # 5 % of 100 batches, and 3.7 sigma
    parts, truth = drawn(6, rng, scatter=0.1 * SCATTER)
    truth[3, 4] += 1.8
    parts[3] = evidence_of("part 4", correction(truth[3], EDGES, rng))
    found = batch(parts)
    assert found.odd.sum() == 1
    said = [i for i in found.issues if i.code == "batch-outlier"]
    how_far = re.fullmatch(r"part 4 sits (\d\.\d\d) mm further along y than the other 5\.", said[0].message)
    assert abs(float(how_far[1]) - (truth[3, 4] - np.mean(np.delete(truth[:, 4], 3)))) < 0.08
    assert np.argmax(np.abs(found.z[:, 4])) == 3
    rest = batch([p for p in parts if p.name != "part 4"]).common[4]
    assert f"common {rest.mean:+.2f} +-{rest.half_95:.2f} mm, scatter {rest.scatter:.2f} mm" in said[0].remedy


def test_held_directions_say_nothing_and_an_askew_face_is_told_along_its_own_axes() -> None:
    rng = np.random.default_rng(8)
    turn = Rotation.from_euler("ZYX", [30, 40, 10], degrees=True).as_matrix()
    alike = np.r_[np.full(3, np.radians(0.03)), np.full(3, 0.2)]
    parts, truth = drawn(8, rng, FLAT, alike, turn=turn)
    found = batch(parts, turn)
    assert found.frame == "face"
    assert [a.name for a in found.axes] == ["rx", "ry", "z"]
    height = (truth[:, 3:] @ turn)[:, 2]
    assert np.allclose(found.values[:, 2], height, atol=0.1)
    # Without axes of the face the same three directions are told, as combinations.
    assert len(batch(parts).axes) == 3
    T = found.T_base_common
    # What no scan shows stays nominal: no motion of the centroid in the plane of the face.
    assert np.allclose((turn.T @ (T.points(CENTRE) - CENTRE))[:2], 0.0, atol=1e-6)


def test_a_part_whose_scan_shows_less_counts_where_it_shows() -> None:
    rng = np.random.default_rng(9)
    parts, _ = drawn(5, rng)
    parts[2] = evidence_of("part 3", correction(OFFSET, FLAT, rng))
    found = batch(parts)
    seen = np.isfinite(found.values)
    assert seen.sum(axis=0).tolist() == [5, 5, 4, 4, 4, 5]
    assert found.to_json()["parts"][2]["directions"]["x"]["z"] is None


def test_the_common_correction_is_the_fixtures() -> None:
    rng = np.random.default_rng(10)
    parts, _ = drawn(8, rng, scan=EDGES * 1e-3, scatter=0.0 * SCATTER)
    found = batch(parts)
    assert np.allclose(found.T_base_common.matrix, placement(OFFSET), atol=2e-4)
    setup = Setup.model_validate({"base": {"x_mm": 900, "y_mm": 30, "a_deg": 40, "corrected_number": 3}})
    patch, issues = advice(found, setup)
    world = setup.T_world_base.matrix @ placement(OFFSET)
    for key, value in six(world).items():
        assert abs(patch["base"][key] - value) < 2e-3, key
    assert set(patch["base"]) == set(six(world))
    assert not issues


def test_the_suggested_sigma_is_for_the_next_part() -> None:
    rng = np.random.default_rng(11)
    alike = np.r_[np.full(3, np.radians(0.1)), np.full(3, 0.4)]
    suggested = [advice(batch(drawn(8, rng, scatter=alike)[0]), Setup())[0]["fixture"] for _ in range(40)]
    middle = np.median([s["sigma_mm"] for s in suggested])
    assert 0.4 < middle < 1.0
    # A face alone shows one shift of three: a sharper prior for all would be a guess.
    patch, issues = advice(batch(drawn(8, rng, FLAT, alike)[0]), Setup())
    assert "sigma_mm" not in patch.get("fixture", {})
    assert "batch-fixture" in {i.code for i in issues}


def test_a_fixture_without_offset_keeps_its_base() -> None:
    rng = np.random.default_rng(12)
    kept = sum("base" not in advice(batch(drawn(5, rng, offset=np.zeros(6))[0]), Setup())[0] for _ in range(20))
    assert kept == 20  # BASE of the default setup is not taught, whatever chance says
    taught = Setup.model_validate({"base": {"x_mm": 900}})
    parts, _ = drawn(5, rng, offset=np.zeros(6))
    found = batch(parts)
    patch, issues = advice(found, taught)
    assert ("base" in patch) == found.offset_known == ("batch-base" not in {i.code for i in issues})


def test_two_parts_have_a_mean_and_no_scatter() -> None:
    found = batch(drawn(2, np.random.default_rng(13))[0])
    assert all(c.scatter is None for c in found.common)
    assert "batch-few" in {i.code for i in found.issues}
    assert advice(found, Setup())[0] == {}
    with pytest.raises(EchoBaseError) as error:
        batch(drawn(1, np.random.default_rng(13))[0])
    assert error.value.issues[0].code == "batch-parts"


def test_parts_of_different_plans_are_refused() -> None:
    rng = np.random.default_rng(14)
    parts, _ = drawn(3, rng)
    wider, _ = drawn(1, rng, prior=2.0 * PRIOR)
    with pytest.raises(EchoBaseError) as error:
        batch([*parts, *wider])
    assert error.value.issues[0].code == "batch-plans"
    failed = {**correction(OFFSET, EDGES, rng), "verdict": "fail"}
    for content in (failed, {}, {"verdict": "pass", "correction": None}):
        with pytest.raises(EchoBaseError) as error:
            evidence_of("part 9", content)
        assert error.value.issues[0].code == "batch-correction"


def test_equal_uncertainties_reduce_to_the_textbook() -> None:
    """With negligible scan noise the mean and its interval are Student's, the scatter interval is chi-square's."""
    from scipy.stats import chi2, t  # noqa: PLC0415 - only this test

    y = np.random.default_rng(15).normal(2.0, 0.3, 9)
    found = common(y, np.full(9, 1e-12))
    s = y.std(ddof=1)
    assert found.mean == pytest.approx(y.mean(), abs=1e-9)
    assert found.half_95 == pytest.approx(t.ppf(0.975, 8) * s / 3.0, rel=1e-5)
    assert found.scatter == pytest.approx(s, rel=1e-3)
    assert found.scatter_95 == pytest.approx(
        (s * np.sqrt(8 / chi2.ppf(0.975, 8)), s * np.sqrt(8 / chi2.ppf(0.025, 8))), rel=1e-5
    )


def test_shapes_are_split_into_common_and_own() -> None:
    rng = np.random.default_rng(16)
    places = np.column_stack(
        [*(v.ravel() for v in np.meshgrid(np.linspace(0, 300, 25), np.linspace(0, 100, 12))), np.zeros(300)]
    )
    bend = 0.8 * (places[:, 0] / 300.0) ** 2
    own_rms, noise = [0.0, 0.05, 0.2, 0.1, 0.05], 0.01
    shapes = []
    for k, rms in enumerate(own_rms):
        wave = np.sqrt(2.0) * rms * np.sin(2 * np.pi * (places[:, 0] / 150.0 + 0.2 * k) + 2.0 * k)
        supported = places[:, 0] < (300.0 if k else 200.0)
        order = rng.permutation(len(places))
        values = bend + wave + noise * rng.standard_normal(len(places))
        shapes.append(PartShape(f"p{k}", places[order], values[order], np.full(300, noise), supported[order]))
    found = common_shape(shapes)
    at = shapes[0].points_part[:, 0]
    true = 0.8 * (at / 300.0) ** 2
    known = np.isfinite(found.common_mm)
    assert known.mean() > 0.9
    assert np.sqrt(np.mean((found.common_mm - true)[known] ** 2)) < 0.06
    z = (found.common_mm - true)[known] / found.sigma_mm[known]
    assert np.mean(np.abs(z) < 1.96) > 0.85
    # Each part's own share is seen against the mean of all five, which takes up some of it.
    assert np.argmax(found.own_rms_mm) == 2
    assert found.own_rms_mm[2] == pytest.approx(0.2 * 0.8, rel=0.25)
    assert found.own_rms_mm[0] < 0.07
    assert common_shape(shapes[:1]) is None
    assert common_shape(shapes[:2]).scatter_mm is None
