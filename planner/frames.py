"""Frames and transforms that know their names.

`T_dst_src` maps coordinates from `src` to `dst` (`p_dst = T_dst_src @ p_src`) and is the pose of `src` in `dst`.
Neighbouring names cancel: `T_world_tcp = T_world_base @ T_base_tcp`; anything else raises.
KUKA A, B, C turn about Z, the new Y and the newest X: `Rotation.from_euler("ZYX", [A, B, C], degrees=True)`.
Quaternions are wxyz. Lengths are mm.
"""

from dataclasses import dataclass
from typing import Any, Literal, Self, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import RigidTransform, Rotation

Array = NDArray[np.float64]
Frame = Literal["world", "robroot", "flange", "tcp", "base", "basecorr", "part", "partnom", "scan", "contact"]
FRAMES: tuple[str, ...] = get_args(Frame)
AXES = ("x", "y", "z", "a", "b", "c")
DOF_NAMES = ("rx", "ry", "rz", "x", "y", "z")

# Beyond this |B| (deg) A and C turn about the same axis and only their sum or difference is defined.
GIMBAL_B_DEG = 89.999
# Axes that are orthonormal within this are taken as they are.
_ROUNDING = 1e-12


class FrameMismatchError(TypeError):
    """Two transforms, or a transform and its use, whose frame names do not meet: always a programming error."""


@dataclass(frozen=True)
class Transform:
    """A rigid transform (or a stack of n) from frame `src` to frame `dst`; a stack is named `Ts_dst_src`.

    `rigid` is scipy's RigidTransform, single or of length n. Proper rotations only: scipy cannot hold a reflection.
    """

    dst: Frame
    src: Frame
    rigid: RigidTransform

    def __post_init__(self) -> None:
        for name in (self.dst, self.src):
            if name not in FRAMES:
                raise FrameMismatchError(f"'{name}' is not a frame; frames are {', '.join(FRAMES)}")

    @classmethod
    def identity(cls, dst: Frame, src: Frame) -> Self:
        """Return the transform that changes nothing but the name."""
        return cls(dst, src, RigidTransform.identity())

    @classmethod
    def from_matrix(cls, dst: Frame, src: Frame, matrix: ArrayLike) -> Self:
        """Return the transform of a (4, 4) or (n, 4, 4) matrix; raise ValueError if it is not finite and rigid."""
        m = np.asarray(matrix, dtype=np.float64)
        r = m[..., :3, :3]
        off = np.abs(r @ np.swapaxes(r, -1, -2) - np.eye(3)).max(initial=0.0)
        if not np.isfinite(m).all() or off > 1e-6 or (np.linalg.det(r) < 0).any():
            raise ValueError("not a proper rigid transform: the rotation part is not orthonormal with determinant +1")
        return cls(dst, src, RigidTransform.from_matrix(m))

    @classmethod
    def from_parts(cls, dst: Frame, src: Frame, rotation: Rotation, xyz_mm: ArrayLike) -> Self:
        """Return the transform with this scipy rotation and translation (3,) or (n, 3), mm."""
        return cls(dst, src, RigidTransform.from_components(np.asarray(xyz_mm, dtype=np.float64), rotation))

    @classmethod
    def from_axes(cls, dst: Frame, src: Frame, x: Array, y: Array, z: Array, origin_mm: Array) -> Self:
        """Return the transform whose src axes x, y, z (each (3,) or (n, 3), orthonormal) and origin are given in dst."""
        x, y, z, origin = (np.asarray(a, dtype=np.float64) for a in (x, y, z, origin_mm))
        matrix = np.zeros((*np.broadcast_shapes(x.shape, origin.shape)[:-1], 4, 4))
        matrix[..., :3, 0], matrix[..., :3, 1], matrix[..., :3, 2] = x, y, z
        matrix[..., :3, 3], matrix[..., 3, 3] = origin, 1.0
        if _orthonormal(x, y, z):
            return cls(dst, src, RigidTransform(matrix, normalize=False, copy=False))
        return cls.from_parts(dst, src, Rotation.from_matrix(matrix[..., :3, :3]), origin)

    @classmethod
    def from_xyzabc(cls, dst: Frame, src: Frame, xyzabc: ArrayLike) -> Self:
        """Return the transform of KUKA X Y Z (mm) A B C (deg), shape (6,) or (n, 6)."""
        v = np.asarray(xyzabc, dtype=np.float64)
        return cls.from_parts(dst, src, Rotation.from_euler("ZYX", v[..., 3:], degrees=True), v[..., :3])

    @classmethod
    def from_xyz_wxyz(cls, dst: Frame, src: Frame, xyz_mm: ArrayLike, wxyz: ArrayLike) -> Self:
        """Return the transform of translation (mm) and quaternion wxyz, single or stacked."""
        return cls.from_parts(dst, src, Rotation.from_quat(np.asarray(wxyz), scalar_first=True), xyz_mm)

    @classmethod
    def from_exp(cls, dst: Frame, src: Frame, xi: ArrayLike) -> Self:
        """Return Exp(xi) of SE(3), xi = (rx, ry, rz, x, y, z) in rad and mm, shape (6,) or (n, 6)."""
        return cls(dst, src, RigidTransform.from_exp_coords(np.asarray(xi, dtype=np.float64)))

    def __matmul__(self, other: "Transform") -> "Transform":
        if not isinstance(other, Transform):
            return NotImplemented
        if self.src != other.dst:
            raise FrameMismatchError(
                f"T_{self.dst}_{self.src} @ T_{other.dst}_{other.src}: '{self.src}' and '{other.dst}' do not meet"
            )
        return Transform(self.dst, other.src, self.rigid * other.rigid)

    def inv(self) -> "Transform":
        """Return the inverse, `T_src_dst`."""
        return Transform(self.src, self.dst, self.rigid.inv())

    def points(self, p_src: ArrayLike) -> Array:
        """Map points (n, 3) or (3,) from src to dst; a stack maps its i-th point by its i-th transform."""
        p = np.asarray(p_src, dtype=np.float64)
        r = self.rotation_matrix
        if r.ndim == 2:
            return p @ r.T + self.xyz_mm
        return np.einsum("...ij,...j->...i", r, p) + self.xyz_mm

    def directions(self, v_src: ArrayLike) -> Array:
        """Map directions (n, 3) or (3,) from src to dst: rotated, not moved."""
        v = np.asarray(v_src, dtype=np.float64)
        r = self.rotation_matrix
        return v @ r.T if r.ndim == 2 else np.einsum("...ij,...j->...i", r, v)

    @property
    def is_stack(self) -> bool:
        """True for `Ts_dst_src`."""
        return not self.rigid.single

    def __len__(self) -> int:
        return len(self.rigid)

    def __getitem__(self, index: Any) -> "Transform":
        return Transform(self.dst, self.src, self.rigid[index])

    @property
    def matrix(self) -> Array:
        """The (4, 4) or (n, 4, 4) homogeneous matrix."""
        return np.asarray(self.rigid.as_matrix())

    @property
    def rotation(self) -> Rotation:
        """The scipy rotation."""
        return self.rigid.rotation

    @property
    def rotation_matrix(self) -> Array:
        """The (3, 3) or (n, 3, 3) rotation matrix; its columns are the src axes seen in dst."""
        return np.ascontiguousarray(self.rigid.as_matrix()[..., :3, :3])

    @property
    def xyz_mm(self) -> Array:
        """The origin of src in dst, (3,) or (n, 3), mm."""
        return np.asarray(self.rigid.translation)

    @property
    def wxyz(self) -> Array:
        """The quaternion, scalar first, (4,) or (n, 4)."""
        return np.asarray(self.rigid.rotation.as_quat(scalar_first=True))

    @property
    def xyzabc(self) -> Array:
        """KUKA X Y Z (mm) A B C (deg), (6,) or (n, 6). Near B = +-90 the turn goes to A and C is 0."""
        return np.concatenate([self.xyz_mm, abc_deg(self.rotation_matrix)], axis=-1)

    @property
    def exp(self) -> Array:
        """The logarithm (rx, ry, rz, x, y, z), rad and mm, (6,) or (n, 6)."""
        return np.asarray(self.rigid.as_exp_coords())

    def angle_deg(self) -> Array:
        """Return the total rotation angle, deg."""
        return np.degrees(self.rigid.rotation.magnitude())

    def renamed(self, dst: Frame, src: Frame) -> "Transform":
        """Return the same numbers under other names. Only `planner.placement` may call it, and says why."""
        return Transform(dst, src, self.rigid)


