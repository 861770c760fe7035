"""1.6 million readings on a 288 000-triangle skin: EchoBase beside Open3D's point-to-plane ICP and small_gicp.

    python -m benchmarks.alignment.speed [--readings 1600000]

Arrays and a loaded mesh in, a placement out; building of trees included on both sides. Simulated truth. The other
libraries, if installed (`pip install echobase[bench]`), get the same measured points and the mesh's own points and normals.
"""

import argparse
import time

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.map import align_map
from planner.frames import Array, Transform
from planner.part import Part, Provenance
from planner.placement import part_from_correction
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.inspection import InspectionSurface
from tests.alignment.clouds import normal_error_mm, wander
from tests.loop.surfaces import wing

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


def open3d_icp(points: Array, curved: CurvedSurface) -> Transform:
    """Return Open3D's point-to-plane ICP of measured points onto the mesh's vertices and normals."""
    import open3d  # noqa: PLC0415

    def pcd(p: Array, n: Array | None = None):
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(p))
        if n is not None:
            cloud.normals = open3d.utility.Vector3dVector(n)
        return cloud

    s = curved.surface
    centres, normals = s.vertices[s.faces].mean(axis=1), s.face_normals
    target = pcd(np.vstack([s.vertices, centres]), np.vstack([curved.vertex_fit.normals, normals]))
    found = open3d.pipelines.registration.registration_icp(
        pcd(points), target, 6.0, np.eye(4), open3d.pipelines.registration.TransformationEstimationPointToPlane()
    )
    return Transform.from_matrix("part", "base", found.transformation).inv()


def small_gicp(points: Array, curved: CurvedSurface) -> Transform:
    """Return small_gicp's point-to-plane registration of the same points, on all cores."""
    import small_gicp as gicp  # noqa: PLC0415

    s = curved.surface
    target = gicp.PointCloud(np.vstack([s.vertices, s.vertices[s.faces].mean(axis=1)]))
    tree = gicp.KdTree(target)
    gicp.estimate_normals_covariances(target, tree)
    source = gicp.PointCloud(points)
    found = gicp.align(target, source, tree, registration_type="PLANE_ICP", max_correspondence_distance=6.0)
    return Transform.from_matrix("part", "base", found.T_target_source).inv()


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--readings", type=int, default=1_600_000)
    asked = parser.parse_args()
    surface, setup = wing(1500.0), Setup()
    vertices, faces = surface.mesh(721, 201)
    part = Part(vertices, faces.astype(np.int32), Provenance("wing", "0", "mm"))
    curved = CurvedSurface(InspectionSurface(part, np.arange(len(faces), dtype=np.int32)), 4.5)
    T_true = part_from_correction(OFFSET, setup.T_base_partnom)
    cloud, points = readings(surface, T_true, asked.readings, np.random.default_rng(1))
    print(f"{len(cloud)} readings, {len(faces)} triangles")

    def timed(name: str, run) -> None:
        start = time.perf_counter()
        try:
            T = run()
        except ImportError:
            print(f"{name:32s} not installed")
            return
        seconds = time.perf_counter() - start
        print(
            f"{name:32s} {seconds:7.2f} s   largest normal error {normal_error_mm(surface, T_true, T):.4f} mm",
            flush=True,
        )

    timed("EchoBase MAP", lambda: align_map(cloud, curved, setup, edges=False).T_base_part)
    timed("Open3D point-to-plane ICP", lambda: open3d_icp(points, curved))
    timed("small_gicp point-to-plane", lambda: small_gicp(points, curved))


if __name__ == "__main__":
    main()
