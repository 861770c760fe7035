"""Edges of a curved part, where the outer laws lose their echo to tilt as steeply as to the edge."""

from dataclasses import replace

import numpy as np
import pytest

from alignment.estimate.map import MapFit, align_map
from alignment.estimate.motion import motion_between
from planner.frames import Transform
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, normal_error_mm, scan
from tests.loop.surfaces import plane, wing


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


def _plate_scan(seed, **disturbed):
    """A plate crossed by three passes, their array over its edges, and where it lies."""
    surface, setup = plane(), Setup()
    offset = Transform.from_xyzabc("base", "basecorr", [1.1, -0.7, 1.0, 0.2, -0.3, 0.2])
    T = part_from_correction(offset, setup.T_base_partnom)
    cloud = scan(surface, setup, T, np.random.default_rng(seed), (-8, 158), [4.0, 50.0, 96.0], **disturbed)
    return cloud, curved_of(surface), setup, T


def test_splash_and_lost_echoes_cost_a_plate_no_more_than_the_readings_lost():
    """The turn in the plane was off by up to 0.04 deg: half of the crossings were given up, others were off by tenths of mm."""
    for seed in range(3):
        cloud, curved, setup, T = _plate_scan(seed, outliers=0.1, dropouts=0.2)
        found = align_map(cloud, curved, setup)
        assert isinstance(found, MapFit)
        assert found.edges is not None
        assert found.edges["used"] > 280
        assert found.edges["rms_mm"] < 0.045
        xi = motion_between(found.T_base_part, T, found.centre_mm)
        assert np.abs(xi[3:5]).max() < 0.05
        assert abs(np.degrees(xi[2])) < 0.02
        assert np.degrees(np.sqrt(found.covariance[2, 2])) < 0.012


def test_an_echo_of_the_table_beside_the_part_does_not_hide_the_edge():
    """Where the part's echo falls below the table's, 8 mm behind it, that one is recorded."""
    cloud, curved, setup, T = _plate_scan(0)
    table = 45.0
    gone = cloud.lost_pose_index, cloud.lost_law
    heard = cloud.amplitude_pct >= 0.5 * table
    behind = np.r_[cloud.amplitude_pct[~heard], np.zeros(len(gone[0]))]
    poses = np.r_[cloud.pose_index[~heard], gone[0]]
    join = lambda own, lost: np.concatenate([own[heard], own[~heard], lost])  # noqa: E731
    i32 = lambda a: a.astype(np.int32)  # noqa: E731
    with_table = replace(
        cloud,
        origins_base=join(cloud.origins_base, cloud.lost_origins_base),
        beams_base=join(cloud.beams_base, cloud.lost_beams_base),
        arrays_base=np.concatenate([cloud.arrays_base[heard], np.tile(cloud.arrays_base[0], (len(behind), 1))]),
        distance_mm=np.r_[cloud.distance_mm[heard], np.full(len(behind), 23.0)],
        amplitude_pct=np.r_[cloud.amplitude_pct[heard], np.full(len(behind), table)],
        law=i32(join(cloud.law, cloud.lost_law)),
        pose_index=i32(np.r_[cloud.pose_index[heard], poses]),
        pass_id=i32(join(cloud.pass_id, cloud.lost_pass_id)),
        scan_id=np.zeros(heard.sum() + len(behind), dtype=np.int32),
        lost_origins_base=np.zeros((0, 3)), lost_pose_index=gone[0][:0], lost_law=gone[1][:0],
        lost_beams_base=np.zeros((0, 3)), lost_pass_id=cloud.lost_pass_id[:0],
    )  # fmt: skip
    found = align_map(with_table, curved, setup)
    assert isinstance(found, MapFit)
    assert found.edges is not None
    assert found.edges["used"] > 280
    xi = motion_between(found.T_base_part, T, found.centre_mm)
    assert np.abs(xi[3:5]).max() < 0.06
    assert abs(np.degrees(xi[2])) < 0.03
