"""Surfaces near each other: a thin wall scanned from both sides, and a channel whose wall is nearer than its floor."""

import numpy as np

from alignment.estimate.several import SurfaceScan, align_several
from tests.alignment.clouds import curved_of, scan
from tests.loop.surfaces import ParamSurface
from tests.several.blocks import SETUP, truth

OFFSET = (0.6, 0.9, -0.8, -0.3, 0.4, 0.6)
FLOOR = ParamSurface(lambda u, v: np.stack([u, v, 0 * u], 1), (0.0, 200.0), (0.0, 120.0))
BACK = ParamSurface(lambda u, v: np.stack([u, 120.0 - v, 0 * u - 1.5], 1), (0.0, 200.0), (0.0, 120.0))
# Stands up at the rim y = 0 of the floor and faces over it.
WALL = ParamSurface(lambda u, v: np.stack([200.0 - u, 0 * u, v], 1), (0.0, 200.0), (0.0, 80.0))


def scanned(name, surface, rng, v_values):
    cloud = scan(surface, SETUP, truth(OFFSET), rng, (10.0, 190.0), v_values)
    return SurfaceScan(name, cloud, curved_of(surface), (), SETUP)


def test_a_wall_thinner_than_the_search_is_no_mixture_of_its_sides():
    rng = np.random.default_rng(8)
    found = align_several(
        [scanned("front", FLOOR, rng, (25.0, 60.0, 95.0)), scanned("back", BACK, rng, (25.0, 60.0, 95.0))], edges=False
    )
    for one in found:
        assert max(s["rms_mm"] for s in one.surfaces) < 0.06
        assert min(s["agreeing_share"] for s in one.surfaces) > 0.9
    true = truth(OFFSET)
    placed = SETUP.T_base_partnom
    T = found[0].T_base_basecorr.matrix @ placed.matrix
    n, centre = true.rotation_matrix[:, 2], np.array([100.0, 60.0, 0.0, 1.0])
    assert abs(((T - true.matrix) @ centre)[:3] @ n) < 0.02


def test_readings_by_the_wall_of_a_channel_count_for_its_floor():
    rng = np.random.default_rng(9)
    # The pass nearest the wall: most of its laws are nearer to the wall than to the floor under them.
    by_wall = scanned("floor", FLOOR, rng, (16.0,))
    wall = scanned("wall", WALL, rng, (25.0, 55.0))
    found = align_several([by_wall, wall], edges=False)
    readings = {s["name"]: s["readings"] for s in found[0].surfaces}
    assert readings["floor"] > 0.9 * len(by_wall.cloud)
    assert readings["wall"] > 0.9 * len(wall.cloud)
    true = truth(OFFSET)
    T = found[0].T_base_basecorr.matrix @ SETUP.T_base_partnom.matrix
    for k, point in ((2, (100.0, 16.0, 0.0, 1.0)), (1, (100.0, 0.0, 40.0, 1.0))):
        assert abs(((T - true.matrix) @ np.array(point))[:3] @ true.rotation_matrix[:, k]) < 0.03
