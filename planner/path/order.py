"""In which order, and which way round, to travel the runs of a raster."""

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.path.isolines import Ints


def nearest_order(start: Array, end: Array, first: int = 0) -> tuple[Ints, NDArray[np.bool_]]:
    """Return the order of runs (k,) and which to walk backwards, always going on at the nearest free end.

    start, end (k, 3): the ends of the runs, mm. On a raster this walks forth and back, and finishes the near side of a
    hole before the far side. Begins with run `first`, forwards.
    """
    k = len(start)
    order = np.zeros(k, dtype=np.int64)
    flip = np.zeros(k, dtype=bool)
    ends = np.concatenate([start, end]).T.copy()
    free = np.zeros(2 * k)
    current, backwards = first, False
    for i in range(k):
        order[i], flip[i] = current, backwards
        free[current] = free[current + k] = np.inf
        if i + 1 == k:
            break
        here = ends[:, current if backwards else current + k]
        distance = (ends[0] - here[0]) ** 2 + (ends[1] - here[1]) ** 2 + (ends[2] - here[2]) ** 2 + free
        best = int(np.argmin(distance))
        current, backwards = best % k, best >= k
    return order, flip
