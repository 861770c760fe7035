"""What the ultrasound sees along the data poses: tilt, standoff, and the surface's curvature under the aperture."""

from dataclasses import dataclass

import numpy as np
from scipy.special import fresnel

from planner.couplant import sound_speed_m_s
from planner.frames import Array
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.toolpath import ToolPath


@dataclass(frozen=True, eq=False)
class Seen:
    """Per pose (n,), NaN where no data are taken or the foot lies on the boundary of the surface.

    tilt_deg: angle between beam and surface normal at the foot of the TCP. standoff_mm: distance of the TCP from the
    surface. curvature_loss_db: echo lost to the bend of the surface under the active aperture. sagitta_mm: that bend, the
    larger of both aperture axes. effective_swath_mm: width over which a law's own tilt stays inside the tolerance.
    """

    tilt_deg: Array
    standoff_mm: Array
    curvature_loss_db: Array
    sagitta_mm: Array
    effective_swath_mm: Array


def seen(curved: CurvedSurface, path: ToolPath, setup: Setup) -> Seen:
    """Return what the probe sees at each pose of the path."""
    n = len(path)
    tilt, standoff, loss, sagitta, swath = (np.full(n, np.nan) for _ in range(5))
    rows = np.flatnonzero(path.is_data)
    if len(rows):
        poses = path.Ts_part_tcp[rows]
        foot = curved.closest(poses.xyz_mm)
        on = foot.interior
        rows, axes = rows[on], poses.rotation_matrix[on]
        normals = foot.normals[on]
        standoff[rows] = foot.distance_mm[on]
        tilt[rows] = angle_deg(-axes[:, :, 2], normals)
        shape = curved.shape_operator(foot.face[on], foot.bary[on])
        loss[rows], sagitta[rows], swath[rows] = _curvature(shape, axes, setup)
    return Seen(tilt, standoff, loss, sagitta, swath)


def angle_deg(u: Array, v: Array) -> Array:
    """Return the angle between unit vectors (n, 3) and (n, 3), deg, accurate near 0."""
    return np.degrees(2.0 * np.arctan2(np.linalg.norm(u - v, axis=1), np.linalg.norm(u + v, axis=1)))


def _curvature(shape: Array, axes: Array, setup: Setup) -> tuple[Array, Array, Array]:
    probe = setup.probe
    x, y = axes[:, :, 0], axes[:, :, 1]
    along = np.einsum("ni,nij,nj->n", x, shape, x)
    across = np.einsum("ni,nij,nj->n", y, shape, y)
    single = probe.elements == 1
    width_x = probe.elevation_mm if single else probe.aperture_elements * probe.pitch_mm
    wavelength_mm = sound_speed_m_s(setup.couplant) * 1e-3 / probe.frequency_mhz
    sag_x, sag_y = np.abs(along) * (width_x / 2.0) ** 2 / 2.0, np.abs(across) * (probe.elevation_mm / 2.0) ** 2 / 2.0
    loss = bend_loss_db(sag_x, wavelength_mm) + bend_loss_db(sag_y, wavelength_mm)
    # A law at x on the array axis stands x W_x off the normal of the centre: its tilt is x |W x_axis|.
    rate_deg_mm = np.degrees(np.linalg.norm(np.einsum("nij,nj->ni", shape, x), axis=1))
    half = np.full(len(x), probe.swath_mm / 2.0)
    turning = rate_deg_mm * half > setup.tolerances.tilt_deg
    half[turning] = setup.tolerances.tilt_deg / rate_deg_mm[turning]
    return loss, np.maximum(sag_x, sag_y), 2.0 * half


def bend_loss_db(sagitta_mm: Array, wavelength_mm: float) -> Array:
    """Return the echo lost (dB, positive) when the reflector bends by `sagitta_mm` from middle to end of an aperture.

    The two-way path differs by twice the sagitta at the ends and grows with the square of the distance from the middle;
    the sum over the aperture is a Fresnel integral: |C(u) + i S(u)| / u with u^2 = 8 sagitta / wavelength (Born and Wolf,
    Principles of Optics, 7th ed. 1999, section 8.7).
    """
    u = np.sqrt(8.0 * np.maximum(sagitta_mm, 0.0) / wavelength_mm)
    s, c = fresnel(u)
    ratio = np.divide(np.hypot(s, c), u, out=np.ones_like(u), where=u > 1e-6)
    return np.asarray(-20.0 * np.log10(np.minimum(ratio, 1.0)) + 0.0)
