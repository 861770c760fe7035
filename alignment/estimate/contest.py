"""Which of two readings of one scan its stretches speak for, where both fit it well.

On a gently curved part the wrong order of laws fits to a tenth of a millimetre, and passes; but wherever the order matters it
fits worse, and that many independent stretches do not agree on by chance. So they are counted (sign test, W. J. Dixon,
A. M. Mood, J. Am. Stat. Assoc. 41 (1946) 557, doi:10.1080/01621459.1946.10501898).
"""

import numpy as np

from planner.frames import Array

# Neighbouring readings share the robot's error, stretches of this many of the scan hardly do.
STRETCHES = 16
# A residual beyond so many robust deviations of the better reading is as bad as one that is not on the part.
CLIPPED = 5.0
# A reading fits a stretch, or the scan, better than another if it leaves less than these shares of the other's squares.
STRETCH_LEFT, SCAN_LEFT = 0.8, 0.7
# So many stretches have to prefer the other reading, and at most one in so many the given one: by chance 1 in 100.
LEAST_WON, WON_PER_LOST = 7, 8


def fits_better(given_mm: Array, other_mm: Array, sigma_mm: float) -> bool:
    """Return whether the other residuals (n,), in mm and scan order, are smaller than the given ones throughout the scan.

    nan: a reading that does not meet the part. sigma_mm: robust deviation of the better reading.
    """
    if len(given_mm) < 4 * STRETCHES:
        return False
    limit = CLIPPED * sigma_mm
    given, other = (
        np.array(
            [p.mean() for p in np.array_split(np.minimum(np.nan_to_num(np.abs(r), nan=limit), limit) ** 2, STRETCHES)]
        )
        for r in (given_mm, other_mm)
    )
    won, lost = int((other < STRETCH_LEFT * given).sum()), int((given < STRETCH_LEFT * other).sum())
    return bool(other.mean() < SCAN_LEFT * given.mean() and won >= LEAST_WON and won >= WON_PER_LOST * lost)
