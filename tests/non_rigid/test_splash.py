"""Where the echo is lost and only splash is left, nothing is known of the part's shape."""

from dataclasses import replace

import numpy as np

from alignment.non_rigid.fit import fit_field
from planner.frames import Transform
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, scan
from tests.loop.surfaces import double_curved
from tests.non_rigid.cases import thinned


def test_splash_where_no_echo_comes_back_is_no_shape():
    skin, cell, rng = double_curved(400, 260, 1500, 700), Setup(), np.random.default_rng(1)
    T = part_from_correction(
        Transform.from_xyzabc("base", "basecorr", [1, -1, 0.5, 0.1, 0.2, -0.1]), cell.T_base_partnom
    )
    cloud = scan(skin, cell, T, rng, (-190, 190), [-100, -50, 0, 50, 100])
    # Half of the part sends nothing back; of a hundred firings there ten hear splash, anywhere before the back wall.
    far = T.inv().points(cloud.origins_base)[:, 0] > 0.0
    splash = far & (rng.random(len(cloud)) < 0.1)
    assert splash.sum() > 200
    cloud = replace(
        cloud,
        distance_mm=np.where(splash, rng.uniform(3.0, 28.0, len(cloud)), cloud.distance_mm),
        amplitude_pct=np.where(splash, rng.uniform(5.0, 50.0, len(cloud)), cloud.amplitude_pct),
    )
    cloud = thinned(cloud, ~far | splash)
    found = fit_field(cloud, curved_of(skin, 41, 31), cell, T)
    assert found.field is None
    assert not found.seen
