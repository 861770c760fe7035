"""An in-memory `ProjectModel` around a gently curved panel, with analytic paths and a synthetic scan."""

import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from alignment.cloud import PointCloud
from app.view.model import Found, Insight, KeyPointSet
from planner.errors import fail
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.keypoint import KeyPoint
from planner.part import Part, Provenance
from planner.placement import assume_nominal
from planner.setup import Inspection, Setup
from planner.surface.inspection import InspectionSurface
from planner.toolpath import Role, ToolPath

LENGTH, WIDTH, THICK = 600.0, 240.0, 12.0


def height(x: Array, y: Array) -> Array:
    """Height of the panel's outer face (mm) at x, y from its middle."""
    return 40.0 * np.cos(x / 300.0) + 8.0 * np.cos(y / 90.0)


def normal(x: Array, y: Array) -> Array:
    """Outward unit normals (n, 3) of the outer face."""
    n = np.stack([40.0 / 300.0 * np.sin(x / 300.0), 8.0 / 90.0 * np.sin(y / 90.0), np.ones_like(x)], axis=-1)
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def panel(nx: int = 61, ny: int = 25) -> tuple[Part, InspectionSurface]:
    """Return the panel as a closed part and its outer face as the inspection surface."""
    x, y = np.meshgrid(np.linspace(-LENGTH / 2, LENGTH / 2, nx), np.linspace(-WIDTH / 2, WIDTH / 2, ny), indexing="ij")
    top = np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3)
    bottom = top - [0.0, 0.0, THICK]
    i, j = np.meshgrid(np.arange(nx - 1), np.arange(ny - 1), indexing="ij")
    a = (i * ny + j).ravel()
    b, c, d = a + ny, a + ny + 1, a + 1
    up = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    n = nx * ny
    rim = np.concatenate(
        [
            np.arange(nx) * ny,
            (nx - 1) * ny + np.arange(1, ny),
            (np.arange(nx - 1)[::-1]) * ny + ny - 1,
            np.arange(1, ny - 1)[::-1],
        ]
    )
    after = np.roll(rim, -1)
    side = np.concatenate([np.stack([rim, rim + n, after + n], axis=1), np.stack([rim, after + n, after], axis=1)])
    faces = np.concatenate([up, up[:, ::-1] + n, side]).astype(np.int32)
    part = Part(np.concatenate([top, bottom]), faces, Provenance("panel.stl", "0" * 64, "mm"))
    return part, InspectionSurface(part, np.arange(len(up), dtype=np.int32))


def contact(x: Array, y: Array, direction: float) -> Transform:
    """Return contact frames on the outer face, travelling along +-x."""
    z = normal(x, y)
    t = np.tile([direction, 0.0, 0.0], (len(x), 1))
    t -= z * np.einsum("ij,ij->i", t, z)[:, None]
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    return Transform.from_axes("part", "contact", t, np.cross(z, t), z, np.stack([x, y, height(x, y)], axis=1))


def raster(kind: str, rows: Array, standoff: float = 15.0, margin: float = 10.0, step: float = 10.0) -> ToolPath:
    """Return forth and back passes along x at the given y."""
    parts, heading, pass_id = [], [], []
    x = np.arange(-LENGTH / 2 + margin, LENGTH / 2 - margin + 1e-9, step)
    for k, row in enumerate(rows):
        sign = 1.0 if k % 2 == 0 else -1.0
        parts.append(contact(x * sign, np.full_like(x, row), sign).matrix)
        heading += [sign] * len(x)
        pass_id += [k] * len(x)
    matrix = np.concatenate(parts) if parts else np.zeros((0, 4, 4))
    n = len(matrix)
    return ToolPath(
        kind,
        Transform.from_matrix("part", "contact", matrix),
        np.full(n, standoff),
        np.array(heading, dtype=np.int8),
        np.array(pass_id, dtype=np.int32),
        np.full(n, Role.DATA, dtype=np.uint8),
        np.zeros(n, dtype=np.int32),
        np.tile([1.0, 0.0, 0.0], (n, 1)),
    )


TRUTH = (1.1, -0.7, 1.0, 0.2, -0.8, 0.5)


