"""Which side of a sheet is meant, and what people should know about a surface before they trust its normals."""

from dataclasses import replace

import numpy as np

from planner.frames import Array
from planner.issues import Issue
from planner.surface.inspection import InspectionSurface
from planner.surface.topology import Edges

# Within this cosine of edge-on a sheet faces neither way, and the file's winding stands.
EDGE_ON = 0.05
TURNED = "sheet_turned"


def facing(surface: InspectionSurface, edges: Edges, up_part: Array) -> InspectionSurface:
    """Return the surface; if it is all of an open sheet that faces away from up_part (3,), of a part wound the other way.

    edges: of the welded faces of the whole part. Beyond the boundary of an open sheet there is no other face.
    """
    if surface.mean_normal_part @ up_part >= -EDGE_ON:
        return surface
    chosen = np.zeros(len(surface.part.faces), dtype=bool)
    chosen[surface.part_faces] = True
    own = edges.of_face[surface.part_faces].ravel()
    alone = edges.uses[own] == 1
    beyond = (~chosen[edges.first[own]]) | ((edges.second[own] >= 0) & ~chosen[edges.second[own]])
    if not alone.any() or beyond.any():
        return surface
    faces = surface.part.faces.copy()
    faces[surface.part_faces] = faces[surface.part_faces][:, [0, 2, 1]]
    part = replace(surface.part, faces=faces, meta=surface.part.meta | {TURNED: True})
    return InspectionSurface(part, surface.part_faces)


def facing_issues(surface: InspectionSurface, up_part: Array) -> list[Issue]:
    """Return what is to be said about the side that is inspected: a sheet that was turned, a surface that faces away."""
    if surface.part.meta.get(TURNED):
        return [
            Issue(
                "warning",
                "sheet-turned",
                "The part is an open sheet whose normals point away from the probe's side (+Z of base); they were turned.",
                "If the other side is to be inspected, turn the part (placement) or export it as a solid.",
            )
        ]
    if surface.mean_normal_part @ up_part < -EDGE_ON:
        return [
            Issue(
                "warning",
                "surface-faces-down",
                "The inspection surface faces away from +Z of base: the probe comes from below.",
                "If that is not meant, choose another surface (a seed) or check the placement.",
            )
        ]
    return []
