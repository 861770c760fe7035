"""Shapes that cannot tell everything: what slides or turns on itself must not be called measured."""

import numpy as np
import pytest

from alignment.estimate.align import align
from alignment.estimate.motion import motion_between
from planner.frames import Transform
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, normal_error_mm, scan
from tests.loop.surfaces import ParamSurface, cylinder, wing

CELL = Setup.model_validate(
    {"placement": {"x_mm": 400, "y_mm": 50, "z_mm": 20, "a_deg": 20}, "alignment": {"edges": False}}
)
OFFSET = Transform.from_xyzabc("base", "basecorr", [0.8, -0.6, 0.7, 0.2, -0.3, 0.4])


def sphere(radius=150.0, half=0.6):
    def point(u, v):
        return np.stack([radius * np.sin(u), radius * np.cos(u) * np.sin(v), radius * np.cos(u) * np.cos(v)], 1)

    return ParamSurface(point, (-half, half), (-half, half))


def cone(angle=0.35, length=300.0):
    def point(u, v):
        r = 80 + u * np.tan(angle)
        return np.stack([u, r * np.sin(v), r * np.cos(v)], 1)

    return ParamSurface(point, (0.0, length), (-0.7, 0.7))


def saddle(k=1 / 600.0):
    return ParamSurface(lambda u, v: np.stack([u, v, 0.5 * k * (u**2 - v**2)], 1), (-150.0, 150.0), (-100.0, 100.0))


def find(surface, u_range, v_values, mesh=(61, 41), seed=0):
    T = part_from_correction(OFFSET, CELL.T_base_partnom)
    cloud = scan(surface, CELL, T, np.random.default_rng(seed), u_range, v_values)
    found = align(cloud, curved_of(surface, *mesh), [], CELL, edges=False)
    return found, T, normal_error_mm(surface, T, part_from_correction(found.T_base_basecorr, CELL.T_base_partnom))


def self_motion(found, turn_axis=None, point=None, slide=None):
    """The motion of the surface in itself, in prior standard deviations, as a unit vector."""
    T = part_from_correction(found.T_base_basecorr, CELL.T_base_partnom)
    w = np.zeros(3) if turn_axis is None else T.directions(turn_axis)
    v = np.zeros(3) if slide is None else T.directions(slide)
    if turn_axis is not None:
        v = v + np.cross(w, found.centroid_mm - T.points(point))
    xi = np.r_[w, v] / np.repeat([np.radians(0.5), 2.0], 3)
    return xi / np.linalg.norm(xi)


def held_share(found, motion):
    prior = np.repeat([np.radians(0.5), 2.0], 3)
    return np.sqrt(sum(float(d.vector / prior @ motion) ** 2 for d in found.directions if d.status == "held"))


def test_cylinder_holds_its_turn_and_its_slide():
    found, _, error = find(cylinder(400, 400, 300), (20, 380), [-0.25, 0.0, 0.25])
    assert held_share(found, self_motion(found, slide=[1.0, 0, 0])) > 0.99
    assert held_share(found, self_motion(found, [1.0, 0, 0], [0, 0, 0.0])) > 0.95
    assert error <= 0.02


def test_sphere_cap_holds_three_turns():
    found, _, error = find(sphere(), (-0.5, 0.5), [-0.35, 0.0, 0.35])
    for axis in np.eye(3):
        assert held_share(found, self_motion(found, axis, [0, 0, 0.0])) > 0.97
    # Three passes of 150 mm know the centre of the sphere to about this: 0.03 mm of wander over 10 mm, a slope of 0.3.
    assert error <= 3.0 * 0.03 / np.sqrt(450 / 20) / 0.3


def test_cone_holds_its_turn():
    found, _, error = find(cone(), (20, 280), [-0.5, 0.0, 0.5])
    assert held_share(found, self_motion(found, [1.0, 0, 0], [0, 0, 0.0])) > 0.95
    assert error <= 0.02


def test_saddle_and_wing_are_right_where_it_counts():
    for surface, lines in ((saddle(), ((-130, 130), [-70, 0, 70])), (wing(600), ((30, 570), [0.15, 0.5, 0.85]))):
        found, T, error = find(surface, *lines, mesh=(81, 41))
        assert error <= 0.02
        xi = motion_between(part_from_correction(found.T_base_basecorr, CELL.T_base_partnom), T, found.centroid_mm)
        assert xi @ np.linalg.solve(found.covariance, xi) < 25.0


@pytest.mark.parametrize("seed", range(2))
def test_claims_cover_the_truth_on_a_wing(seed):
    found, T, _ = find(wing(600), (30, 570), [0.2, 0.8], mesh=(81, 41), seed=seed + 10)
    xi = motion_between(part_from_correction(found.T_base_basecorr, CELL.T_base_partnom), T, found.centroid_mm)
    assert 0.1 < xi @ np.linalg.solve(found.covariance, xi) < 25.0
