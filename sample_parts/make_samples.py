"""Make the sample parts: `python -m sample_parts.make_samples`. STEP needs cadquery, a tool for developers only.

The aerofoil skin is a polynomial in both directions, so that its STEP file (one Bezier patch) is the surface below exactly,
its STL is sampled from it, and tests can compare with the truth.
"""

import json
from collections.abc import Callable
from math import comb
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
HERE = Path(__file__).parent

PLATE_MM = (150.0, 100.0, 10.0)

SPAN_MM = 1500.0
THICKNESS_MM = 4.0
# The skin covers this part of the chord: neither nose nor trailing edge.
CHORD_FROM, CHORD_TO = 0.06, 0.97
ROOT_CHORD_MM, TIP_CHORD_MM = 440.0, 330.0
SWEEP_MM = 70.0
BEND_MM = 28.0
# Tangent of the twist about 30 % chord: TWIST[0] v + TWIST[1] v2, 4.9 deg at the tip.
TWIST = (0.060, 0.026)
TWIST_AXIS = 0.3
# Height over chord against u, lowest order first: the upper side of a cambered 12 % section, 7.9 % of the chord high.
SECTION = (0.0224, 0.4317, -1.1404, 1.3377, -0.885, 0.235)


def _chord_mm(v: Array) -> Array:
    return ROOT_CHORD_MM + (TIP_CHORD_MM - ROOT_CHORD_MM) * v


def aerofoil_point(u: ArrayLike, v: ArrayLike) -> Array:
    """Return points (..., 3), mm, of the outer skin at chord fraction u (0.06 to 0.97) and span fraction v (0 to 1)."""
    u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
    chord = _chord_mm(v)
    twist = TWIST[0] * v + TWIST[1] * v * v
    height = np.polynomial.polynomial.polyval(u, SECTION)
    z = chord * (height - (u - TWIST_AXIS) * twist) + BEND_MM * v * v
    return np.stack([SPAN_MM * v, SWEEP_MM * v + chord * u, z], axis=-1)


def aerofoil_uv(x_mm: ArrayLike, y_mm: ArrayLike) -> tuple[Array, Array]:
    """Return chord and span fractions u, v of the skin's point above x, y (mm)."""
    v = np.asarray(x_mm, dtype=np.float64) / SPAN_MM
    return (np.asarray(y_mm, dtype=np.float64) - SWEEP_MM * v) / _chord_mm(v), v


def aerofoil_normal(u: ArrayLike, v: ArrayLike) -> Array:
    """Return unit outward normals (..., 3) of the outer skin."""
    u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
    chord, slope = _chord_mm(v), TIP_CHORD_MM - ROOT_CHORD_MM
    twist, twist_v = TWIST[0] * v + TWIST[1] * v * v, TWIST[0] + 2.0 * TWIST[1] * v
    polynomial = np.polynomial.polynomial
    height, height_u = polynomial.polyval(u, SECTION), polynomial.polyval(u, polynomial.polyder(SECTION))
    along_u = np.stack([np.zeros_like(u), chord, chord * (height_u - twist)], axis=-1)
    z_v = slope * (height - (u - TWIST_AXIS) * twist) - chord * (u - TWIST_AXIS) * twist_v + 2.0 * BEND_MM * v
    along_v = np.stack([np.full_like(u, SPAN_MM), SWEEP_MM + slope * u, z_v], axis=-1)
    normal = np.cross(along_v, along_u)
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


def bezier_poles() -> Array:
    """Return the poles (m, n, 3) of the outer skin as one Bezier patch over s, v in 0..1, u = 0.06 + 0.91 s."""
    degree_u, degree_v = len(SECTION) - 1, 3
    s, v = np.linspace(0.0, 1.0, degree_u + 1), np.linspace(0.0, 1.0, degree_v + 1)
    grid = aerofoil_point((CHORD_FROM + (CHORD_TO - CHORD_FROM) * s)[:, None], v[None, :])

    def bernstein(degree: int, t: Array) -> Array:
        return np.stack([comb(degree, k) * t**k * (1.0 - t) ** (degree - k) for k in range(degree + 1)], axis=1)

    along_s = np.linalg.solve(bernstein(degree_u, s), grid.reshape(len(s), -1)).reshape(grid.shape)
    return np.asarray(np.einsum("jn,mnk->mjk", np.linalg.inv(bernstein(degree_v, v)), along_s))


def grid_solid(outer: Array) -> Array:
    """Return the triangles (f, 3, 3) of the closed skin between a grid of outer points (m, n, 3) and the same 4 mm lower."""
    inner = outer - [0.0, 0.0, THICKNESS_MM]

    def sheet(p: Array) -> Array:
        a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
        return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)

    def wall(top: Array, low: Array) -> Array:
        a, b, c, d = top[:-1], low[:-1], low[1:], top[1:]
        return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])

    rims = (np.s_[:, 0], np.s_[-1, :], np.s_[::-1, -1], np.s_[0, ::-1])
    walls = [wall(outer[rim], inner[rim]) for rim in rims]
    return np.concatenate([sheet(outer), sheet(inner)[:, ::-1], *walls])


