"""Synthetic tool paths of known geometry: plane, wave, cylinder; written without the planner."""

import numpy as np

from planner.frames import Array, Transform
from planner.setup import Setup
from planner.toolpath import PathKind, Role, ToolPath

TAUGHT = {
    "base": {"number": 3, "x_mm": 900.0, "y_mm": -120.0, "z_mm": 410.0, "a_deg": 12.0, "b_deg": -1.5, "c_deg": 0.7},
    "placement": {"x_mm": 40.0, "y_mm": -25.0, "z_mm": 8.0, "a_deg": 4.0, "b_deg": 1.0, "c_deg": -2.0},
    "tool": {"number": 5, "tcp": {"x_mm": 5.0, "y_mm": -3.0, "z_mm": 210.0, "a_deg": 90.0}},
    "inspection": {"scan_speed_mm_s": 80},
}
UNTAUGHT = {**TAUGHT, "base": {"number": 3}}
CORRECTION = (1.1, -0.7, 1.0, 0.2, -0.8, 0.5)


def setup(controller: str = "krc4", taught: bool = True, **more: object) -> Setup:
    return Setup.model_validate({**(TAUGHT if taught else UNTAUGHT), "controller": controller, **more})


def correction(numbers: tuple[float, ...] = CORRECTION) -> Transform:
    return Transform.from_xyzabc("base", "basecorr", numbers)


def from_arrays(
    kind: PathKind, points: Array, normals: Array, travel: Array, role: Array, pass_id: Array, heading: Array
) -> ToolPath:
    n = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    x = travel - (travel * n).sum(axis=1, keepdims=True) * n
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    contact = Transform.from_axes("part", "contact", x, np.cross(n, x), n, points)
    high = np.isin(role, (Role.APPROACH, Role.RETRACT, Role.LINK))
    m = len(points)
    return ToolPath(
        kind, contact, np.where(high, 65.0, 15.0), heading.astype(np.int8), pass_id.astype(np.int32), role.astype(np.uint8),
        np.zeros(m, dtype=np.int32), np.tile([1.0, 0.0, 0.0], (m, 1)),
    )  # fmt: skip


def raster(
    kind: PathKind = "inspection", data: int = 12, passes: int = 3, step: float = 8.0, wave: float = 0.0, link: int = 0
) -> ToolPath:
    """Forth-and-back passes over z = wave sin(x / 60); each with approach, lead-in, data, lead-out, retract, `link` poses."""
    roles = [Role.APPROACH, Role.LEAD_IN] + [Role.DATA] * data + [Role.LEAD_OUT, Role.RETRACT] + [Role.LINK] * link
    along = np.concatenate(
        [
            [-10.0, -10.0],
            np.arange(data) * step,
            [(data - 1) * step + 10.0] * 2,
            (data - 1) * step + 10.0 + 3.0 * np.arange(1, link + 1),
        ]
    )
    points, normals, travel = [], [], []
    for k in range(passes):
        way = 1.0 if k % 2 == 0 else -1.0
        x = along if way > 0 else (data - 1) * step - along
        slope = wave / 60.0 * np.cos(x / 60.0)
        points.append(np.stack([x, np.full_like(x, 20.0 * k), wave * np.sin(x / 60.0)], axis=1))
        normals.append(np.stack([-slope, 0.0 * x, 1.0 + 0.0 * x], axis=1))
        travel.append(way * np.stack([1.0 + 0.0 * x, 0.0 * x, slope], axis=1))
    m = len(roles)
    heading = np.repeat([1 if k % 2 == 0 else -1 for k in range(passes)], m)
    return from_arrays(
        kind, np.concatenate(points), np.concatenate(normals), np.concatenate(travel), np.tile([int(r) for r in roles], passes),
        np.repeat(np.arange(passes), m), heading,
    )  # fmt: skip


def cylinder(kind: PathKind = "inspection", radius: float = 150.0, data: int = 15, passes: int = 4) -> ToolPath:
    """Passes around a cylinder along y: the beam turns by 80 deg along each of them."""
    roles = [Role.APPROACH, Role.LEAD_IN] + [Role.DATA] * data + [Role.LEAD_OUT, Role.RETRACT]
    swing = np.radians(np.concatenate([[-46.0, -46.0], np.linspace(-40.0, 40.0, data), [46.0, 46.0]]))
    points, normals, travel = [], [], []
    for k in range(passes):
        t = swing if k % 2 == 0 else -swing
        n = np.stack([np.sin(t), 0.0 * t, np.cos(t)], axis=1)
        points.append(radius * n + np.array([0.0, 15.0 * k, 0.0]))
        normals.append(n)
        travel.append((1.0 if k % 2 == 0 else -1.0) * np.stack([np.cos(t), 0.0 * t, -np.sin(t)], axis=1))
    m = len(roles)
    heading = np.repeat([1 if k % 2 == 0 else -1 for k in range(passes)], m)
    return from_arrays(
        kind, np.concatenate(points), np.concatenate(normals), np.concatenate(travel), np.tile([int(r) for r in roles], passes),
        np.repeat(np.arange(passes), m), heading,
    )  # fmt: skip


PATHS = {"plane": raster(), "wave": raster("alignment", 20, 4, 6.0, 9.0, 3), "cylinder": cylinder()}
