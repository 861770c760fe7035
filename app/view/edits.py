"""Edits of key points that clicks and buttons make: pure, set in, set out."""

import numpy as np

from planner.errors import fail
from planner.frames import Array
from planner.keypoint import KeyPoint

Points = tuple[KeyPoint, ...]


def next_id(points: Points) -> str:
    """Return the first free name K1, K2, ... after the highest in use."""
    numbers = [int(p.id[1:]) for p in points if p.id[:1] == "K" and p.id[1:].isdigit()]
    return f"K{max(numbers, default=0) + 1}"


def added(points: Points, where_mm: Array) -> Points:
    """Return the set with a new point (3,), part, mm, rounded to a micrometre."""
    x, y, z = (round(float(v), 3) for v in where_mm)
    return (*points, KeyPoint(id=next_id(points), x_mm=x, y_mm=y, z_mm=z))


def without(points: Points, name: str) -> Points:
    """Return the set without a point; raise EchoBaseError if there is none of that name."""
    left = tuple(p for p in points if p.id != name)
    if len(left) == len(points):
        raise fail("keypoint-unknown", f"There is no key point {name}.", "Somebody else may have deleted it.", name)
    return left


def too_close(points: Points, where_mm: Array, least_mm: float) -> KeyPoint | None:
    """Return the point that lies closer than `least_mm` to a place, if any (a double click, say)."""
    if not points:
        return None
    gap = np.linalg.norm(np.array([p.xyz() for p in points]) - where_mm, axis=1)
    nearest = int(np.argmin(gap))
    return points[nearest] if gap[nearest] < least_mm else None
