"""What the passes run along: the straightest direction of any tessellation, or a line drawn."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from benchmarks.planning.panels import Panel, cylinder, height_panel, tube, twist_slope, twist_z
from planner.errors import EchoBaseError
from planner.path.axes import raster_axes
from planner.path.raster import raster
from tests.path.shapes import crystal, curved_of, plate, rotated, setup_of
from tests.surface.shapes import grid


def shallow_arc(nx: int, ny: int, jitter: float = 0.0, wide: float = 400.0, long: float = 200.0) -> Panel:
    """A piece of a cylinder of radius 300 mm about Y, longer round it than along it."""
    v, f = grid(np.linspace(-wide / 2, wide / 2, nx), np.linspace(0, long, ny), lambda x, y: 0.0 * x, jitter)
    a = v[:, 0] / 300.0
    return Panel("arc", np.stack([300 * np.sin(a), v[:, 1], 300 * np.cos(a)], axis=1), f, lambda p: p)


@pytest.mark.parametrize(
    "panel", [shallow_arc(40, 2), shallow_arc(13, 40), shallow_arc(60, 30, 0.35), shallow_arc(9, 3)]
)
def test_passes_run_along_the_axis_of_a_cylinder(panel):
    axes = raster_axes(curved_of(panel), setup_of(direction="lowest_curvature"))
    assert abs(axes.along[1]) > np.cos(np.radians(0.2))
    assert abs(raster_axes(curved_of(panel), setup_of()).along[0]) > 0.99
    path = raster(curved_of(panel), crystal(direction="lowest_curvature", step_mm=5.0, strategy="plane"))
    travel = path.take(path.is_data).Ts_part_contact.rotation_matrix[:, :, 0]
    assert np.abs(travel[:, 1]).min() > 0.9999


def test_a_whole_tube_is_scanned_along_its_axis_and_across_it_when_turned():
    curved = curved_of(tube(60, 12))
    along = raster_axes(curved, setup_of(direction="lowest_curvature")).along
    assert np.abs(along) == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    turned = raster_axes(curved, setup_of(direction="lowest_curvature", direction_deg=90.0)).along
    assert abs(turned[0]) < 1e-6


def test_what_bends_nowhere_or_everywhere_alike_keeps_its_longest_extent():
    bowl = height_panel(
        "bowl",
        lambda x, y: -(x**2 + y**2) / 6000.0,
        lambda x, y: (-x / 3000.0, -y / 3000.0),
        np.linspace(0, 1, 60),
        np.linspace(0, 1, 20),
    )
    for panel in (plate(), bowl):
        axes = raster_axes(curved_of(panel), setup_of(direction="lowest_curvature"))
        assert abs(axes.along[0]) > 0.9999


def distance_to_line(points, line):
    """Distance of points (n, 2) from a polyline with rays at its ends, by dense sampling."""
    first, last = line[0] - line[1], line[-1] - line[-2]
    line = np.concatenate([[line[0] + 9 * first], line, [line[-1] + 9 * last]])
    t = np.linspace(0, 1, 4001)[:, None]
    dense = np.concatenate([a + t * (b - a) for a, b in pairwise(line)])
    return np.sqrt(((points[:, None] - dense) ** 2).sum(axis=2).min(axis=1))


def test_geodesic_passes_are_offsets_of_the_line_drawn():
    line = np.array([(20.0, 60.0), (120.0, 90.0), (280.0, 80.0)])
    curved = curved_of(plate(300.0, 200.0))
    setup = crystal(strategy="geodesic", direction="drawn", step_mm=10.0, guide=[[*p, 0.0] for p in line.tolist()])
    path = raster(curved, setup)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    smooth = CubicSpline(s, line, bc_type="natural")(np.linspace(0, s[-1], 60))
    data = path.take(path.is_data)
    at = data.Ts_part_contact.xyz_mm[:, :2]
    spread = []
    for k in range(path.passes):
        one = distance_to_line(at[data.pass_id == k], smooth)
        spread.append(np.ptp(np.percentile(one, [5, 95])))
        # Where the offsets of a bend meet on its inner side they have a kink, which the passes round off.
        outer = np.median(at[data.pass_id == k, 1]) > 85.0
        assert spread[-1] < (0.2 if outer else 1.0)
    assert np.median(spread) < 0.15


def test_two_points_on_a_twisted_panel_give_passes_along_them_wherever_it_is():
    panel = height_panel("twist", twist_z, twist_slope, np.linspace(0, 1, 60), np.linspace(0, 1, 20))
    a, b = np.array([-600.0, -200.0, twist_z(-600.0, -200.0)]), np.array([500.0, 150.0, twist_z(500.0, 150.0)])
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    shift = np.array([300.0, -20.0, 10.0])
    for shape, p, q in ((panel, a, b), (rotated(panel, turn, shift), turn @ a + shift, turn @ b + shift)):
        setup = crystal(strategy="plane", direction="drawn", step_mm=20.0, guide=[p.tolist(), q.tolist()])
        path = raster(curved_of(shape), setup)
        travel = path.take(path.is_data).Ts_part_contact.rotation_matrix[:, :, 0]
        chord = (q - p) / np.linalg.norm(q - p)
        assert np.abs(travel @ chord).min() > 0.97


@pytest.mark.parametrize(
    ("panel", "guide"),
    [
        (plate(), [[10.0, 10.0, 0.0], [10.0, 10.0, 0.0]]),
        (tube(60, 12), [[50.0, 100.0, 0.0], [150.0, 100.0, 0.0], [250.0, 90.0, 40.0]]),
    ],
)
def test_a_line_that_guides_nothing_is_refused(panel, guide):
    with pytest.raises(EchoBaseError) as caught:
        raster_axes(curved_of(panel), setup_of(direction="drawn", guide=guide))
    assert caught.value.issues[0].code == "guide-degenerate"


def test_the_cylinder_of_the_benchmark_keeps_its_axis():
    axes = raster_axes(curved_of(cylinder(30, 20)), setup_of(direction="lowest_curvature"))
    assert abs(axes.along[0]) > np.cos(np.radians(0.05))
