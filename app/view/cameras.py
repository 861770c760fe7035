"""Standard views of an object in a box, z up, in metres."""

from dataclasses import dataclass

import numpy as np

from planner.frames import Array

VIEWS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "iso": ((-0.62, -0.75, 0.62), (0.0, 0.0, 1.0)),
    "front": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "back": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "left": ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "right": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "top": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "bottom": ((0.0, 0.0, -1.0), (0.0, -1.0, 0.0)),
}


@dataclass(frozen=True, eq=False)
class Sight:
    """A camera: position, look_at (m) and up, each (3,)."""

    position: Array
    look_at: Array
    up: Array


def sight(view: str, points_m: Array, fov_rad: float, aspect: float) -> Sight:
    """Return the camera of a standard view that just holds the points (n, 3), with a margin of about a tenth.

    Exact for a perspective camera: every point must lie inside the four side planes of the frustum.
    """
    direction, up_hint = (np.array(v, dtype=np.float64) for v in VIEWS[view])
    return towards(direction, up_hint, points_m, fov_rad, aspect)


def towards(direction: Array, up_hint: Array, points_m: Array, fov_rad: float, aspect: float) -> Sight:
    """Return the camera on the side `direction` (3,) of the points, looking at their middle."""
    back = direction / np.linalg.norm(direction)
    right = np.cross(up_hint, back)
    if np.linalg.norm(right) < 1e-6:
        right = np.cross([0.0, 1.0, 0.0] if abs(back[1]) < 0.9 else [1.0, 0.0, 0.0], back)
    right = right / np.linalg.norm(right)
    up = np.cross(back, right)
    middle = (points_m.min(axis=0) + points_m.max(axis=0)) / 2.0
    q = points_m - middle
    tan_y = np.tan(fov_rad / 2.0)
    tan_x = tan_y * max(aspect, 0.2)
    # Centre the picture: the middle of the box is not the middle of its image.
    middle = middle + right * (q @ right).min() / 2 + right * (q @ right).max() / 2
    middle = middle + up * (q @ up).min() / 2 + up * (q @ up).max() / 2
    q = points_m - middle
    depth = q @ back
    need = np.maximum(np.abs(q @ right) / tan_x, np.abs(q @ up) / tan_y) + depth
    distance = max(float(need.max()) * 1.12, 0.02)
    return Sight(middle + back * distance, middle, up)
