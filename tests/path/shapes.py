"""Surfaces of the path tests; their truth is in closed form."""

import numpy as np

from benchmarks.planning.panels import Panel
from planner.path.cut import tangent
from planner.setup import Setup
from planner.surface.curved import CurvedSurface, footprint_mm


def curved_of(panel: Panel, setup: Setup | None = None) -> CurvedSurface:
    return CurvedSurface(panel.surface(), footprint_mm((setup or Setup()).probe))


def setup_of(**inspection: object) -> Setup:
    return Setup.model_validate({"inspection": inspection})


def crystal(**inspection: object) -> Setup:
    return Setup.model_validate({"probe": {"elements": 1}, "inspection": {"step_mm": 2.0, **inspection}})


def flat(corners: list[tuple[float, float]], faces: list[tuple[int, int, int]], name: str = "flat") -> Panel:
    """A flat surface facing +Z from a few corners: the coarse triangles a STEP file gives."""
    v = np.array([[x, y, 0.0] for x, y in corners])
    return Panel(name, v, np.array(faces), lambda p: np.tile([0.0, 0.0, 1.0], (len(p), 1)))


def plate(length: float = 150.0, width: float = 100.0) -> Panel:
    return flat([(0, 0), (length, 0), (length, width), (0, width)], [(0, 1, 2), (0, 2, 3)], "plate")


def ell() -> Panel:
    """An L of 400 x 400 mm with arms 120 and 150 mm wide: 9.6 dm2, six corners, four triangles."""
    corners = [(0, 0), (400, 0), (400, 150), (120, 150), (120, 400), (0, 400)]
    return flat(corners, [(0, 3, 4), (0, 4, 5), (0, 1, 3), (1, 2, 3)], "L")


def rotated(panel: Panel, rotation: np.ndarray, shift: np.ndarray) -> Panel:
    def normals(p: np.ndarray) -> np.ndarray:
        return panel.normals((p - shift) @ rotation) @ rotation.T

    return Panel(panel.name, panel.vertices @ rotation.T + shift, panel.faces, normals, panel.direction_deg)


__all__ = ["crystal", "curved_of", "ell", "flat", "plate", "rotated", "setup_of", "tangent"]
