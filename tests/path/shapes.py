"""Surfaces of the path tests; their truth is in closed form."""

import numpy as np
from scipy.spatial import Delaunay

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


def drilled(
    length: float,
    width: float,
    holes: tuple[tuple[float, float, float], ...] = (),
    trims: tuple[tuple[float, float], ...] = (),
    radius: float | None = None,
    cell: float = 8.0,
) -> Panel:
    """A plate with round holes (x, y, radius), cut by lines (angle of their normal in deg, distance from the origin); bent
    about its long axis to a radius, if given. Triangles meet the rims exactly."""
    normals = [np.array([np.cos(a), np.sin(a)]) for a in np.radians([t[0] for t in trims])]
    corners = [np.array([length, width]), np.array([0.0, width]), np.zeros(2), np.array([length, 0.0])]
    for n, (_, d) in zip(normals, trims, strict=True):
        ring = []
        for p, q in zip(corners, corners[1:] + corners[:1], strict=True):
            a, b = float(p @ n) - d, float(q @ n) - d
            ring += [p] if a <= 0.0 else []
            ring += [p + (q - p) * a / (a - b)] if a * b < 0.0 else []
        corners = ring
    rim = [
        p + (q - p) * t
        for p, q in zip(corners, corners[1:] + corners[:1], strict=True)
        for t in np.arange(0.0, 1.0 - 1e-9, 1.0 / max(int(2.0 * np.linalg.norm(q - p) / cell), 1))
    ]
    for x, y, r in holes:
        t = np.linspace(0.0, 2.0 * np.pi, max(int(np.pi * r), 16), endpoint=False)
        rim += list(np.column_stack([x + r * np.cos(t), y + r * np.sin(t)]))
    gx, gy = np.meshgrid(np.arange(cell / 2.0, length, cell), np.arange(cell / 2.0, width, cell))
    grid = np.column_stack([gx.ravel(), gy.ravel()])

    def inside(p: np.ndarray, by: float) -> np.ndarray:
        ok = np.ones(len(p), dtype=bool)
        for n, (_, d) in zip(normals, trims, strict=True):
            ok &= p @ n < d - by
        for x, y, r in holes:
            ok &= np.hypot(p[:, 0] - x, p[:, 1] - y) > r * np.cos(np.pi / max(int(np.pi * r), 16)) + by
        return ok

    points = np.vstack([rim, grid[inside(grid, cell / 3.0)]])
    faces = Delaunay(points).simplices
    a, b, c = (points[faces[:, k]] for k in range(3))
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces[turn < 0.0] = faces[turn < 0.0][:, ::-1]
    faces = faces[(np.abs(turn) > 1e-6) & inside((a + b + c) / 3.0, -1e-9)]
    if radius is None:
        return Panel(
            "drilled",
            np.column_stack([points, np.zeros(len(points))]),
            faces,
            lambda p: np.tile([0, 0, 1.0], (len(p), 1)),
        )
    t = (points[:, 1] - width / 2.0) / radius
    bent = np.column_stack([points[:, 0], radius * np.sin(t), radius * np.cos(t)])
    return Panel("drilled", bent, faces, lambda p: p * [0, 1, 1] / np.linalg.norm(p * [0, 1, 1], axis=1, keepdims=True))


def rotated(panel: Panel, rotation: np.ndarray, shift: np.ndarray) -> Panel:
    def normals(p: np.ndarray) -> np.ndarray:
        return panel.normals((p - shift) @ rotation) @ rotation.T

    return Panel(panel.name, panel.vertices @ rotation.T + shift, panel.faces, normals, panel.direction_deg)


__all__ = ["crystal", "curved_of", "drilled", "ell", "flat", "plate", "rotated", "setup_of", "tangent"]
