"""1.6 million readings on a 288 000-triangle skin: EchoBase beside Open3D's point-to-plane ICP and small_gicp.

    python -m benchmarks.alignment.speed [--readings 1600000]

Arrays and a loaded mesh with its normals in, a placement out; building of trees included on both sides; the median of five
runs, each from the beginning. Simulated truth.
The other libraries get the same measured points and the mesh's own points and normals. They run in an interpreter of their own,
`--python` or $ECHOBASE_BENCH_PYTHON (else this one), with as many threads as they like.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.map import MapFit, align_map
from planner.frames import Array, Transform
from planner.part import Part, Provenance
from planner.placement import part_from_correction
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.inspection import InspectionSurface
from tests.alignment.clouds import normal_error_mm, wander
from tests.loop.surfaces import wing

RUNS = 5
OFFSET = Transform.from_xyzabc("base", "basecorr", [1.1, -0.7, 1.0, 0.2, -0.3, 0.4])


def readings(surface, T_true: Transform, count: int, rng: np.random.Generator) -> tuple[PointCloud, Array]:
    """Return a cloud of passes of 50 laws over the whole skin, 15 mm off it, and its measured points in base."""
    laws, passes = 50, 12
    poses = count // (laws * passes)
    u = np.linspace(0.01, 0.99, poses) * surface.u[1]
    blocks = [
        (np.repeat(u if k % 2 == 0 else u[::-1], laws), np.tile(v + np.linspace(-0.04, 0.04, laws), poses))
        for k, v in enumerate(np.linspace(0.06, 0.94, passes))
    ]
    uu, vv = (np.concatenate([b[i] for b in blocks]) for i in (0, 1))
    feet, normal = surface.point(uu, vv), surface.normal(uu, vv)
    across = surface.derivatives(uu, vv)[1]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    pose = np.repeat(np.arange(poses * passes, dtype=np.int32), laws)
    pass_id = (pose // poses).astype(np.int32)
    noise = wander(rng, pass_id[::laws], surface.u[1] / poses, 10.0, 1)[pose, 0]
    distance = 15.0 + rng.normal(0, 0.5, passes)[pass_id]
    origin = T_true.points(feet + distance[:, None] * normal)
    d = distance + 0.03 * noise + 0.01 * rng.standard_normal(len(uu))
    beam, n = -T_true.directions(normal), len(uu)
    zero = np.zeros(n, dtype=np.int32)
    law = np.tile(np.arange(1, laws + 1, dtype=np.int32), poses * passes)
    cloud = PointCloud(
        origin, beam, T_true.directions(across), d, np.full(n, 50.0), law, pose, pass_id, zero, total_readings=n
    )
    return cloud, origin + d[:, None] * beam


def skin(vertices: Array, faces: Array) -> CurvedSurface:
    """Return the surface of a mesh that was just loaded, its normals known."""
    part = Part(vertices, faces.astype(np.int32), Provenance("wing", "0", "mm"))
    curved = CurvedSurface(InspectionSurface(part, np.arange(len(faces), dtype=np.int32)), 4.5)
    _ = curved.surface.face_normals
    return curved


def peer(name: str, folder: Path, python: str) -> tuple[Transform, float, float] | None:
    """Return another library's placement, its seconds and its seconds of processor; None where it is not installed."""
    env = {k: v for k, v in os.environ.items() if k not in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    script = Path(__file__).with_name("peers.py")
    done = subprocess.run([python, str(script), str(folder), name], capture_output=True, text=True, env=env, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    if not found:
        return None
    return Transform.from_matrix("part", "base", found["matrix"]).inv(), found["wall_s"], found["cpu_s"]


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--readings", type=int, default=1_600_000)
    parser.add_argument("--python", default=os.environ.get("ECHOBASE_BENCH_PYTHON", sys.executable))
    asked = parser.parse_args()
    surface, setup = wing(1500.0), Setup()
    vertices, faces = surface.mesh(721, 201)
    T_true = part_from_correction(OFFSET, setup.T_base_partnom)
    cloud, points = readings(surface, T_true, asked.readings, np.random.default_rng(1))
    print(f"{len(cloud)} readings, {len(faces)} triangles")

    def say(name: str, T: Transform, wall_s: float, cpu_s: float) -> None:
        error = normal_error_mm(surface, T_true, T)
        print(
            f"{name:28s} {wall_s:7.2f} s {cpu_s:7.2f} s of processor   largest normal error {error:.4f} mm", flush=True
        )

    took = []
    for _ in range(RUNS):
        curved = skin(vertices, faces)
        wall, cpu = time.perf_counter(), time.process_time()
        fit = align_map(cloud, curved, setup, edges=False)
        took.append((time.perf_counter() - wall, time.process_time() - cpu))
    wall, cpu = np.median(took, axis=0).tolist()
    if not isinstance(fit, MapFit):
        raise SystemExit("EchoBase found no placement")
    say("EchoBase MAP", fit.T_base_part, wall, cpu)
    s = curved.surface
    centres = s.vertices[s.faces].mean(axis=1)
    arrays = {
        "points": points,
        "target": np.vstack([s.vertices, centres]),
        "normals": np.vstack([curved.vertex_fit.normals, s.face_normals]),
    }
    with TemporaryDirectory() as folder:
        for part_name, array in arrays.items():
            np.save(Path(folder) / f"{part_name}.npy", array)
        for name, title in (("open3d", "Open3D point-to-plane ICP"), ("small_gicp", "small_gicp point-to-plane")):
            found = peer(name, Path(folder), asked.python)
            if found is None:
                print(f"{title:28s} not installed")
            else:
                say(title, *found)


if __name__ == "__main__":
    main()