def box_triangles(size_mm: tuple[float, float, float]) -> Array:
    """Return the 12 triangles (12, 3, 3) of a box with one corner at the origin."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * np.array(size_mm)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners[[t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]]


def write_stl(path: Path, triangles: Array) -> None:
    """Write triangles (f, 3, 3) as binary STL."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(triangles), dtype=record)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    rows["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    rows["corners"] = triangles
    path.write_bytes(b"EchoBase sample part, mm".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes())


def chord_stations(tolerance_mm: float, curvature: Callable[[Array], Array]) -> Array:
    """Return chord fractions between which a chord leaves the section by at most the tolerance: dense where it curves."""
    u = np.linspace(CHORD_FROM, CHORD_TO, 20_001)
    # A chord of length h leaves a curve of curvature k by h2 k / 8.
    step = np.sqrt(8.0 * tolerance_mm / np.maximum(curvature(u), 1e-5))
    arc = ROOT_CHORD_MM * np.gradient(u) / np.minimum(step, 12.0)
    count = np.concatenate([[0.0], np.cumsum(0.5 * (arc[1:] + arc[:-1]))])
    return np.interp(np.linspace(0.0, count[-1], int(np.ceil(count[-1])) + 1), count, u)


def aerofoil_triangles(tolerance_mm: float = 0.006, span_steps: int = 60) -> Array:
    """Return the triangles (f, 3, 3) of the aerofoil skin, mm."""
    bend = np.polynomial.polynomial.polyder(SECTION, 2)
    stations = chord_stations(tolerance_mm, lambda u: np.abs(np.polynomial.polynomial.polyval(u, bend)) / TIP_CHORD_MM)
    v = np.linspace(0.0, 1.0, span_steps + 1)
    return grid_solid(aerofoil_point(stations[None, :], v[:, None]))


def write_step(folder: Path) -> None:
    """Write both parts as STEP with cadquery."""
    import cadquery  # noqa: PLC0415
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace  # noqa: PLC0415
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism  # noqa: PLC0415
    from OCP.Geom import Geom_BezierSurface  # noqa: PLC0415
    from OCP.gp import gp_Pnt, gp_Vec  # noqa: PLC0415

    try:
        from OCP.collections import Array2_gp_Pnt as PointGrid  # noqa: PLC0415
    except ImportError:  # before OCCT 8
        from OCP.TColgp import TColgp_Array2OfPnt as PointGrid  # noqa: PLC0415

    plate = cadquery.Workplane().box(*PLATE_MM, centered=False)
    cadquery.exporters.export(plate, str(folder / "flat-plate" / "flat-plate.step"))
    poles = bezier_poles()
    grid = PointGrid(1, poles.shape[0], 1, poles.shape[1])
    for i, row in enumerate(poles):
        for j, p in enumerate(row):
            grid.SetValue(i + 1, j + 1, gp_Pnt(*map(float, p)))
    face = BRepBuilderAPI_MakeFace(Geom_BezierSurface(grid), 1e-6).Face()
    skin = cadquery.Shape.cast(BRepPrimAPI_MakePrism(face, gp_Vec(0.0, 0.0, -THICKNESS_MM)).Shape())
    cadquery.exporters.export(cadquery.Workplane(obj=skin), str(folder / "aerofoil" / "aerofoil.step"))


def write_keypoints(path: Path, points: Array) -> None:
    """Write key points (n, 3), mm."""
    rows = [
        {"id": f"K{i + 1}"} | dict(zip(("x_mm", "y_mm", "z_mm"), np.round(p, 4).tolist(), strict=True))
        for i, p in enumerate(points)
    ]
    path.write_text("[\n" + ",\n".join(f"  {json.dumps(row)}" for row in rows) + "\n]\n", encoding="utf-8")


def main() -> None:
    """Write every sample file."""
    for name in ("flat-plate", "aerofoil"):
        (HERE / name).mkdir(exist_ok=True)
    write_stl(HERE / "flat-plate" / "flat-plate.stl", box_triangles(PLATE_MM))
    write_stl(HERE / "aerofoil" / "aerofoil.stl", aerofoil_triangles())
    plate = np.array([[25, 25, 10], [125, 25, 10], [125, 75, 10], [25, 75, 10], [75, 50, 10]], dtype=np.float64)
    write_keypoints(HERE / "flat-plate" / "keypoints.json", plate)
    u, v = np.array(
        [[0.2, 0.08], [0.8, 0.08], [0.2, 0.36], [0.8, 0.36], [0.2, 0.64], [0.8, 0.64], [0.2, 0.92], [0.8, 0.92]]
    ).T
    write_keypoints(HERE / "aerofoil" / "keypoints.json", aerofoil_point(u, v))
    write_step(HERE)


if __name__ == "__main__":
    main()
