"""`adapt`: poses on a displaced surface, against the displaced surface as a formula."""

import numpy as np
import pytest

from planner.errors import EchoBaseError
from planner.path.adapt import adapt
from planner.path.decimate import decimate, deviation
from planner.path.raster import raster
from planner.setup import Setup
from planner.toolpath import Role
from tests.alignment.clouds import curved_of
from tests.loop.surfaces import cylinder

RADIUS, LENGTH = 300.0, 200.0
SURFACE = cylinder(RADIUS, LENGTH, 150.0)
AMPLITUDE, WAVE = 1.5, 60.0


class Ripple:
    """f = a sin(x / w) on the cylinder: a formula with its gradient."""

    def __init__(self, curved, scale=1.0):
        self.curved, self.scale = curved, scale

    def on(self, face, bary):
        p, _ = self.curved.evaluate(face, bary)
        f = self.scale * AMPLITUDE * np.sin(p[:, 0] / WAVE)
        g = np.zeros_like(p)
        g[:, 0] = self.scale * AMPLITUDE / WAVE * np.cos(p[:, 0] / WAVE)
        return f, g


@pytest.fixture(scope="module")
def made():
    curved = curved_of(SURFACE, 41, 31)
    path = raster(curved, Setup.model_validate({"inspection": {"strategy": "plane"}}))
    return curved, path, adapt(path, curved, Ripple(curved))


def test_data_poses_stand_square_on_the_displaced_surface(made):
    _, _, new = made
    data = new.take(new.is_data)
    tcp = data.Ts_part_tcp
    axes = data.Ts_part_contact.rotation_matrix
    foot = tcp.xyz_mm + data.standoff_mm[:, None] * tcp.rotation_matrix[:, :, 2]
    x, radial = foot[:, 0], np.hypot(foot[:, 1], foot[:, 2])
    assert np.abs(radial - RADIUS - AMPLITUDE * np.sin(x / WAVE)).max() < 5e-3
    across = np.column_stack([0 * x, foot[:, 1] / radial, foot[:, 2] / radial])
    normal = across - np.outer(AMPLITUDE / WAVE * np.cos(x / WAVE), [1.0, 0.0, 0.0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert np.degrees(np.linalg.norm(np.cross(axes[:, :, 2], normal), axis=1)).max() < 0.02
    assert np.abs(np.einsum("nij,nik->njk", axes, axes) - np.eye(3)).max() < 1e-12


def test_standoff_roles_and_heading_stay(made):
    _, path, new = made
    for name in ("standoff_mm", "heading", "pass_id", "role", "face", "bary"):
        assert np.array_equal(getattr(new, name), getattr(path, name))
    travel = new.Ts_part_contact.rotation_matrix[:, :, 0]
    old = path.Ts_part_contact.rotation_matrix[:, :, 0]
    assert (np.einsum("ij,ij->i", travel, old) > 0.999).all()


def test_approach_retract_and_leads_follow_without_a_kink(made):
    _, path, new = made
    above = np.isin(new.role, [Role.APPROACH, Role.RETRACT])
    side = np.where(new.role == Role.APPROACH, 1, -1)[above]
    lead = np.flatnonzero(above) + side
    rows = np.flatnonzero(above)
    assert np.allclose(new.Ts_part_contact.matrix[rows], new.Ts_part_contact.matrix[lead], atol=1e-9)
    for pass_id in range(new.passes):
        on = np.flatnonzero((new.pass_id == pass_id) & np.isin(new.role, [Role.LEAD_IN, Role.DATA, Role.LEAD_OUT]))
        p = new.Ts_part_contact.xyz_mm[on]
        z = new.Ts_part_contact.rotation_matrix[on][:, :, 2]
        turn = np.degrees(np.linalg.norm(np.diff(z, axis=0), axis=1))
        apart = np.linalg.norm(np.diff(p, axis=0), axis=1)
        assert turn.max() < 0.3
        assert apart.max() < 1.5 * np.linalg.norm(np.diff(path.Ts_part_contact.xyz_mm[on], axis=0), axis=1).max()


def test_links_stay_and_the_path_decimates(made):
    _, path, new = made
    link = path.role == Role.LINK
    assert np.array_equal(new.Ts_part_contact.matrix[link], path.Ts_part_contact.matrix[link])
    sparse = decimate(new)
    assert len(sparse) < len(new)
    chord_mm, chord_deg, spline_mm, spline_deg = deviation(new, sparse)
    assert max(chord_mm, spline_mm) <= 0.05
    assert max(chord_deg, spline_deg) <= 0.1


def test_nothing_changes_without_a_displacement(made):
    curved, path, _ = made
    same = adapt(path, curved, Ripple(curved, 0.0))
    assert np.abs(same.Ts_part_contact.matrix - path.Ts_part_contact.matrix).max() < 1e-9


def test_a_cliff_is_refused(made):
    curved, path, _ = made
    with pytest.raises(EchoBaseError) as refused:
        adapt(path, curved, Ripple(curved, 60.0))
    assert refused.value.issues[0].code == "adapt-field"
