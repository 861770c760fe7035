"""Decimation against scipy's CubicSpline, Slerp and a plain segment distance: written without the code under test."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from benchmarks.planning.panels import Panel, panels, tube
from planner.errors import EchoBaseError
from planner.frames import Transform
from planner.path.decimate import decimate, deviation
from planner.path.passes import DataRuns, assemble
from planner.path.raster import raster
from planner.toolpath import Role, ToolPath
from tests.path.shapes import crystal, curved_of, plate, setup_of


def blocks(path: ToolPath) -> list[tuple[np.ndarray, Rotation, np.ndarray]]:
    """TCP positions, orientations and roles of each pass from lead-in to lead-out."""
    tcp = path.Ts_part_tcp
    inside = np.isin(path.role, [Role.LEAD_IN, Role.DATA, Role.LEAD_OUT])
    out = []
    for k in range(path.passes):
        rows = np.flatnonzero(inside & (path.pass_id == k))
        out.append((tcp.xyz_mm[rows], tcp.rotation[rows], path.role[rows]))
    return out


def onto(points: np.ndarray, rotations: Rotation, curve: np.ndarray, turning: Rotation) -> tuple[float, float]:
    """Largest distance (mm) and angle (deg) of poses from a finely sampled curve: nearest point of its polyline."""
    d = np.linalg.norm(points[:, None] - curve[None], axis=2)
    j = np.clip(d.argmin(axis=1), 1, len(curve) - 2)
    best, turn = np.full(len(points), np.inf), np.zeros(len(points))
    for a, b in ((j - 1, j), (j, j + 1)):
        e = curve[b] - curve[a]
        t = np.clip(np.sum((points - curve[a]) * e, axis=1) / np.sum(e * e, axis=1), 0.0, 1.0)
        away = np.linalg.norm(points - curve[a] - t[:, None] * e, axis=1)
        between = turning[a] * Rotation.from_rotvec(t[:, None] * (turning[a].inv() * turning[b]).as_rotvec())
        angle = np.degrees((rotations.inv() * between).magnitude())
        turn = np.where(away < best, angle, turn)
        best = np.minimum(best, away)
    return float(best.max()), float(turn.max())


def worst(dense: ToolPath, sparse: ToolPath, bc: str) -> tuple[np.ndarray, np.ndarray]:
    """Largest (mm, deg) off the chords and off the splines, over all passes."""
    chord, spline = np.zeros(2), np.zeros(2)
    for (p, r, _), (k, q, _) in zip(blocks(dense), blocks(sparse), strict=True):
        t = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(k, axis=0), axis=1))]
        quaternion = q.as_quat()
        quaternion[1:] *= np.cumprod(np.where(np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0, -1.0, 1.0))[:, None]
        u = np.unique(np.concatenate([np.linspace(a, b, 24) for a, b in pairwise(t)]))
        straight = np.stack([np.interp(u, t, k[:, i]) for i in range(3)], axis=1)
        smooth = CubicSpline(t, k, bc_type=bc)(u), Rotation.from_quat(CubicSpline(t, quaternion, bc_type=bc)(u))
        chord = np.maximum(chord, onto(p, r, straight, Slerp(t, q)(u)))
        spline = np.maximum(spline, onto(p, r, *smooth))
    return chord, spline


CASES = {p.name: (p, s) for p, s in zip(panels(90, 30), ["plane", "geodesic"] * 4, strict=True)}
LONG = [n for n in CASES if "short" not in n]


@cache
def dense_path(name: str) -> ToolPath:
    panel, strategy = CASES[name]
    return raster(curved_of(panel), setup_of(strategy=strategy, step_mm=160.0))


@pytest.mark.parametrize("bc", ["not-a-knot", "natural"])
@pytest.mark.parametrize("name", LONG)
def test_chords_and_splines_stay_within_tolerance(name: str, bc: str) -> None:
    dense = dense_path(name)
    sparse = decimate(dense)
    chord, spline = worst(dense, sparse, bc)
    assert (chord <= (0.05, 0.1)).all()
    assert (spline <= (0.05, 0.1)).all()


def test_deviation_agrees_with_the_brute_force_figures() -> None:
    dense = dense_path("double-curved, long lines")
    keep = ~dense.is_data | (np.arange(len(dense)) % 12 == 0)
    keep |= np.r_[True, dense.role[1:] != dense.role[:-1]] | np.r_[dense.role[1:] != dense.role[:-1], True]
    sparse = dense.take(keep)
    mine = np.array(deviation(dense, sparse))
    chord, _ = worst(dense, sparse, "natural")
    every = np.max([worst(dense, sparse, bc)[1] for bc in ("natural", "not-a-knot")], axis=0)
    assert mine[:2] == pytest.approx(chord, rel=0.05)
    assert mine[2:] == pytest.approx(every, rel=0.05, abs=2e-4)
    assert mine[0] > 0.05  # every twelfth pose is too few on this panel


@pytest.mark.parametrize("name", LONG)
def test_spacing_grows_by_no_more_than_two_and_stays_under_fifteen(name: str) -> None:
    for xyz, _, _ in blocks(decimate(dense_path(name))):
        d = np.linalg.norm(np.diff(xyz, axis=0), axis=1)
        assert d.max() <= 15.0 + 1e-6
        assert (d[1:] / d[:-1]).max() <= 2.0 + 1e-6
        assert (d[:-1] / d[1:]).max() <= 2.0 + 1e-6


def test_ends_of_data_and_everything_outside_the_blocks_are_kept() -> None:
    dense = dense_path("two holes")
    sparse = decimate(dense)
    assert len(sparse) < len(dense) / 3
    for k in range(dense.passes):
        a, b = (p.take(p.pass_id == k) for p in (dense, sparse))
        for role in Role:
            x, y = (p.Ts_part_tcp.matrix[p.role == role] for p in (a, b))
            if not len(x):
                assert not len(y)
                continue
            if role != Role.LEAD_OUT:
                assert (x[0] == y[0]).all()
            if role != Role.LEAD_IN:
                assert (x[-1] == y[-1]).all()
            if role in (Role.APPROACH, Role.RETRACT, Role.LINK):
                assert len(x) == len(y)


def test_flat_passes_need_few_poses_and_curved_ones_more() -> None:
    flat = decimate(raster(curved_of(plate(1500.0, 100.0)), setup_of(strategy="plane", step_mm=40.0)))
    per_pass = np.bincount(flat.pass_id)
    assert per_pass.max() <= 1490.0 / 14.0 + 6
    panel = tube(360, 20)
    rings = decimate(raster(curved_of(panel), crystal(strategy="plane", step_mm=100.0)))
    # A chord of the circle of radius 115 (the TCP's): sag 0.05 mm asks for at most sqrt(8 x 0.05 x 115) = 6.8 mm.
    xyz = blocks(rings)[0][0]
    longest = np.linalg.norm(np.diff(xyz, axis=0), axis=1).max()
    assert 4.0 <= longest <= np.sqrt(8 * 0.05 * 115.0) * 1.02


def test_a_fillet_between_flats_is_followed() -> None:
    """Flat, R 30 over 60 deg, flat: where splines through evenly thinned points leave the surface."""
    a = np.radians(np.linspace(-30.0, 30.0, 121))
    arc = np.stack([30.0 * np.sin(a), 30.0 * np.cos(a) - 30.0], axis=1)
    run = np.linspace(0.0, 150.0, 76)[1:, None]
    left = arc[0] + run[::-1] * [-np.cos(a[0]), np.sin(a[0])] * np.array([1.0, 1.0])
    right = arc[-1] + run * [np.cos(a[-1]), -np.sin(a[-1])]
    profile = np.concatenate([left, arc, right])
    y = np.linspace(-40.0, 40.0, 5)
    x, yy = np.meshgrid(np.arange(len(profile)), y, indexing="ij")
    v = np.stack([profile[x.ravel(), 0], yy.ravel(), profile[x.ravel(), 1]], axis=1)
    i = np.arange(x.size).reshape(x.shape)
    p, q, r, s = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([p, q, r], 1), np.stack([p, r, s], 1)])
    dense = raster(curved_of(Panel("fillet", v, faces, lambda n: n)), setup_of(strategy="plane", step_mm=20.0))
    sparse = decimate(dense)
    for bc in ("natural", "not-a-knot"):
        chord, spline = worst(dense, sparse, bc)
        assert (chord <= (0.05, 0.1)).all()
        assert (spline <= (0.05, 0.1)).all()


def test_tolerances_are_honoured_when_tightened() -> None:
    dense = dense_path("double-curved, long lines")
    loose, tight = decimate(dense), decimate(dense, chord_tol_mm=0.005, angle_tol_deg=0.02, max_spacing_mm=9.0)
    assert len(tight) > 1.3 * len(loose)
    mine = deviation(dense, tight)
    assert max(mine[0], mine[2]) <= 0.005
    assert max(mine[1], mine[3]) <= 0.02


@pytest.mark.parametrize("acquired_mm", [0.7, 2.0, 4.0, 8.0])
def test_the_spacing_of_the_acquisition_does_not_set_that_of_the_robot(acquired_mm: float) -> None:
    dense = raster(
        curved_of(plate(1500.0, 100.0)), setup_of(strategy="plane", step_mm=40.0, point_spacing_mm=acquired_mm)
    )
    sparse = decimate(dense)
    data = np.flatnonzero(sparse.is_data & (sparse.pass_id == 0))
    d = np.linalg.norm(np.diff(sparse.Ts_part_tcp.xyz_mm[data], axis=0), axis=1)
    # 1490 mm in as few pieces of at most 15 mm as there can be, but for those that grow from the 10 mm of the lead.
    assert len(d) <= np.ceil(1490.0 / 15.0) + 2
    assert d.max() <= 15.0


def test_poses_between_those_of_the_acquisition_stand_on_the_surface_and_face_it() -> None:
    sparse = decimate(raster(curved_of(tube(360, 20)), crystal(strategy="plane", step_mm=100.0)))
    data = sparse.take(sparse.is_data)
    axes, p = data.Ts_part_tcp.rotation_matrix, data.Ts_part_tcp.xyz_mm
    radius = np.linalg.norm(p[:, 1:], axis=1)
    assert np.abs(radius - 115.0).max() < 2e-3
    out = p * [0.0, 1.0, 1.0] / radius[:, None]
    assert np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", -axes[:, :, 2], out), -1.0, 1.0))).max() < 0.01
    assert (np.abs(data.bary.sum(axis=1) - 1.0) < 1e-9).all()
    assert data.bary.min() > -1e-9


def test_a_rough_surface_never_takes_more_poses_than_were_acquired() -> None:
    """Vertices that scatter by 0.05 mm on edges of 5 mm: normals turn to and fro by a degree."""
    panel = plate(200.0, 120.0)
    rough = panel.vertices + np.random.default_rng(2).normal(0.0, 0.05, panel.vertices.shape)
    dense = raster(curved_of(replace(panel, vertices=rough)), crystal(strategy="plane", step_mm=30.0))
    sparse = decimate(dense)
    assert len(sparse) <= len(dense)
    for bc in ("natural", "not-a-knot"):
        chord, spline = worst(dense, sparse, bc)
        assert (chord <= (0.05, 0.1)).all()
        assert (spline <= (0.05, 0.1)).all()


def kinked(seed: int, step_mm: float) -> ToolPath:
    """One pass over a profile of flats, arcs of R 30 to 800 and up to five kinks of up to 12 deg, poses unevenly spaced at
    every third seed; beams that waver about the travel at every second."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(40, 200))
    bend = np.zeros(n)
    for _ in range(rng.integers(0, 4)):
        a, length = rng.integers(0, n), rng.integers(5, 60)
        bend[a : a + length] += step_mm / rng.uniform(30.0, 800.0) * rng.choice([-1, 1])
    for _ in range(rng.integers(1, 6)):
        bend[rng.integers(0, n)] += np.radians(rng.uniform(0.05, 12.0)) * rng.choice([-1, 1])
    step = step_mm * (rng.uniform(0.3, 1.0, n) if seed % 3 == 0 else np.ones(n))
    at = np.cumsum(bend)
    points = np.cumsum(np.column_stack([np.cos(at), np.zeros(n), np.sin(at)]) * step[:, None], axis=0)
    lean = np.concatenate([at[:1], 0.5 * (at[1:] + at[:-1])])
    travel = np.column_stack([np.cos(lean), np.zeros(n), np.sin(lean)])
    normals = np.column_stack([-np.sin(lean), np.zeros(n), np.cos(lean)])
    if seed % 2:
        waver = np.radians(np.cumsum(rng.normal(0.0, 0.05, n)))
        normals = Rotation.from_rotvec(travel * waver[:, None]).apply(normals)
    one = np.ones(1, dtype=np.int8)
    on = np.zeros(n, dtype=np.int32), np.tile([1.0, 0.0, 0.0], (n, 1)), np.zeros(n, dtype=np.int64)
    return assemble(DataRuns(points, normals, travel, *on, one), "inspection", 15.0, step_mm)


