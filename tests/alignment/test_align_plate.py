"""The flat plate of the paper: what a surface can tell, what edges add, what must not matter."""

import json
from functools import lru_cache

import numpy as np
import pytest

from alignment.estimate.align import align
from alignment.estimate.keypoint_method import align_keypoints
from alignment.estimate.motion import motion_between
from planner.frames import Transform
from planner.keypoint import KeyPoint
from planner.path.raster import raster
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, scan
from tests.loop.surfaces import plane

PLATE = plane()
CENTRE = np.array([75.0, 50.0, 0.0])
OFFSET = (1.1, -0.7, 1.0, 0.2, -0.8, 0.5)
CELL = Setup.model_validate(
    {
        "base": {"x_mm": 1000, "y_mm": 200, "z_mm": 300, "a_deg": 40, "number": 2},
        "placement": {"x_mm": 30, "y_mm": -20, "z_mm": 10, "a_deg": 12},
    }
)
INSIDE = ((5, 145), [12.5 + 18.75 * k for k in range(5)])
ACROSS = ((-8, 158), [20.0 * k for k in range(6)])


@lru_cache
def curved():
    return curved_of(PLATE)


@lru_cache
def inspection(setup_json: str = ""):
    return raster(curved(), CELL)


def truth(setup=CELL, offset=OFFSET):
    return part_from_correction(Transform.from_xyzabc("base", "basecorr", offset), setup.T_base_partnom)


def run(lines, seed=1, setup=CELL, offset=OFFSET, keypoints=(), method="map", edges=None, **noise):
    cloud = scan(PLATE, setup, truth(setup, offset), np.random.default_rng(seed), *lines, **noise)
    return align(cloud, curved(), keypoints, setup, inspection(), method=method, edges=edges)


def height_and_tilt(found, setup=CELL, offset=OFFSET):
    T, T_true = part_from_correction(found.T_base_basecorr, setup.T_base_partnom), truth(setup, offset)
    n, n_found = T_true.directions([0, 0, 1.0]), T.directions([0, 0, 1.0])
    tilt = np.degrees(np.arctan2(np.linalg.norm(np.cross(n, n_found)), n @ n_found))
    return abs((T.points(CENTRE) - T_true.points(CENTRE)) @ n), tilt


def xi_of(found, setup=CELL, offset=OFFSET):
    T = part_from_correction(found.T_base_basecorr, setup.T_base_partnom)
    return motion_between(T, truth(setup, offset), found.centroid_mm)


@pytest.mark.parametrize("seed", range(3))
def test_surface_alone_finds_height_and_tilt_and_holds_the_rest(seed):
    found = run(INSIDE, seed, edges=False)
    height, tilt = height_and_tilt(found)
    assert height <= 0.02
    assert tilt <= 0.02
    assert [a.status for a in found.axes] == ["held", "held", "measured", "held", "measured", "measured"]
    assert sorted(d.status for d in found.directions) == ["held"] * 3 + ["measured"] * 3
    assert found.verdict == "pass"


def test_held_directions_stay_exactly_nominal():
    found = run(INSIDE, edges=False)
    T = part_from_correction(found.T_base_basecorr, CELL.T_base_partnom)
    nominal = CELL.T_base_partnom.renamed("base", "part")
    centre = nominal.points(CENTRE)
    total = motion_between(nominal, T, centre)
    held = [d.vector for d in found.directions if d.status == "held"]
    prior = np.repeat([np.radians(0.5), 2.0], 3)
    assert max(abs((v / prior) @ (total / prior)) for v in held) < 2e-3


@pytest.mark.parametrize("seed", range(3))
def test_edges_give_all_six(seed):
    found = run(ACROSS, seed)
    xi = xi_of(found)
    assert np.abs(xi[3:]).max() <= 0.05
    assert np.degrees(np.abs(xi[:3])).max() <= 0.02
    assert {a.status for a in found.axes} == {"measured"}
    assert found.edges["used"] > 100


def test_outliers_and_dropouts_do_not_matter():
    found = run(INSIDE, 5, edges=None, outliers=0.10, dropouts=0.20)
    height, tilt = height_and_tilt(found)
    assert height <= 0.02
    assert tilt <= 0.02
    # The passes never cross the ends of the plate: nothing may be claimed along them.
    along = Transform.from_xyzabc("base", "part", CELL.placement.xyzabc()).directions([1.0, 0, 0])
    held = [d.vector[3:] / 2.0 for d in found.directions if d.status == "held"]
    assert max(abs(v @ along) for v in held) > 0.99


@pytest.mark.parametrize(
    "offset", [(0, 0, 9.5, 0, 0, 0), (0, 0, -9.0, 0, 0, 0), (2, 1, 2.0, 0, 2.9, 0), (0, 0, 0, 0, 0, -2.9)]
)
def test_capture_range(offset):
    # About the plate's middle, so that no point moves by more than two thirds of the standoff.
    middle = Transform.from_xyzabc("base", "base", [*CELL.T_base_partnom.points(CENTRE), 0, 0, 0])
    moved = middle @ Transform.from_xyzabc("base", "base", offset) @ middle.inv()
    about = tuple(Transform("base", "basecorr", moved.rigid).xyzabc)
    found = run(INSIDE, 7, offset=about, edges=False)
    height, tilt = height_and_tilt(found, offset=about)
    assert height <= 0.03
    assert tilt <= 0.03


