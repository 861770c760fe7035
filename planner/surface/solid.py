"""`Solid`: the whole part as something to keep clear of. Closest points by a bounding-volume tree (libigl)."""

from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import igl
import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.part import Part


class Solid:
    """The triangles of a part with their search tree; one per part, built on first use."""

    def __init__(self, part: Part) -> None:
        self.vertices = np.ascontiguousarray(part.vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(part.faces, dtype=np.int64)
        self._part_normals = part.face_normals

    @cached_property
    def tree(self) -> Any:
        """The triangles in a tree of boxes."""
        tree = igl.AABB()
        tree.init(self.vertices, self.faces)
        return tree

    def closest(self, points_part: Array) -> tuple[Array, NDArray[np.int64], Array]:
        """Return distance (n,), mm, unsigned, triangle (n,) and closest point (n, 3) of points (n, 3) in `part`."""
        points = np.ascontiguousarray(points_part, dtype=np.float64).reshape(-1, 3)
        if len(points) == 0:
            return np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        squared, face, at = self.tree.squared_distance(self.vertices, self.faces, points)
        return np.sqrt(np.atleast_1d(squared)), np.atleast_1d(face), np.atleast_2d(at)

    def distance_mm(self, points_part: Array) -> Array:
        """Return the unsigned distance (n,), mm, of points (n, 3)."""
        return self.closest(points_part)[0]

    def inside(self, points_part: Array) -> NDArray[np.bool_]:
        """Return which points (n, 3) lie in the material.

        The nearest triangle's normal answers for most; where it says inside, the generalised winding number decides
        (Barill et al., Fast winding numbers for soups and clouds, ACM TOG 37, 2018, doi:10.1145/3197517.3201337), since
        near a sharp edge the normal of one triangle is no witness.
        """
        points = np.ascontiguousarray(points_part, dtype=np.float64).reshape(-1, 3)
        _, face, at = self.closest(points)
        answer = np.einsum("ij,ij->i", points - at, self._part_normals[face]) < 0.0
        if answer.any():
            answer[answer] = igl.fast_winding_number(self.vertices, self.faces, points[answer]) > 0.5
        return np.asarray(answer)


_SOLIDS: "WeakKeyDictionary[Part, Solid]" = WeakKeyDictionary()


def solid_of(part: Part) -> Solid:
    """Return the part's `Solid`; the same one as long as the part lives."""
    if part not in _SOLIDS:
        _SOLIDS[part] = Solid(part)
    return _SOLIDS[part]