def _orthonormal(x: Array, y: Array, z: Array) -> bool:
    """Return whether axes (..., 3) are right-handed and orthonormal within rounding, so that nothing needs repair."""
    if not x.size:
        return True
    unit = (np.einsum("...i,...i->...", a, a) - 1.0 for a in (x, y, z))
    square = (np.einsum("...i,...i->...", a, b) for a, b in ((x, y), (y, z), (z, x)))
    if max(float(np.abs(gap).max()) for gap in (*unit, *square)) > _ROUNDING:
        return False
    (x0, x1, x2), (y0, y1, y2) = np.moveaxis(x, -1, 0), np.moveaxis(y, -1, 0)
    z0, z1, z2 = np.moveaxis(z, -1, 0)
    return bool(((x1 * y2 - x2 * y1) * z0 + (x2 * y0 - x0 * y2) * z1 + (x0 * y1 - x1 * y0) * z2 > 0.0).all())


def abc_deg(rotation: ArrayLike) -> Array:
    """Return KUKA A, B, C in degrees, each in (-180, 180], of rotation matrices (..., 3, 3).

    Within 0.001 deg of B = +-90 only A - C (or A + C) is defined: C is set to 0. Compare rotations there, never triples.
    """
    r = np.asarray(rotation, dtype=np.float64)
    cos_b = np.hypot(r[..., 0, 0], r[..., 1, 0])
    b = np.arctan2(-r[..., 2, 0], cos_b)
    gimbal = np.abs(b) > np.radians(GIMBAL_B_DEG)
    a = np.where(gimbal, np.arctan2(-r[..., 0, 1], r[..., 1, 1]), np.arctan2(r[..., 1, 0], r[..., 0, 0]))
    c = np.where(gimbal, 0.0, np.arctan2(r[..., 2, 1], r[..., 2, 2]))
    abc = np.degrees(np.stack([a, b, c], axis=-1))
    abc = np.where(abc <= -180.0, abc + 360.0, abc)
    return abc + 0.0  # turns -0.0 into 0.0
