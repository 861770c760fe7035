"""Colours of quantities and verdicts, and what viser's tone mapping makes of them.

viser draws everything but point clouds through three.js' ACES filmic curve, so a legend must show the mapped colour, not
the requested one. The curve is the fit of Stephen Hill (2016) as three.js uses it (exposure / 0.6).
"""

from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array

Rgb = NDArray[np.uint8]
MapName = Literal["sequential", "diverging"]

ACCENT = (17, 94, 163)
ACCENT_SOFT = (138, 180, 218)
STEEL = (158, 165, 172)
EDGE = (58, 66, 74)
FAINT = (150, 158, 166)
UNKNOWN = (138, 144, 150)
VERDICT = {"good": (28, 138, 73), "warn": (214, 138, 0), "bad": (200, 40, 40), "none": (96, 104, 112)}

_ACES_IN = np.array([[0.59719, 0.35458, 0.04823], [0.076, 0.90834, 0.01566], [0.0284, 0.13383, 0.83777]])
_ACES_OUT = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])


@cache
def table(name: MapName) -> Rgb:
    """Return a perceptually uniform map as 256 sRGB colours (256, 3): cividis, or cmocean's balance for signed values."""
    from plotly import colors  # imported late: only a view pays for it  # noqa: PLC0415

    stops = colors.sequential.Cividis if name == "sequential" else colors.cmocean.balance
    rgb = np.array([_parse(stop) for stop in stops], dtype=np.float64)
    x, xs = np.linspace(0.0, 1.0, 256), np.linspace(0.0, 1.0, len(rgb))
    return np.stack([np.interp(x, xs, rgb[:, i]) for i in range(3)], axis=1).round().astype(np.uint8)


def _parse(stop: str) -> tuple[float, ...]:
    if stop.startswith("#"):
        return tuple(int(stop[i : i + 2], 16) for i in (1, 3, 5))
    return tuple(float(v) for v in stop[stop.index("(") + 1 : -1].split(","))


def paint(values: Array, low: float, high: float, name: MapName) -> Rgb:
    """Return the sRGB colour (n, 3) of values (n,) between low and high; NaN is grey, values beyond are clipped."""
    span = high - low if high > low else 1.0
    t = (np.asarray(values, dtype=np.float64) - low) / span
    known = np.isfinite(t)
    index = np.clip(np.where(known, t, 0.0) * 255.0, 0.0, 255.0).round().astype(np.intp)
    rgb = table(name)[index]
    rgb[~known] = UNKNOWN
    return rgb


def linear(srgb: NDArray[np.uint8]) -> Array:
    """Return linear light 0..1 of sRGB bytes (IEC 61966-2-1)."""
    c = np.asarray(srgb, dtype=np.float64) / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def srgb(light: Array) -> Rgb:
    """Return sRGB bytes of linear light 0..1."""
    c = np.clip(light, 0.0, 1.0)
    encoded = np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)
    return (encoded * 255.0).round().astype(np.uint8)


def on_screen(rgb: NDArray[np.uint8]) -> Rgb:
    """Return the pixel colour (n, 3) of unlit meshes and lines asked for in sRGB bytes (n, 3)."""
    v = (linear(rgb) / 0.6) @ _ACES_IN.T
    v = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    return srgb(v @ _ACES_OUT.T)


def hex_of(rgb: NDArray[np.uint8]) -> list[str]:
    """Return CSS colours of sRGB bytes (n, 3)."""
    return ["#{:02x}{:02x}{:02x}".format(*(int(v) for v in c)) for c in rgb]


def legend_colours(name: MapName, mapped: bool, steps: int = 64) -> list[str]:
    """Return the colours of a legend from low to high; `mapped` for meshes and lines, not for point clouds."""
    picked = table(name)[np.linspace(0, 255, steps).round().astype(np.intp)]
    return hex_of(on_screen(picked) if mapped else picked)