def test_same_input_same_bits():
    a, b = (json.dumps(run(ACROSS, 11).to_json()) for _ in range(2))
    assert a == b


def test_locked_axes_stay_nominal():
    setup = Setup.model_validate({**CELL.model_dump(), "alignment": {"lock": ["z", "b"]}})
    found = run(INSIDE, setup=setup, edges=False, offset=(0.5, 0.4, 0.0, 0.1, 0.0, 0.6))
    six = found.T_base_basecorr.xyzabc
    assert abs(six[2]) < 1e-4
    assert abs(six[4]) < 1e-4
    assert abs(six[5] - 0.6) < 0.02
    assert {found.axes[2].status, found.axes[4].status} == {"held"}


KEYPOINTS = tuple(
    KeyPoint(id=f"K{i}", x_mm=x, y_mm=y, z_mm=0) for i, (x, y) in enumerate([(30, 30), (120, 30), (120, 75), (30, 75)])
)


def test_keypoint_method_fills_what_it_cannot_see():
    cloud = scan(PLATE, CELL, truth(), np.random.default_rng(2), *INSIDE)
    fit = align_keypoints(cloud, curved(), KEYPOINTS, CELL)
    assert all(m.matched and m.readings > 200 for m in fit.matches)
    found = align(cloud, curved(), KEYPOINTS, CELL, inspection(), method="keypoints")
    height, tilt = height_and_tilt(found)
    assert height < 0.1
    assert tilt < 0.3
    assert np.hypot(*xi_of(found)[3:5]) > 0.2
    assert {found.axes[0].status, found.axes[1].status} <= {"weak", "held"}


def test_keypoints_off_the_part_or_too_quiet_are_rejected_with_the_reason():
    cloud = scan(PLATE, CELL, truth(), np.random.default_rng(2), (40, 145), [31.0, 69.0])
    strict = Setup.model_validate({**CELL.model_dump(), "alignment": {"min_amplitude_pct": 49.0}})
    fit = align_keypoints(cloud, curved(), KEYPOINTS, CELL)
    assert [m.status for m in fit.matches].count("rejected") == 2
    assert fit.T_base_part is None
    assert fit.issues[0].code == "keypoints-too-few"
    assert all(
        "amplitude" in m.reason for m in align_keypoints(cloud, curved(), KEYPOINTS, strict).matches if m.readings
    )


def test_limits_refuse_and_never_clamp():
    setup = Setup.model_validate({**CELL.model_dump(), "limits": {"correction_mm": 0.5}})
    found = run(INSIDE, setup=setup)
    assert found.verdict == "fail"
    assert "limit-displacement" in {i.code for i in found.issues}
    assert height_and_tilt(found)[0] <= 0.02


def test_sprung_back_plate_is_partial():
    found = run(INSIDE, 3, edges=False, field=lambda p: 1.2 * ((p[:, 0] - 75) / 75) ** 2)
    assert found.verdict == "partial"
    assert "not-rigid" in {i.code for i in found.issues}


@pytest.mark.parametrize("seed", range(3))
def test_a_bent_plate_is_not_taken_for_wrong_laws_or_water(seed):
    """Bends of a millimetre or two, both ways and twisted, with a dent: nothing but the shape is at fault."""
    c = np.random.default_rng(seed).normal(size=4)

    def field(p):
        u, v = (p[:, 0] - 75) / 75, (p[:, 1] - 50) / 50
        return 1.5 * (c[0] * u**2 + c[1] * v**2 + c[2] * u * v) + c[3] * np.exp(-3.0 * ((u + 0.2) ** 2 + v**2))

    found = run(ACROSS, seed, field=field)
    wrong = ("laws", "array", "poses", "tof", "beam", "sound", "scan")
    assert [i.code for i in found.issues if i.code.startswith(wrong)] == []
    assert found.residual.rms_mm > 0.3


def test_json_is_the_contract():
    content = run(ACROSS, 4, keypoints=KEYPOINTS).to_json()
    assert json.loads(json.dumps(content, allow_nan=False)) == content
    assert list(content["dof"]) == ["x", "y", "z", "a", "b", "c"]
    assert set(content["correction"]) == {"x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"}
    assert content["base"]["number"] == 2
    assert len(content["directions"]) == 6
    covariance = np.array(content["covariance"])
    rebuilt = sum(d["sigma"] ** 2 * np.outer(d["vector"], d["vector"]) for d in content["directions"])
    scale = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(rebuilt / np.outer(scale, scale), covariance / np.outer(scale, scale), atol=1e-9)
    assert [k["status"] for k in content["keypoints"]] == ["matched"] * 4
