"""The surfaces of several plans of one part as one: for its centroid and extent, not for feet."""

from collections.abc import Sequence

import numpy as np

from planner.part import Part
from planner.surface.curved import CurvedSurface
from planner.surface.inspection import InspectionSurface


class Area(CurvedSurface):
    """A surface that is only asked how large it is and where its middle lies; what is asked for feet are its members."""

    def __init__(self, surface: InspectionSurface) -> None:
        self.surface = surface


def union_of(surfaces: Sequence[InspectionSurface]) -> Area:
    """Return the union of inspection surfaces; triangles of one mesh that several share count once.

    A surface cut by a box or by paint stands on a mesh of its own: where it overlaps another, the overlap counts twice,
    which moves the centre of motions a little and nothing else.
    """
    meshes: list[Part] = []
    picked: list[set[int]] = []
    for surface in surfaces:
        for known, rows in zip(meshes, picked, strict=True):
            if _same_mesh(known, surface.part):
                rows.update(surface.part_faces.tolist())
                break
        else:
            meshes.append(surface.part)
            picked.append(set(surface.part_faces.tolist()))
    first = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces[sorted(rows)] + n for m, rows, n in zip(meshes, picked, first[:-1], strict=True)]
    vertices, joined = np.concatenate([m.vertices for m in meshes]), np.concatenate(faces).astype(np.int32)
    part = Part(vertices, joined, surfaces[0].part.provenance)
    return Area(InspectionSurface(part, np.arange(len(joined), dtype=np.int32)))


def _same_mesh(a: Part, b: Part) -> bool:
    return a is b or (np.array_equal(a.faces, b.faces) and np.array_equal(a.vertices, b.vertices))
