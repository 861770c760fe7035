"""Where the probe is on a path, in numbers."""

from typing import Any

import numpy as np

from app.view.draw_paths import role_name
from planner.frames import Transform
from planner.placement import assume_nominal
from planner.setup import Setup
from planner.toolpath import ToolPath


def probe_index(path: ToolPath, at: float) -> int:
    """Return the pose at a share of the path."""
    return int(np.clip(round(at * (len(path) - 1)), 0, len(path) - 1))


def probe_facts(path: ToolPath, index: int, setup: Setup, name: str) -> tuple[Transform, dict[str, Any]]:
    """Return T_part_tcp of a pose, and its numbers: pass, pose, role, X Y Z A B C in base, standoff, length so far."""
    T_part_tcp = path.Ts_part_tcp[index]
    T_base_tcp = assume_nominal(setup.T_base_partnom) @ T_part_tcp
    xyz = path.Ts_part_tcp.xyz_mm
    length = np.linalg.norm(np.diff(xyz, axis=0), axis=1)
    facts: dict[str, Any] = {
        "path": name,
        "pose": index + 1,
        "poses": len(path),
        "pass": int(path.pass_id[index]) + 1,
        "passes": path.passes,
        "role": role_name(int(path.role[index])),
        "standoff_mm": float(path.standoff_mm[index]),
        "travelled_mm": float(length[:index].sum()),
        "length_mm": float(length.sum()),
    }
    facts |= dict(zip(("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"), map(float, T_base_tcp.xyzabc), strict=True))
    return T_part_tcp, facts