class MemoryModel:
    """A project in memory."""

    def __init__(
        self, project_id: str = "demo", part_and_surface: tuple[Part, InspectionSurface] | None = None
    ) -> None:
        self._id = project_id
        self._part, self._surface = part_and_surface or panel()
        self._setup = Setup.model_validate({"placement": {"x_mm": 100.0, "y_mm": -50.0, "z_mm": 20.0, "a_deg": 30.0}})
        self._keys = KeyPointSet()
        self._paths: dict[str, ToolPath] = {}
        self._cloud: PointCloud | None = None
        self._found: Found | None = None
        self._callbacks: list[Callable[[str], None]] = []
        self._lock = threading.RLock()
        self.published: list[tuple[str, dict[str, object]]] = []
        self.seeds: list[Array] = []
        self.broken = False

    def reset(self) -> None:
        """Forget everything but the part."""
        self._keys = KeyPointSet((), self._keys.version + 1)
        self._paths, self._cloud, self._found, self.broken = {}, None, None, False
        self._setup = self._setup.model_copy(update={"inspection": Inspection()})
        for topic in ("part", "keypoints", "plan", "scan", "alignment"):
            self.tell(topic)

    @property
    def project_id(self) -> str:
        return self._id

    def setup(self) -> Setup:
        return self._setup

    def part(self) -> Part | None:
        if self.broken:
            raise ValueError("the part is on fire")
        return self._part

    def surface(self) -> InspectionSurface | None:
        return self._surface

    def keypoints(self) -> KeyPointSet:
        return self._keys

    def keypoint_history(self, limit: int) -> list[tuple[KeyPoint, ...]]:
        return [(), self._keys.points][-limit:]

    def set_keypoints(self, points: tuple[KeyPoint, ...], version: int | None, who: str) -> int:
        with self._lock:
            if version is not None and version != self._keys.version:
                raise fail("keypoints-changed", "The key points were changed by somebody else.", "Look and repeat.")
            self._keys = KeyPointSet(tuple(points), self._keys.version + 1)
            new = self._keys.version
        self.tell("keypoints")
        return new

    def select_surface(self, seeds_part: Array, who: str, more: bool = False) -> None:
        self.seeds.append(seeds_part)
        self.tell("surface")

    def edit_inspection(self, change: Callable[[Inspection], Inspection], who: str) -> None:
        self._setup = self._setup.model_copy(update={"inspection": change(self._setup.inspection)})
        self.tell("setup")

    def insight(self) -> Insight | None:
        keys = self._keys
        issues = tuple(
            Issue("warning", "keypoint-near-edge", f"{p.id} is close to an edge.", "Move it inwards.", p.id)
            for p in keys.points
            if abs(p.y_mm) > WIDTH / 2 - 20
        )
        if len(keys.points) < 3:
            return Insight(keys.version, issues)
        rows = np.array(sorted({round(p.y_mm / 30.0) * 30.0 for p in keys.points}))
        path = raster("alignment", rows)
        return Insight(keys.version, issues, min(1.0, len(rows) * 30.0 / WIDTH), path, None, 0.012)

    def path(self, kind: str) -> ToolPath | None:
        return self._paths.get(kind)

    def cloud(self) -> PointCloud | None:
        return self._cloud

    def found(self) -> Found | None:
        return self._found

    def subscribe(self, callback: Callable[[str], None]) -> Callable[[], None]:
        self._callbacks.append(callback)
        return lambda: self._callbacks.remove(callback)

    def publish(self, event: str, data: dict[str, object]) -> None:
        self.published.append((event, data))

    def tell(self, topic: str) -> None:
        for callback in list(self._callbacks):
            callback(topic)

    def plan(self) -> None:
        """Make both paths."""
        self._paths = {
            "alignment": raster("alignment", np.array([-80.0, 0.0, 80.0])),
            "inspection": raster("inspection", np.arange(-105.0, 106.0, 22.5)),
        }
        self.tell("plan")

    def scan(self, offset: tuple[float, ...] = TRUTH) -> None:
        """Scan the panel, moved by the offset in base, exactly: one ray per law against the analytic face."""
        path = self._paths["alignment"]
        T_base_partnom = self._setup.T_base_partnom
        T_base_part = Transform.from_xyzabc("base", "base", offset) @ assume_nominal(T_base_partnom)
        tcp = assume_nominal(T_base_partnom) @ path.Ts_part_tcp
        laws = np.arange(-24.0, 25.0, 2.0) * 0.6
        axes = tcp.rotation_matrix
        origins = (tcp.xyz_mm[:, None, :] + laws[None, :, None] * axes[:, None, :, 0]).reshape(-1, 3)
        beams = np.repeat(axes[:, :, 2], len(laws), axis=0)
        p = T_base_part.inv().points(origins)
        foot = p.copy()
        for _ in range(30):  # Newton on the foot of the perpendicular
            n = normal(foot[:, 0], foot[:, 1])
            d = (p[:, 2] - height(foot[:, 0], foot[:, 1])) * n[:, 2]
            foot[:, :2] += ((p - n * d[:, None]) - foot)[:, :2]
            foot[:, 2] = height(foot[:, 0], foot[:, 1])
        distance = np.linalg.norm(p - foot, axis=1)
        n = len(distance)
        self._cloud = PointCloud(
            origins,
            beams,
            None,
            distance,
            50.0 - 10.0 * np.abs(distance - 15.0),
            np.tile(np.arange(1, len(laws) + 1), len(path)).astype(np.int32),
            np.repeat(np.arange(len(path)), len(laws)).astype(np.int32),
            np.repeat(path.pass_id, len(laws)).astype(np.int32),
            np.zeros(n, dtype=np.int32),
            total_readings=n,
        )
        self.tell("scan")

    def align(self, offset: tuple[float, ...] = TRUTH) -> None:
        """Find the part exactly where it is."""
        T_base_part = Transform.from_xyzabc("base", "base", offset) @ assume_nominal(self._setup.T_base_partnom)
        status = {p.id: ("matched", None) for p in self._keys.points}
        self._found = Found(T_base_part, "pass", status)
        self._paths["corrected"] = replace(self._paths["inspection"], kind="corrected")
        self.tell("alignment")
