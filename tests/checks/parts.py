"""Parts and paths of known shape for the checks."""

from collections.abc import Callable

import numpy as np

from planner.frames import Transform
from planner.part import Part, Provenance
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.inspection import InspectionSurface
from planner.toolpath import Role, ToolPath

Height = Callable[[np.ndarray, np.ndarray], np.ndarray]


def sheet(height: Height, x_mm: float = 300.0, y_mm: float = 200.0, step_mm: float = 5.0) -> Part:
    """Return the graph z = height(x, y) over a rectangle about the origin, outward up."""
    xs, ys = (np.linspace(-s / 2, s / 2, round(s / step_mm) + 1) for s in (x_mm, y_mm))
    x, y = (g.ravel() for g in np.meshgrid(xs, ys, indexing="ij"))
    vertices = np.column_stack([x, y, height(x, y) + 0.0 * x])
    m = len(ys)
    i = np.arange((len(xs) - 1) * m).reshape(-1, m)[:, :-1].ravel()
    faces = np.vstack([np.column_stack([i, i + m, i + m + 1]), np.column_stack([i, i + m + 1, i + 1])])
    return Part(vertices, faces.astype(np.int32), Provenance("sheet", "0" * 64, "mm"))


def with_block(part: Part, low: tuple[float, float, float], high: tuple[float, float, float]) -> Part:
    """Return the part with a closed box added."""
    corners = np.array([[(low, high)[b >> k & 1][k] for k in range(3)] for b in range(8)], dtype=float)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    box = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], dtype=np.int32)
    faces = np.vstack([part.faces, box + len(part.vertices)]).astype(np.int32)
    return Part(np.vstack([part.vertices, corners]), faces, part.provenance)


def curved(part: Part, faces: int | None = None) -> CurvedSurface:
    """Return the smooth surface of the first `faces` triangles (default all)."""
    count = len(part.faces) if faces is None else faces
    return CurvedSurface(InspectionSurface(part, np.arange(count, dtype=np.int32)), 4.5)


def path_on(
    surface: CurvedSurface,
    height: Height,
    setup: Setup,
    kind: str = "inspection",
    rows: tuple[float, ...] = (-30.0, 0.0, 30.0),
    half_mm: float = 100.0,
    spacing_mm: float = 8.0,
    lift_mm: float = 60.0,
) -> ToolPath:
    """Return straight passes along x at the given y, over the surface, with approach, lead-in, lead-out and retract."""
    standoff = setup.alignment_standoff_mm if kind == "alignment" else setup.standoff_mm
    x = np.linspace(-half_mm, half_mm, round(2 * half_mm / spacing_mm) + 1)
    parts = []
    for k, y in enumerate(rows):
        at = x if k % 2 == 0 else x[::-1]
        foot = surface.closest(np.column_stack([at, np.full_like(at, y), height(at, np.full_like(at, y)) + 0 * at]))
        along = np.gradient(foot.points, axis=0)
        along -= (along * foot.normals).sum(axis=1, keepdims=True) * foot.normals
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        i = np.r_[0, np.arange(len(at)), len(at) - 1]
        role = np.r_[Role.APPROACH, Role.LEAD_IN, np.full(len(at) - 2, Role.DATA), Role.LEAD_OUT, Role.RETRACT]
        off = np.where((role == Role.APPROACH) | (role == Role.RETRACT), standoff + lift_mm, standoff)
        side = np.full(len(i), 1 if k % 2 == 0 else -1)
        parts.append(
            (foot.points[i], foot.normals[i], along[i], off, side, np.full(len(i), k), role, foot.face[i], foot.bary[i])
        )
    p, n, t, off, side, pass_id, role, face, bary = (np.concatenate(column) for column in zip(*parts, strict=True))
    contact = Transform.from_axes("part", "contact", t, np.cross(n, t), n, p)
    return ToolPath(
        kind,
        contact,
        off.astype(float),
        side.astype(np.int8),
        pass_id.astype(np.int32),
        role.astype(np.uint8),
        face.astype(np.int32),
        bary,
    )


def surface_samples(part: Part, spacing_mm: float) -> np.ndarray:
    """Return points (k, 3) on all triangles, none farther from the next than about the spacing."""
    a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
    longest = max(np.linalg.norm(u - v, axis=1).max() for u, v in ((a, b), (b, c), (c, a)))
    n = int(np.ceil(longest / spacing_mm)) + 1
    u, v = (g.ravel() for g in np.meshgrid(np.arange(n + 1) / n, np.arange(n + 1) / n))
    inside = u + v <= 1.0 + 1e-12
    u, v = u[inside], v[inside]
    points = a[:, None] + u[None, :, None] * (b - a)[:, None] + v[None, :, None] * (c - a)[:, None]
    return points.reshape(-1, 3)
