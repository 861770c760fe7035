"""Several faces of one block, each scanned by its own plan: one placement, known as well as it claims to be."""

import numpy as np
import pytest
from scipy.stats import binom, chi2

from alignment.estimate.align import align
from alignment.estimate.motion import motion_between, moved
from alignment.estimate.several import align_several
from planner.errors import EchoBaseError
from planner.frames import Transform
from planner.placement import corrected_base, part_from_correction
from planner.setup import Setup
from tests.several.blocks import ACROSS, CELL, INSIDE, SETUP, scanned, truth

OFFSET = (1.1, -0.7, 1.0, 0.2, -0.8, 0.5)


def joint(names, seed=1, offset=OFFSET, **options):
    rng = np.random.default_rng(seed)
    T = truth(offset)
    return align_several([scanned(n, T, rng, **options) for n in names], edges=options.get("lines") is ACROSS)


def test_three_faces_find_all_six_without_edges_where_each_alone_holds_three():
    rng = np.random.default_rng(1)
    scans = [scanned(n, truth(OFFSET), rng, path=True) for n in ("top", "side", "end")]
    for s in scans:
        alone = align(s.cloud, s.curved, (), s.setup, s.inspection, edges=False)
        assert [d.status for d in alone.directions].count("held") == 3
    found = align_several(scans, edges=False)
    for one in found:
        assert one.verdict == "pass"
        assert {d.status for d in one.directions} == {"measured"}
        assert {a.status for a in one.axes} == {"measured"}
        np.testing.assert_allclose(one.T_base_basecorr.xyzabc[:3], OFFSET[:3], atol=0.05)
        np.testing.assert_allclose(one.T_base_basecorr.xyzabc[3:], OFFSET[3:], atol=0.02)
        np.testing.assert_allclose(one.T_base_basecorr.matrix, found[0].T_base_basecorr.matrix, atol=1e-12)
        # The figures that every correction shows of all surfaces: their readings fit to the noise they have.
        assert [s["name"] for s in one.surfaces] == ["top", "side", "end"]
        assert max(s["rms_mm"] for s in one.surfaces) < 0.06
        assert min(s["agreeing_share"] for s in one.surfaces) > 0.9


def test_each_plan_states_the_common_posterior_about_its_own_centroid():
    found = joint(("top", "side"))
    T = [part_from_correction(c.T_base_basecorr, SETUP.T_base_partnom) for c in found]
    xi = np.random.default_rng(7).multivariate_normal(np.zeros(6), found[0].covariance, 5)
    for x in xi:
        # One displaced part, as a motion about either centroid, is as likely in either correction's words.
        displaced = moved(T[0], 1e-3 * x, found[0].centroid_mm)
        likely = []
        for placed, one in zip(T, found, strict=True):
            motion = motion_between(placed, displaced, one.centroid_mm)
            likely.append(motion @ np.linalg.solve(one.covariance, motion))
        assert likely[0] == pytest.approx(likely[1], rel=1e-5)
    for one in found:
        total = sum(d.sigma**2 * np.outer(d.vector, d.vector) for d in one.directions)
        np.testing.assert_allclose(total, one.covariance, rtol=1e-6, atol=1e-9 * np.abs(one.covariance).max())
    # Two faces leave the shift along their common edge to nobody.
    assert [d.status for d in found[0].directions] == ["held"] + ["measured"] * 5


def test_plans_in_different_bases_find_one_place_in_the_world():
    other = Setup.model_validate(_other_base())
    rng = np.random.default_rng(3)
    T = truth(OFFSET)
    between = SETUP.T_world_base.inv() @ Transform("world", "base", other.T_world_base.rigid)
    scans = [
        scanned("top", T, rng),
        scanned("side", Transform("base", "part", (between.inv() @ T).rigid), rng, setup=other),
        scanned("end", T, rng),
    ]
    found = align_several(scans, edges=False)
    worlds = [
        corrected_base(s.setup.T_world_base, c.T_base_basecorr).matrix @ s.setup.T_base_partnom.matrix
        for s, c in zip(scans, found, strict=True)
    ]
    np.testing.assert_allclose(worlds[1], worlds[0], atol=1e-9)
    true = SETUP.T_world_base.matrix @ T.matrix
    centre = np.array([110.0, 70.0, -30.0, 1.0])
    assert np.linalg.norm((worlds[0] - true) @ centre) < 0.05
    turn = between.inv().rotation_matrix
    np.testing.assert_allclose(
        found[1].covariance[:3, :3], turn @ found[0].covariance[:3, :3] @ turn.T, rtol=1e-6, atol=1e-15
    )


