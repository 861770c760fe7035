"""The order in which hand-picked key points are visited, and the strips that suggested ones belong to."""

import re
from itertools import pairwise

import numpy as np

from planner.frames import Array
from planner.keypoint import KeyPoint

_STRIP = re.compile(r"^S(\d+)\.(\d+)$")


def strip_id(strip: int, number: int) -> str:
    """Return the id of a suggested key point: strip and place on it, from 1."""
    return f"S{strip}.{number}"


def strokes_through(keypoints: tuple[KeyPoint, ...], points: Array) -> tuple[list[list[int]], list[list[int]]]:
    """Return the rows of key points that each pass runs through, in order of travel: of strips, and of all others.

    Key points named by `strip_id` keep to their strip; all others, and those left alone on theirs, are visited by one
    short open tour, a pass from each to the next.
    """
    strips: dict[int, list[tuple[int, int]]] = {}
    loose: list[int] = []
    for row, k in enumerate(keypoints):
        match = _STRIP.match(k.id)
        if match:
            strips.setdefault(int(match[1]), []).append((int(match[2]), row))
        else:
            loose.append(row)
    out = []
    for _, members in sorted(strips.items()):
        if len(members) > 1:
            out.append([row for _, row in sorted(members)])
        else:
            loose.append(members[0][1])
    tour = [loose[i] for i in short_tour(points[loose])] if loose else []
    return out, [tour] if len(tour) == 1 else [[a, b] for a, b in pairwise(tour)]


def short_tour(points: Array) -> list[int]:
    """Return an order of points (n, 3) that makes a short open tour: nearest neighbour, then 2-opt (Croes 1958).

    Starts, for want of a better rule, at the point farthest from the middle.
    """
    n = len(points)
    d = np.linalg.norm(points[:, None] - points[None], axis=2)
    order = [int(np.argmax(np.round(np.linalg.norm(points - points.mean(axis=0), axis=1), 6)))]
    free = set(range(n)) - set(order)
    while free:
        order.append(min(free, key=lambda k: (d[order[-1], k], k)))
        free.remove(order[-1])
    improved = n > 3
    while improved:
        improved = False
        for i in range(n - 1):
            for j in range(i + 1, n):
                old = (d[order[i - 1], order[i]] if i else 0.0) + (d[order[j], order[j + 1]] if j + 1 < n else 0.0)
                new = (d[order[i - 1], order[j]] if i else 0.0) + (d[order[i], order[j + 1]] if j + 1 < n else 0.0)
                if new < old - 1e-9:
                    order[i : j + 1] = order[i : j + 1][::-1]
                    improved = True
    return order
