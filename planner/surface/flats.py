"""Planar faces of a tessellation, told apart from the planar strips that every tessellated cylinder has.

A plane that runs tangentially into a fillet has one normal at the seam but two curvatures; whoever fits a polynomial
through both sides gets the wrong normal there and, since planes come in few large triangles, a bent plane.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from planner.frames import Array
from planner.surface.normals import lengths, unit
from planner.surface.topology import Edges, Index

# Facets that turn by less than this (rad) are one plane; float32 files turn by up to 1e-5.
COPLANAR_RAD = 1e-4
CREASE_RAD = np.radians(30.0)
# A plane is this much wider than the strips it runs into ...
WIDER = 3.0
# ... and turns into them by less than they turn among themselves: half of it, since only they bend.
TURNS_LESS = 0.8


@dataclass(frozen=True, eq=False)
class Flats:
    """face (f,): number of the planar face a triangle belongs to, -1 for none. normals (n, 3): of the planar faces."""

    face: NDArray[np.int64]
    normals: Array


def find_flats(vertices: Array, faces: Index, edges: Edges) -> Flats:
    """Return the planar faces of a mesh: vertices (v, 3), mm, faces (f, 3)."""
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal, area = unit(cross), 0.5 * lengths(cross)
    length = lengths(vertices[edges.vertices[:, 0]] - vertices[edges.vertices[:, 1]])
    pair = np.flatnonzero(edges.uses == 2)
    a, b = edges.first[pair], edges.second[pair]
    # By the chord between unit normals, exact for small turns.
    chord = normal[a] - normal[b]
    turn = 2.0 * np.arcsin(np.minimum(0.5 * lengths(chord), 1.0))
    inside = turn < COPLANAR_RAD
    f = len(faces)
    graph = coo_array((np.ones(int(inside.sum()), dtype=np.int8), (a[inside], b[inside])), shape=(f, f))
    regions, region = connected_components(graph, directed=False)
    total = np.bincount(region, area, regions)
    around = np.bincount(region[edges.first], length, regions) + np.bincount(region[b], length[pair], regions)
    around = around - 2.0 * np.bincount(region[a[inside]], length[pair[inside]], regions)
    width = 2.0 * total / np.maximum(around, 1e-30)
    bends = ~inside & (turn < CREASE_RAD) & (region[a] != region[b])
    i, j, turn, length = region[a[bends]], region[b[bends]], turn[bends], length[pair[bends]]
    flat = _runs_into_strips(np.r_[i, j], np.r_[j, i], np.r_[turn, turn], np.r_[length, length], width)
    # One triangle alone may be a large facet of a curved face; a planar face of a CAD model has at least two.
    flat &= np.bincount(region, minlength=regions) > 1
    number = np.where(flat, np.cumsum(flat) - 1, -1)
    normals = np.zeros((regions, 3))
    for k in range(3):
        normals[:, k] = np.bincount(region, area * normal[:, k], regions)
    return Flats(number[region].astype(np.int64), unit(normals[flat]))


def _runs_into_strips(own: Index, other: Index, turn: Array, length: Array, width: Array) -> NDArray[np.bool_]:
    """Return which regions (r,) are wide planes that run into narrow strips along nearly all of their smooth edges.

    own, other (m,): the regions on the two sides of every smooth edge, each edge listed both ways.
    """
    regions = len(width)
    # How far a strip turns into its neighbours other than `own`: the largest, or the second largest if that is here.
    largest = np.zeros(regions)
    np.maximum.at(largest, own, turn)
    best = np.full(regions, -1)
    at_largest = turn >= largest[own]
    best[own[at_largest]] = other[at_largest]
    second = np.zeros(regions)
    elsewhere = other != best[own]
    np.maximum.at(second, own[elsewhere], turn[elsewhere])
    beyond = np.where(best[other] == own, second[other], largest[other])
    tangent = (width[own] > WIDER * width[other]) & (turn < TURNS_LESS * beyond)
    smooth = np.bincount(own, length, regions)
    return np.asarray((smooth > 0) & (np.bincount(own, np.where(tangent, length, 0.0), regions) > 0.9 * smooth))