def _other_base():
    """The same nominal place of the part in the world, from a BASE taught elsewhere and turned."""
    place = SETUP.T_world_base.matrix @ SETUP.T_base_partnom.matrix
    base = {"x_mm": 1300.0, "y_mm": -100.0, "z_mm": 250.0, "a_deg": -15.0, "b_deg": 4.0, "c_deg": 2.0, "number": 5}
    T = Setup.model_validate({"base": base}).T_world_base
    six = Transform.from_matrix("base", "partnom", np.linalg.inv(T.matrix) @ place).xyzabc
    keys = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
    return {"base": base, "placement": dict(zip(keys, (float(v) for v in six), strict=True))}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "lines", "seeds"), [(("top", "side", "end"), INSIDE, 24), (("top", "side"), ACROSS, 12)]
)
def test_claimed_regions_hold_the_truth(names, lines, seeds):
    nominal = SETUP.T_base_partnom.renamed("base", "part")
    sigma = np.repeat([np.radians(SETUP.fixture.sigma_deg), SETUP.fixture.sigma_mm], 3)
    distance2, errors = [], []
    for seed in range(seeds):
        rng = np.random.default_rng(500 + seed)
        T = moved(nominal, sigma * rng.standard_normal(6), nominal.points(np.array([110.0, 70.0, -20.0])))
        length = (8.0, 30.0, 150.0)[seed % 3]
        scans = [scanned(n, T, rng, lines=lines, correlation_mm=length) for n in names]
        for one in align_several(scans, edges=lines is ACROSS)[:1]:
            placed = part_from_correction(one.T_base_basecorr, SETUP.T_base_partnom)
            xi = motion_between(placed, T, one.centroid_mm)
            distance2.append(xi @ np.linalg.solve(one.covariance, xi))
            errors.append(np.abs(xi))
    inside = int((np.array(distance2) <= chi2.ppf(0.95, 6)).sum())
    # What chance leaves of 95 % in so few scans, and no inflated claim: the mean is that of chi-square with six degrees.
    assert inside >= binom.ppf(0.01, seeds, 0.95)
    assert 3.5 < np.mean(distance2) < 8.5
    worst = np.percentile(errors, 95, axis=0)
    assert np.degrees(worst[:3]).max() <= 0.02
    assert worst[3:].max() <= 0.05


def test_a_surface_out_of_shape_is_named_in_every_correction():
    rng = np.random.default_rng(4)
    T = truth(OFFSET)
    # Bowed along its length by up to 1.2 mm: no placement explains it.
    bent = {"field": lambda p: 1e-4 * (p[:, 0] - 110.0) ** 2}
    scans = [scanned(n, T, rng, **(bent if n == "side" else {})) for n in ("top", "side", "end")]
    found = align_several(scans, edges=False)
    for one in found:
        assert one.verdict != "pass"
    for one in (found[0], found[2]):
        assert any("'side'" in i.message for i in one.issues)
    rms = {s["name"]: s["rms_mm"] for s in found[0].surfaces}
    assert rms["side"] > 3.0 * max(rms["top"], rms["end"])


def test_a_scan_that_fits_nowhere_fails_all_and_is_named():
    rng = np.random.default_rng(4)
    away = Transform.from_xyzabc("base", "base", (0.0, 0.0, 400.0, 0.0, 0.0, 0.0))
    scans = [scanned("top", truth(OFFSET), rng), scanned("side", truth(OFFSET), rng, origin_map=away)]
    found = align_several(scans, edges=False)
    assert [c.verdict for c in found] == ["fail", "fail"]
    for one in found:
        assert {i.where for i in one.issues if i.severity == "error"} == {"side"}


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"placement": {"x_mm": 30.5}}, "places-differ"),
        ({"base": {"x_mm": 0.0, "y_mm": 0.0, "z_mm": 0.0, "a_deg": 0.0, "number": 2}}, "bases-unrelated"),
        ({"probe": {"elements": 32}}, "setups-differ"),
        ({"fixture": {"sigma_mm": 1.0}}, "setups-differ"),
        ({"alignment": {"lock": ["a"]}}, "setups-differ"),
    ],
)
def test_plans_that_contradict_each_other_are_refused_in_words(change, code):
    content = {k: dict(v) for k, v in CELL.items()}
    for group, fields in change.items():
        content.setdefault(group, {}).update(fields)
    other = Setup.model_validate(content)
    rng = np.random.default_rng(2)
    scans = [scanned("top", truth(OFFSET), rng), scanned("side", truth(OFFSET), rng)]
    scans[1] = type(scans[1])("side", scans[1].cloud, scans[1].curved, (), other)
    with pytest.raises(EchoBaseError) as refused:
        align_several(scans)
    (issue,) = refused.value.issues
    assert issue.code == code
    assert issue.where == "side"
    assert "'top'" in issue.message
    assert "'side'" in issue.message
