"""The array type of the parsers: without `planner.frames`, whose libraries would slow the start of the child process."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
