"""The eight panels: 1.5 x 0.5 m analytic surfaces, tessellated well, badly, with holes, and closed."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.frames import Array
from planner.part import Part, Provenance
from planner.surface.inspection import InspectionSurface

LENGTH_MM, WIDTH_MM = 1500.0, 500.0
RADIUS_MM = 400.0
TUBE_RADIUS_MM, TUBE_LENGTH_MM = 100.0, 400.0


@dataclass(frozen=True, eq=False)
class Panel:
    """A tessellated surface; normals(points (n, 3)) -> (n, 3): of the true surface beside the points."""

    name: str
    vertices: Array
    faces: np.ndarray
    normals: Callable[[Array], Array]
    direction_deg: float = 0.0

    def surface(self) -> InspectionSurface:
        """Return the panel as an inspection surface."""
        used, inverse = np.unique(self.faces, return_inverse=True)
        faces = inverse.reshape(-1, 3).astype(np.int32)
        part = Part(np.ascontiguousarray(self.vertices[used]), faces, Provenance(self.name, "0" * 64, "mm"))
        return InspectionSurface(part, np.arange(len(faces), dtype=np.int32))


def flat_grid(u: Array, v: Array) -> tuple[Array, Array, np.ndarray]:
    """Return x, y (n,) of a grid over the panel at shares u, v (0..1), and its triangles (f, 3)."""
    x, y = np.meshgrid((u - 0.5) * LENGTH_MM, (v - 0.5) * WIDTH_MM, indexing="ij")
    i = np.arange(x.size).reshape(x.shape)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    return x.ravel(), y.ravel(), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def height_panel(
    name: str,
    z: Callable[[Array, Array], Array],
    slope: Callable[[Array, Array], tuple[Array, Array]],
    u: Array,
    v: Array,
    jitter: float = 0.0,
    direction_deg: float = 0.0,
) -> Panel:
    """Return the panel z(x, y) with the gradient given; jitter: inner vertices moved by up to this share of a cell."""
    x, y, faces = flat_grid(u, v)
    if jitter:
        rng = np.random.default_rng(7)
        inner = (np.abs(x) < LENGTH_MM / 2 - 1e-6) & (np.abs(y) < WIDTH_MM / 2 - 1e-6)
        x = x + inner * rng.uniform(-jitter, jitter, len(x)) * LENGTH_MM / len(u)
        y = y + inner * rng.uniform(-jitter, jitter, len(y)) * WIDTH_MM / len(v)

    def normals(p: Array) -> Array:
        zx, zy = slope(p[:, 0], p[:, 1])
        n = np.stack([-zx, -zy, np.ones(len(p))], axis=1)
        return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))

    return Panel(name, np.stack([x, y, z(x, y)], axis=1), faces, normals, direction_deg)


def double_z(x: Array, y: Array) -> Array:
    """Height of the double-curved panel (mm)."""
    return -(x**2) / 4000.0 - y**2 / 1600.0


def double_slope(x: Array, y: Array) -> tuple[Array, Array]:
    """Gradient of `double_z`."""
    return -x / 2000.0, -y / 800.0


def twist_z(x: Array, y: Array) -> Array:
    """Height of the panel twisted by +-10.6 deg (mm)."""
    return 0.25e-3 * x * y


def twist_slope(x: Array, y: Array) -> tuple[Array, Array]:
    """Gradient of `twist_z`."""
    return 0.25e-3 * y, 0.25e-3 * x


def cylinder(nu: int, nv: int) -> Panel:
    """Return the panel bent to a radius of 400 mm; its width is measured on the surface."""
    x, y, faces = flat_grid(np.linspace(0, 1, nu), np.linspace(0, 1, nv))
    a = y / RADIUS_MM

    def normals(p: Array) -> Array:
        n = p * [0.0, 1.0, 1.0]
        return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))

    return Panel("cylinder R 400", np.stack([x, RADIUS_MM * np.sin(a), RADIUS_MM * np.cos(a)], 1), faces, normals)


def tube(around: int, along: int) -> Panel:
    """Return a closed tube, radius 100 mm, 400 mm long, open at both ends."""
    t, x = np.meshgrid(
        np.linspace(0.0, 2.0 * np.pi, around, endpoint=False), np.linspace(0.0, TUBE_LENGTH_MM, along), indexing="ij"
    )
    vertices = np.stack([x, TUBE_RADIUS_MM * np.cos(t), TUBE_RADIUS_MM * np.sin(t)], axis=-1).reshape(-1, 3)
    i = np.arange(t.size).reshape(t.shape)
    j = np.roll(i, -1, axis=0)
    a, b, c, d = i[:, :-1].ravel(), i[:, 1:].ravel(), j[:, 1:].ravel(), j[:, :-1].ravel()
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])

    def normals(p: Array) -> Array:
        n = p * [0.0, 1.0, 1.0]
        return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))

    return Panel("closed tube", vertices, faces, normals)


def with_holes(panel: Panel, holes: tuple[tuple[float, float, float], ...], name: str) -> Panel:
    """Return the panel without the triangles whose centres lie in the holes (x, y, radius)."""
    centre = panel.vertices[panel.faces].mean(axis=1)
    keep = np.ones(len(centre), dtype=bool)
    for x, y, r in holes:
        keep &= np.hypot(centre[:, 0] - x, centre[:, 1] - y) > r
    return Panel(name, panel.vertices, panel.faces[keep], panel.normals, panel.direction_deg)


def panels(nu: int = 551, nv: int = 185) -> list[Panel]:
    """Return the eight panels, about 2 nu nv triangles each."""
    u, v = np.linspace(0.0, 1.0, nu), np.linspace(0.0, 1.0, nv)
    double = height_panel("double-curved, long lines", double_z, double_slope, u, v)
    return [
        height_panel("double-curved, short lines", double_z, double_slope, u, v, direction_deg=90.0),
        double,
        height_panel("twist", twist_z, twist_slope, u, v),
        height_panel("twist, irregular mesh", twist_z, twist_slope, u, v, jitter=0.3),
        cylinder(nu, nv),
        with_holes(double, ((-300.0, 50.0, 60.0), (400.0, -80.0, 90.0)), "two holes"),
        height_panel("uneven vertices along x", double_z, double_slope, u**3, v),
        tube(2 * nv, nu // 4),
    ]
