"""Sums over very many rows, a slice at a time."""

from collections.abc import Callable

import numpy as np

from planner.frames import Array

# Rows worked on at a time: their temporaries stay in the processor's cache.
SLICE = 32_768


def sum_of_slices(work: Callable[[slice], Array], n: int, shape: tuple[int, ...]) -> Array:
    """Return the sum of work(rows), of a shape, over slices of n rows."""
    total = np.zeros(shape)
    for i in range(0, n, SLICE):
        total += work(slice(i, min(i + SLICE, n)))
    return total
