"""First hits of rays on triangles: Embree where there is a wheel for it, libigl elsewhere."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array

try:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene
except ImportError:  # no wheel for this processor
    EmbreeScene = None


class Scene:
    """Triangles ready for rays."""

    def __init__(self, vertices: Array, faces: NDArray[np.int64]) -> None:
        self.vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(faces, dtype=np.int64)
        # Embree counts in float32: about the middle of the part its rounding is smallest.
        self.centre = 0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0))
        self._tree: Any = None
        if EmbreeScene is not None:
            self._tree = EmbreeScene(robust=True)
            TriangleMesh(self._tree, (self.vertices - self.centre).astype(np.float32), self.faces.astype(np.int32))

    def cast(self, origins: Array, directions: Array) -> NDArray[np.int32]:
        """Return the first face (n,) hit by rays from origins (n, 3) along directions (n, 3); -1: none."""
        if self._tree is not None:
            o = np.ascontiguousarray(origins - self.centre, dtype=np.float32)
            d = np.ascontiguousarray(directions, dtype=np.float32)
            return np.asarray(self._tree.run(o, d), dtype=np.int32)
        import igl  # noqa: PLC0415

        tree = igl.AABB()
        tree.init(self.vertices, self.faces)
        face, _, _ = tree.intersect_ray_first(self.vertices, self.faces, origins, directions)
        return np.asarray(face, dtype=np.int32)
