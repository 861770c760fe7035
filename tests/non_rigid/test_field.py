"""`Field`, its support and the displaced surface, against differences, against the textbook formula and against planes."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from alignment.non_rigid import Field, SprungSurface
from alignment.non_rigid.covariance import NodeCovariance, matern, surface_axes
from alignment.non_rigid.samples import samples_of
from tests.alignment.clouds import curved_of
from tests.non_rigid import cases
from tests.non_rigid.cases import CYLINDER, PLATE, measured

RNG = np.random.default_rng(11)


def field_on(part, alpha=None, motion=None):
    curved = curved_of(part.surface)
    u = RNG.uniform(*part.surface.u, 60)
    v = RNG.uniform(*part.surface.v, 60)
    nodes = part.surface.point(u, v)
    scaling = np.diag([1 / 80.0, 1 / 60.0, 1 / 70.0])
    prior = np.repeat([np.radians(0.5), 2.0], 3)
    arm, n = nodes - curved.surface.centroid_part, part.surface.normal(u, v)
    design = np.hstack([np.cross(arm, n), n]) * prior
    k = 0.25 * matern(cdist(nodes @ scaling, nodes @ scaling)) + design @ design.T + 0.01**2 * np.eye(60)
    alpha = np.linalg.solve(k, 0.3 * np.sin(nodes[:, 0] / 60.0)) if alpha is None else alpha
    motion = np.array([1e-3, -2e-3, 5e-4, 0.1, -0.2, 0.05]) if motion is None else motion
    return Field(curved, nodes, alpha, motion, 0.5, scaling, np.linalg.cholesky(k), design, prior)


@pytest.mark.parametrize("part", [CYLINDER, PLATE], ids=["cylinder", "plate"])
def test_the_gradient_is_that_of_the_displacement_along_the_surface(part):
    field = field_on(part)
    u, v = RNG.uniform(40, 260, 25), RNG.uniform(*(0.8 * np.array(part.surface.v) + 0.1 * sum(part.surface.v)), 25)
    at = part.surface.point(u, v)
    foot = field.curved.closest(at)
    _, g = field.on(foot.face, foot.bary)
    du, dv = part.surface.derivatives(u, v)
    for tangent in (du, dv):
        t = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
        h = 0.5
        values = []
        for sign in (1.0, -1.0):
            near = field.curved.closest(at + sign * h * t)
            values.append(field.on(near.face, near.bary)[0])
        difference = (values[0] - values[1]) / (2 * h)
        assert np.abs(difference - (g * t).sum(1)).max() < 2e-5
    assert np.abs((g * foot.normals).sum(1)).max() < 1e-12


def test_the_deviation_is_the_textbook_one():
    field = field_on(CYLINDER)
    around = samples_of(field.curved)
    rows = slice(0, 40)
    sd, slope = field.deviation(around.points[rows], around.normals[rows], around.shape[rows])
    arm = around.points[rows] - field.centre_part
    x = np.hstack([np.cross(arm, around.normals[rows]), around.normals[rows]]) * field.prior
    k = 0.25 * matern(cdist(around.points[rows] @ field.scaling, field.nodes_part @ field.scaling)) + x @ field.design.T
    full = field.lower @ field.lower.T
    expected = 0.25 + (x**2).sum(1) - np.einsum("ij,ij->i", k, np.linalg.solve(full, k.T).T)
    assert np.abs(sd**2 - expected).max() < 1e-9
    assert (slope > 0).all()


def test_the_deviation_of_the_slope_is_that_of_differences():
    """Var of (f(p + h t) - f(p - h t)) / 2h from the joint posterior of two points, on a plate."""
    field = field_on(PLATE)
    p = np.array([[100.0, 80.0, 0.0], [210.0, 120.0, 0.0]])
    n = np.tile([0.0, 0.0, 1.0], (2, 1))
    _, slope = field.deviation(p, n, np.zeros((2, 3, 3)))
    full, h = field.lower @ field.lower.T, 0.5
    for i in range(2):
        worst = 0.0
        for t in np.eye(3)[:2]:
            pair = np.stack([p[i] + h * t, p[i] - h * t])
            x = np.hstack([np.cross(pair - field.centre_part, n), n]) * field.prior
            k = 0.25 * matern(cdist(pair @ field.scaling, field.nodes_part @ field.scaling)) + x @ field.design.T
            own = 0.25 * matern(cdist(pair @ field.scaling, pair @ field.scaling)) + x @ x.T
            joint = own - k @ np.linalg.solve(full, k.T)
            worst = max(worst, float(np.array([1, -1]) @ joint @ np.array([1, -1])) / (2 * h) ** 2)
        assert slope[i] == pytest.approx(np.sqrt(worst), rel=2e-2)


def test_matern_is_the_closed_form_of_the_bessel_one():
    from scipy.special import gamma, kv  # noqa: PLC0415

    d = np.linspace(0.05, 4.0, 30)
    a = np.sqrt(5.0) * d
    assert np.allclose(matern(d), 2 ** (1 - 2.5) / gamma(2.5) * a**2.5 * kv(2.5, a), rtol=1e-10)


def test_derivatives_of_the_covariance_are_those_of_differences():
    fit, _, _ = measured(CYLINDER, cases.nothing, passes=3, spacing_mm=6.0)
    assert fit.field is None
    from alignment.non_rigid.nodes import gather  # noqa: PLC0415

    nodes = gather(fit.patches, fit.rows, fit.used, fit.T_base_part, cases.SETUP, 60)
    covariance = NodeCovariance(nodes, surface_axes(nodes.points_part))
    theta = np.log([0.01, 0.03, 20.0, 50.0, 0.002, 0.2, 90.0, 150.0])
    by = covariance.noise(theta)[1] + covariance.field(theta)[1]
    for i in range(8):
        up, down = theta.copy(), theta.copy()
        up[i] += 1e-4
        down[i] -= 1e-4
        difference = sum(s * (covariance.noise(t)[0] + covariance.field(t)[0]) for s, t in ((1, up), (-1, down))) / 2e-4
        assert np.abs(difference - by[i]).max() < 1e-3 * max(np.abs(by[i]).max(), 1e-9)


def test_the_displaced_plane_is_a_tilted_plane():
    """A motion of a plate as a field: the surface must be the moved plane, echoes and all."""
    tilt, lift = 0.02, 1.2
    field = field_on(PLATE, alpha=np.zeros(60), motion=np.array([0.0, tilt, 0.0, 0.0, 0.0, lift]))
    sprung = SprungSurface(field.curved, field)
    query = RNG.uniform([60, 40, 10], [240, 160, 20], (50, 3))
    foot = sprung.closest(query)
    # z = lift - tilt (x - 150)
    normal = np.array([tilt, 0.0, 1.0]) / np.hypot(tilt, 1.0)
    distance = (query - [150.0, 100.0, lift]) @ normal
    assert np.abs(foot.distance_mm - distance).max() < 1e-5
    assert np.abs(foot.normals - normal).max() < 1e-12
    assert np.abs((foot.points - [150.0, 100.0, lift]) @ normal).max() < 1e-5
    points, normals = sprung.evaluate(foot.face, foot.bary)
    assert np.abs((points - [150.0, 100.0, lift]) @ normal).max() < 1e-12
    assert np.abs(normals - normal).max() < 1e-12
    corners = sprung.surface.vertices
    assert np.abs((corners - [150.0, 100.0, lift]) @ normal).max() < 1e-9
