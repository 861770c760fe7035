"""Edges of a curved part, where the outer laws lose their echo to tilt as steeply as to the edge."""

import numpy as np
import pytest

from alignment.estimate.map import MapFit, align_map
from planner.frames import Transform
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, normal_error_mm, scan
from tests.loop.surfaces import wing


@pytest.mark.slow
@pytest.mark.parametrize(("chord", "camber", "twist"), [(140.0, 12.0, 4.0), (200.0, 30.0, 0.0)])
def test_passes_along_the_rim_of_a_wing(chord, camber, twist):
    """Was up to 0.5 mm across and 0.2 mm along the normal: tilt taken for the edge."""
    surface, setup = wing(length=300.0, chord=chord, camber=camber, twist_deg=twist), Setup()
    curved = curved_of(surface, 121, 61)
    offset = Transform.from_xyzabc("base", "basecorr", [1.1, -0.7, 1.0, 0.2, -0.3, 0.2])
    T = part_from_correction(offset, setup.T_base_partnom)
    middle = curved.surface.centroid_part[None]
    off = []
    for seed in range(3):
        cloud = scan(surface, setup, T, np.random.default_rng(seed), (-8, 308), [surface.v[0], 0.5, surface.v[1]])
        found, alone = (align_map(cloud, curved, setup, edges) for edges in (True, False))
        assert isinstance(found, MapFit)
        assert isinstance(alone, MapFit)
        assert found.edges is not None
        assert found.edges["used"] > 200
        # Edges may not cost what the surface alone knows.
        limit = max(0.02, 1.5 * normal_error_mm(surface, T, alone.T_base_part))
        assert normal_error_mm(surface, T, found.T_base_part) < limit
        off.append((found.T_base_part.points(middle) - T.points(middle))[0, :2])
    assert np.median(np.abs(off), axis=0).max() < 0.05


@pytest.mark.slow
def test_lost_and_false_echoes_do_not_move_the_rim():
    """Crossings were up to 4 mm inside the rim, 0.2 to 0.3 mm rms here: the median of neighbours was taken for a reading."""
    surface, setup = wing(length=300.0, chord=140.0, camber=4.0, twist_deg=0.0), Setup()
    curved = curved_of(surface, 121, 61)
    offset = Transform.from_xyzabc("base", "basecorr", [1.1, -0.7, 1.0, 0.2, -0.3, 0.2])
    T = part_from_correction(offset, setup.T_base_partnom)
    middle = curved.surface.centroid_part[None]
    lines_v = [surface.v[0], 0.5 * (surface.v[0] + surface.v[1]), surface.v[1]]
    for seed in range(3):
        rng = np.random.default_rng(seed)
        cloud = scan(surface, setup, T, rng, (-8, 308), lines_v, outliers=0.1, dropouts=0.2)
        found = align_map(cloud, curved, setup)
        assert isinstance(found, MapFit)
        assert found.edges is not None
        assert found.edges["used"] > 100
        assert found.edges["rms_mm"] < 0.15
        assert np.abs(found.T_base_part.points(middle) - T.points(middle)).max() < 0.06