@pytest.mark.parametrize("step_mm", [0.7, 2.0, 5.0])
def test_kinked_passes_keep_spacing_and_tolerance(step_mm: float) -> None:
    """Poses beside a kink stand as near to each other as the kink puts them; those sent do not, and are hardly more."""
    poses = sent = 0
    for seed in range(40):
        dense = kinked(seed, step_mm)
        sparse = decimate(dense)
        poses, sent = poses + len(dense), sent + len(sparse)
        ((xyz, _, _),) = blocks(sparse)
        d = np.linalg.norm(np.diff(xyz, axis=0), axis=1)
        assert d.max() <= 15.0 + 1e-6
        assert np.maximum(d[1:] / d[:-1], d[:-1] / d[1:]).max() <= 2.0 + 1e-6
        chord_mm, chord_deg, spline_mm, spline_deg = deviation(dense, sparse)
        assert max(chord_mm, spline_mm) <= 0.05
        assert max(chord_deg, spline_deg) <= 0.1
        if step_mm > 1.0:
            # Where the TCP backs at an inner kink, its nearest place on the motion is not its place in time.
            chord, spline = worst(dense, sparse, "natural")
            assert (chord <= (0.05, 0.1)).all()
            assert (spline <= (0.05, 0.1)).all()
    assert sent < poses


@pytest.mark.parametrize("seed", [188, 296, 10044])
def test_deviation_where_the_tcp_backs_in_a_kink(seed: int) -> None:
    """There the motion comes by one place twice, turned otherwise: neither is taken for the other, nor an error for it."""
    dense = kinked(seed, 0.7)
    sparse = decimate(dense)
    figures = np.array(deviation(dense, sparse))
    assert (figures <= (0.05, 0.1, 0.05, 0.1)).all()
    # One that stands on a dense pose: beside kinks there are more of them than poses to see their error.
    one = 5
    turned = sparse.Ts_part_contact.rigid.as_matrix()
    turned[one, :3, :3] = turned[one, :3, :3] @ Rotation.from_euler("x", 0.3, degrees=True).as_matrix()
    wrong = replace(sparse, Ts_part_contact=Transform.from_matrix("part", "contact", turned))
    assert deviation(dense, wrong)[1] > 0.2


def test_nonsense_tolerances_are_refused() -> None:
    with pytest.raises(EchoBaseError, match="max_ratio"):
        decimate(dense_path("twist"), max_ratio=1.0)
