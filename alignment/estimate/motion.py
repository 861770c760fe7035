"""Small motions about a centre: how the unknown of the alignment moves the part, and what it means in X Y Z A B C.

A motion xi = (rx, ry, rz, x, y, z), rad and mm, axes of `base`, acts about the centre c (3,), mm in `base`:
T_new = Tr(c) Exp(xi) Tr(-c) T. The six-vector is rotation first, Exp is that of SE(3).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from planner.frames import Array, Transform


def moved(T_base_part: Transform, xi: Array, centre_mm: Array) -> Transform:
    """Return the placement after the motion xi about the centre."""
    # In matrices: composing scipy's transforms, which are made orthonormal each time, is most of what a step would cost.
    step = RigidTransform.from_exp_coords(np.asarray(xi, dtype=np.float64)).as_matrix()
    step[:3, 3] += centre_mm - step[:3, :3] @ centre_mm
    return Transform(T_base_part.dst, T_base_part.src, _rigid(step @ T_base_part.matrix))


def motion_between(T_base_old: Transform, T_base_new: Transform, centre_mm: Array) -> Array:
    """Return the xi (6,) that moves the old placement to the new one about the centre."""
    step = T_base_new.matrix @ T_base_old.inv().matrix
    step[:3, 3] += step[:3, :3] @ centre_mm - centre_mm
    return np.asarray(_rigid(step).as_exp_coords())


def _rigid(matrix: Array) -> RigidTransform:
    return RigidTransform(matrix, normalize=False, copy=False)


def motion_rows(points_base: Array, directions_base: Array, centre_mm: Array) -> Array:
    """Return rows (n, 6) with row . xi = displacement of points (n, 3) along directions (n, 3), to first order."""
    return np.hstack([np.cross(points_base - centre_mm, directions_base), directions_base])


def named_axes(T_base_basecorr: Transform, centre_mm: Array) -> Array:
    """Return M (6, 6): change of (x, y, z, a, b, c) (mm, rad) of the correction per xi about the centre.

    Translations are those of the origin of `basecorr`; angles follow from w = a' ez + b' Rz ey + c' Rz Ry ex.
    """
    m = np.zeros((6, 6))
    arm = T_base_basecorr.xyz_mm - centre_mm
    m[:3, :3] = -_cross_matrix(arm)
    m[:3, 3:] = np.eye(3)
    a, b, _ = np.radians(T_base_basecorr.xyzabc[3:])
    rz, rzy = Rotation.from_euler("Z", a), Rotation.from_euler("ZY", [a, b])
    turns = np.stack([[0.0, 0.0, 1.0], rz.apply([0.0, 1.0, 0.0]), rzy.apply([1.0, 0.0, 0.0])], axis=1)
    m[3:, :3] = np.linalg.inv(turns)
    return m


def _cross_matrix(v: Array) -> Array:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def area_moments(vertices: Array, faces: NDArray[np.int32], areas: Array) -> Array:
    """Return the second moment (3, 3) of a triangulated area about its centroid, mm2 (per unit area)."""
    share = areas / areas.sum()
    corners = np.ascontiguousarray(faces.T)
    third = np.stack([sum(x.take(c) for c in corners) / 3.0 for x in np.ascontiguousarray(vertices.T)])
    centre = third @ share
    # Exact for a triangle: (sum of corner products + sum of corners, multiplied) / 12. The first sum goes by corners.
    at_vertex = sum((np.bincount(c, share, len(vertices)) for c in corners), np.zeros(len(vertices)))
    d, total = vertices - centre, third - centre[:, None]
    return np.asarray(((at_vertex[:, None] * d).T @ d + 9.0 * (share * total) @ total.T) / 12.0)


def rms_displacement_mm(xi: Array, moments_base: Array) -> float:
    """Return the root mean square displacement over the area of a motion about its centroid: |v|^2 + w'(tr S I - S) w."""
    w, v = xi[:3], xi[3:]
    turning = np.trace(moments_base) * np.eye(3) - moments_base
    return float(np.sqrt(v @ v + w @ turning @ w))
