"""Curved triangles cut into small ones, until the flat ones are close enough to the curve."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.simulator.curve import CurvedTriangles
from planner.frames import Array

Index = NDArray[np.int64]

MOST_TRIANGLES = 1_500_000


@dataclass(frozen=True, eq=False)
class Pieces:
    """Small triangles: corners and normals (k, 3, 3) of the curved surface; parent (k,): the triangle they came from."""

    corners: Array
    normals: Array
    parent: Index
    bary: Array


def refine(curved: CurvedTriangles, sag_mm: float, edge_mm: float = np.inf) -> Pieces:
    """Halve triangles at their worst edge until each stands less than `sag_mm` off the curve and is shorter than `edge_mm`.

    Neighbours may be cut differently: the slits between them are narrower than the sag, which a closest point or a ray
    does not notice. Stops at `MOST_TRIANGLES`, worst first.
    """
    parent = np.arange(len(curved.corners), dtype=np.int64)
    bary = np.broadcast_to(np.eye(3), (len(parent), 3, 3)).copy()
    done: list[tuple[Index, Array]] = []
    finished = 0
    for _ in range(40):
        corners, normals = _evaluate(curved, parent, bary)
        worst, which = _worst_edge(corners, normals, sag_mm, edge_mm)
        split = worst > 1.0
        room = MOST_TRIANGLES - finished - len(parent)
        if split.sum() > room:
            keep = np.argsort(-worst, kind="stable")[: max(room, 0)]
            split = np.zeros(len(parent), dtype=bool)
            split[keep] = worst[keep] > 1.0
        done.append((parent[~split], bary[~split]))
        finished += int((~split).sum())
        if not split.any():
            break
        parent, bary = _halve(parent[split], bary[split], which[split])
    else:
        done.append((parent, bary))
    parent = np.concatenate([d[0] for d in done])
    bary = np.concatenate([d[1] for d in done])
    corners, normals = _evaluate(curved, parent, bary)
    return Pieces(corners, normals, parent, bary)


def _evaluate(curved: CurvedTriangles, parent: Index, bary: Array) -> tuple[Array, Array]:
    face, flat = np.repeat(parent, 3), bary.reshape(-1, 3)
    return curved.points(face, flat).reshape(-1, 3, 3), curved.normals_at(face, flat).reshape(-1, 3, 3)


def _worst_edge(corners: Array, normals: Array, sag_mm: float, edge_mm: float) -> tuple[Array, Index]:
    """Largest ratio of sag or length to what is allowed, and the edge (0: from corner 0 to 1, ...) it belongs to.

    The sag of an edge whose end normals are known is an eighth of their difference along it.
    """
    ratios = []
    for i, j in ((0, 1), (1, 2), (2, 0)):
        edge = corners[:, j] - corners[:, i]
        sag = np.abs(np.einsum("ij,ij->i", edge, normals[:, j] - normals[:, i])) / 8.0
        ratios.append(np.maximum(sag / sag_mm, np.linalg.norm(edge, axis=1) / edge_mm))
    ratio = np.stack(ratios, axis=1)
    return ratio.max(axis=1), ratio.argmax(axis=1)


def _halve(parent: Index, bary: Array, which: Index) -> tuple[Index, Array]:
    row = np.arange(len(parent))
    i, j = which, (which + 1) % 3
    middle = 0.5 * (bary[row, i] + bary[row, j])
    one, two = bary.copy(), bary.copy()
    one[row, j] = middle
    two[row, i] = middle
    return np.concatenate([parent, parent]), np.concatenate([one, two])
