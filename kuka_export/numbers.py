"""Numbers as KRL carries them: fixed decimals, no exponent, no negative zero, no NaN."""

import math

import numpy as np
from numpy.typing import ArrayLike

from planner.frames import Array

# KRL REAL is a 32-bit float: more than 3 decimals of a mm is noise at arm's length. 1e-4 deg is 0.6 um at 300 mm.
MM_DECIMALS = 3
DEG_DECIMALS = 4
MM_ROUNDING = 0.5 * 10.0**-MM_DECIMALS
DEG_ROUNDING = 0.5 * 10.0**-DEG_DECIMALS
# Above this a 32-bit float no longer holds a mm to three decimals.
SINGLE_PRECISION_MM = 8192.0

FRAME_FORMAT = "{X %.3f,Y %.3f,Z %.3f,A %.4f,B %.4f,C %.4f}"
AXES_FORMAT = "{A1 %.4f,A2 %.4f,A3 %.4f,A4 %.4f,A5 %.4f,A6 %.4f}"


def written_frames(xyzabc: ArrayLike) -> Array:
    """Return X Y Z (mm) A B C (deg), (6,) or (n, 6), as a program carries them.

    Rounded to 3 and 4 decimals, A and C in (-180, 180] after rounding, no negative zero. Raises ValueError if a value is
    not finite.
    """
    v = np.asarray(xyzabc, dtype=np.float64)
    if not np.isfinite(v).all():
        raise ValueError("a frame has a value that is not a number")
    mm = np.round(v[..., :3], MM_DECIMALS)
    deg = np.round(v[..., 3:], DEG_DECIMALS)
    turned = 180.0 - np.mod(180.0 - deg, 360.0)  # (-180, 180]
    deg[..., [0, 2]] = np.round(turned, DEG_DECIMALS)[..., [0, 2]]
    deg = np.where(deg <= -180.0, deg + 360.0, deg)
    return np.concatenate([mm, deg], axis=-1) + 0.0  # turns -0.0 into 0.0


def written_axes(axes_deg: ArrayLike) -> Array:
    """Return axis values (6,), deg, as a program carries them; raises ValueError if one is not finite."""
    v = np.asarray(axes_deg, dtype=np.float64)
    if not np.isfinite(v).all():
        raise ValueError("an axis value is not a number")
    return np.round(v, DEG_DECIMALS) + 0.0


def frame_text(xyzabc: ArrayLike) -> str:
    """Return `{X 1.000,Y 0.000,...}` of X Y Z (mm) A B C (deg), shape (6,)."""
    return FRAME_FORMAT % tuple(written_frames(xyzabc).tolist())


def axes_text(axes_deg: ArrayLike) -> str:
    """Return `{A1 0.0000,...}` of axis values (6,), deg."""
    return AXES_FORMAT % tuple(written_axes(axes_deg).tolist())


def real_text(value: float) -> str:
    """Return a speed or another setting: up to five decimals, at least one, never an exponent."""
    if not math.isfinite(value):
        raise ValueError("a setting is not a number")
    text = f"{round(value, 5) + 0.0:.5f}".rstrip("0")
    return text + "0" if text.endswith(".") else text
