"""What is measured on each panel."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from benchmarks.planning.panels import Panel
from planner.path.coverage import coverage
from planner.path.decimate import decimate, deviation
from planner.path.isolines import isolines, neighbours
from planner.path.raster import raster
from planner.setup import Setup
from planner.surface.curved import CurvedSurface, footprint_mm
from planner.toolpath import ToolPath


@dataclass(frozen=True)
class Row:
    """One panel, one strategy: figures as printed."""

    panel: str
    strategy: str
    triangles: int
    passes: int
    poses: int
    normal_p99_deg: float
    pitch_low_mm: float
    pitch_high_mm: float
    missed_mm2: float
    surface_s: float
    raster_s: float
    coverage_s: float
    kept: int
    deviation: tuple[float, float, float, float]
    decimate_s: float


def setup_for(panel: Panel, strategy: str, step_mm: float) -> Setup:
    """Return a single crystal with a 3 mm beam at the step asked."""
    return Setup.model_validate(
        {
            "probe": {"elements": 1},
            "inspection": {"strategy": strategy, "step_mm": step_mm, "direction_deg": panel.direction_deg},
        }
    )


def run(panel: Panel, step_mm: float = 2.0) -> Iterator[Row]:
    """Plan one panel by both strategies and compare with the analytic surface; the curved surface is built once."""
    setup = setup_for(panel, "plane", step_mm)
    surface = panel.surface()
    t0 = time.process_time()
    curved = CurvedSurface(surface, footprint_mm(setup.probe))
    seconds = time.process_time() - t0
    for strategy in ("plane", "geodesic"):
        yield _row(panel, curved, seconds, setup_for(panel, strategy, step_mm))


def _row(panel: Panel, curved: CurvedSurface, surface_s: float, setup: Setup) -> Row:
    t1 = time.process_time()
    path = raster(curved, setup)
    t2 = time.process_time()
    covered = coverage(curved, path, setup)
    t3 = time.process_time()
    sparse = decimate(path)
    t4 = time.process_time()
    low, high = pitch(path)
    missed_inside = covered.missed_mm2 - covered.margin_mm2
    return Row(
        panel.name,
        setup.inspection.strategy,
        len(panel.faces),
        path.passes,
        int(path.is_data.sum()),
        float(np.percentile(normal_errors_deg(panel, path), 99)),
        low,
        high,
        missed_inside,
        surface_s,
        t2 - t1,
        t3 - t2,
        len(sparse),
        deviation(path, sparse),
        t4 - t3,
    )


def normal_errors_deg(panel: Panel, path: ToolPath) -> np.ndarray:
    """Return the angle (n,) between the beam axes of the DATA poses and the true normals."""
    data = path.take(path.is_data)
    z = data.Ts_part_contact.rotation_matrix[:, :, 2]
    truth = panel.normals(data.Ts_part_contact.xyz_mm)
    return np.degrees(2.0 * np.arcsin(np.minimum(np.linalg.norm(z - truth, axis=1) / 2.0, 1.0)))


def pitch(path: ToolPath) -> tuple[float, float]:
    """Return the 1st and 99th percentile of the distance from a pass to the polyline of the next one (mm).

    Measured in the middle half of each pass, in space: over a few mm of surface the chord is the arc.
    """
    data = path.take(path.is_data)
    p, run = data.Ts_part_contact.xyz_mm, data.pass_id
    gaps = []
    for k in range(path.passes - 1):
        a, b = p[run == k], p[run == k + 1]
        if min(len(a), len(b)) < 8:
            continue
        a = a[len(a) // 4 : -len(a) // 4]
        _, near = cKDTree(b).query(a)
        near = np.clip(near, 1, len(b) - 2)
        d = b[near + 1] - b[near - 1]
        off = a - b[near]
        off -= d * (np.einsum("ij,ij->i", off, d) / np.einsum("ij,ij->i", d, d))[:, None]
        gap = np.linalg.norm(off, axis=1)
        gaps.append(gap[gap < 10.0])
    every = np.concatenate(gaps)
    return float(np.percentile(every, 1)), float(np.percentile(every, 99))


def trimesh_seconds(panel: Panel, step_mm: float) -> tuple[float, float]:
    """Return the seconds trimesh and EchoBase's cutter take to cut the panel by the same planes."""
    mesh = trimesh.Trimesh(panel.vertices, panel.faces, process=False)
    across = np.array([0.0, 1.0, 0.0])
    y = panel.vertices[:, 1]
    heights = np.arange(y.min() + step_mm / 2.0, y.max(), step_mm)
    t0 = time.process_time()
    mesh.section_multiplane(np.zeros(3), across, heights)
    t1 = time.process_time()
    faces = panel.faces.astype(np.int32)
    isolines(y.copy(), faces, neighbours(faces), heights)
    return t1 - t0, time.process_time() - t1
