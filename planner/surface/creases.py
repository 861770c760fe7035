"""Creases inside an inspection surface that was put together from several smooth faces."""

from dataclasses import dataclass

import numpy as np

from planner.surface.inspection import InspectionSurface
from planner.surface.select import dihedral_rad, part_edges, smooth_regions

CREASE_DEG = 30.0


@dataclass(frozen=True)
class Creases:
    """How many smooth faces a surface consists of, and the edges between them: largest turn (deg), total length (mm)."""

    faces: int
    turn_deg: float
    length_mm: float


def creases_of(surface: InspectionSurface, crease_deg: float = CREASE_DEG) -> Creases | None:
    """Return the creases across which faces of a surface meet; None where it is one smooth face.

    A crease that runs out within one face, or an edge that a noisy mesh bends, separates nothing and does not count.
    """
    part = surface.part
    edges = part_edges(part)
    inside = np.zeros(len(part.faces), dtype=bool)
    inside[surface.part_faces] = True
    label = smooth_regions(part, edges, crease_deg, inside).label
    pair = np.flatnonzero(edges.uses == 2)
    a, b = edges.first[pair], edges.second[pair]
    between = pair[inside[a] & inside[b] & (label[a] != label[b])]
    if not len(between):
        return None
    apart = np.r_[label[edges.first[between]], label[edges.second[between]]]
    ends = part.vertices[part.faces]
    # The edge opposite corner k of its first face runs between the other two corners.
    row, corner = np.nonzero(np.isin(edges.of_face, between))
    _, pick = np.unique(edges.of_face[row, corner], return_index=True)
    row, corner = row[pick], corner[pick]
    span = ends[row, (corner + 1) % 3] - ends[row, (corner + 2) % 3]
    turn = float(np.degrees(dihedral_rad(part, edges)[between].max()))
    return Creases(len(np.unique(apart)), turn, float(np.linalg.norm(span, axis=1).sum()))
