"""Other libraries' point-to-plane registration of the benchmark's arrays, in an interpreter that has them.

    python peers.py DIR open3d|small_gicp

DIR holds points.npy (n, 3) measured, target.npy and normals.npy (m, 3) of the mesh. Writes one line of JSON: matrix (4, 4) of
points onto target, wall_s, cpu_s; or {} where the library is not installed. Knows nothing of EchoBase.
"""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np

SEARCH_MM = 6.0
RUNS = 5


def open3d_icp(points, target, normals):
    """Open3D's point-to-plane ICP onto the mesh's points and normals; its own defaults for when to stop."""
    import open3d as o3d  # noqa: PLC0415

    registration = o3d.pipelines.registration

    def run():
        source, onto = o3d.geometry.PointCloud(), o3d.geometry.PointCloud()
        source.points = o3d.utility.Vector3dVector(points)
        onto.points, onto.normals = o3d.utility.Vector3dVector(target), o3d.utility.Vector3dVector(normals)
        plane = registration.TransformationEstimationPointToPlane()
        return registration.registration_icp(source, onto, SEARCH_MM, np.eye(4), plane).transformation

    return run


def small_gicp(points, target, normals):
    """small_gicp's point-to-plane registration, which finds its own normals."""
    import small_gicp as gicp  # noqa: PLC0415

    def run():
        onto, source = gicp.PointCloud(target), gicp.PointCloud(points)
        threads = os.cpu_count() or 1
        tree = gicp.KdTree(onto, num_threads=threads)
        gicp.estimate_normals_covariances(onto, tree, num_threads=threads)
        how = {"registration_type": "PLANE_ICP", "max_correspondence_distance": SEARCH_MM, "num_threads": threads}
        return gicp.align(onto, source, tree, **how).T_target_source

    return run


def main() -> None:
    """Run one library and write what it found."""
    folder, name = Path(sys.argv[1]), sys.argv[2]
    arrays = [np.load(folder / f"{part}.npy") for part in ("points", "target", "normals")]
    try:
        run = {"open3d": open3d_icp, "small_gicp": small_gicp}[name](*arrays)
    except ImportError:
        sys.stdout.write("{}\n")
        return
    took = []
    for _ in range(RUNS):
        wall, cpu = time.perf_counter(), time.process_time()
        matrix = run()
        took.append((time.perf_counter() - wall, time.process_time() - cpu))
    wall, cpu = np.median(took, axis=0).tolist()
    sys.stdout.write(json.dumps({"matrix": np.asarray(matrix).tolist(), "wall_s": wall, "cpu_s": cpu}) + "\n")


if __name__ == "__main__":
    main()
