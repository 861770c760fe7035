"""Independent pieces of arithmetic on two threads: numpy and LAPACK let go of the interpreter while they count."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from planner.frames import Array

# More would only crowd out the other jobs of the machine. What comes out does not depend on it.
THREADS = min(2, os.cpu_count() or 1)
# Rows worked on at a time: their temporaries stay in the processor's cache. So many runs of slices are shared out.
SLICE, RUNS = 32_768, 4

In = TypeVar("In")
Out = TypeVar("Out")


def side_by_side(work: Callable[[In], Out], items: Sequence[In]) -> list[Out]:
    """Return work(item) of each item, in their order."""
    if THREADS < 2 or len(items) < 2:
        return [work(item) for item in items]
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(work, items))


def sum_of_slices(work: Callable[[slice], Array], n: int, shape: tuple[int, ...]) -> Array:
    """Return the sum of work(rows), of a shape, over slices of n rows; always in the same order."""

    def run(first: int) -> Array:
        total = np.zeros(shape)
        for i in range(first, min(first + length, n), SLICE):
            total += work(slice(i, min(i + SLICE, first + length, n)))
        return total

    length = SLICE * max(1, -(-n // (SLICE * RUNS)))
    return np.asarray(sum(side_by_side(run, range(0, n, length)), np.zeros(shape)))
