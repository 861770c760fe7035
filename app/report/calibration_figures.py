"""Drawings of a calibration as SVG text: tilt-loss curves of both axes, times of flight, residuals over poses."""

import io
from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from alignment.calibrate.result import Calibration
from app.report.figures import ACCENT, INK, MUTED, SOFT, STYLE, WIDTH_IN
from planner.frames import Array

OUT = "#b3261e"
"""What was left out of the fit."""
# A drawing of more readings than this holds them as a picture: as one shape each they would weigh megabytes.
MOST_SHAPES = 4000
PICTURE_DPI = 300
# Readings more than this many times beyond those used stand at the rim, as arrows: they would flatten all others.
BEYOND = 1.6
NORMAL_95 = 1.96
DRAWN = ("mm", "deg", "db")
RESIDUAL_LABELS = {"mm": "distance (mm)", "deg": "slope (deg)", "db": "level (dB)"}
MARKERS = ("o", "s", "^", "D", "v")


def calibration_svg(found: Calibration) -> str:
    """Return the drawing of a calibration from its curves."""
    draw = {"tilt": _tilt, "couplant": _couplant, "tcp": _tcp}[found.kind]
    with mpl.rc_context(STYLE):
        figure = draw(found.curves)
        buffer = io.StringIO()
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _figure(rows: int, columns: int, tall_in: float, **shared: Any) -> tuple[Figure, Any]:
    layout = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03)
    figure = Figure(figsize=(WIDTH_IN, tall_in), dpi=PICTURE_DPI, layout=layout)
    return figure, figure.subplots(rows, columns, squeeze=False, **shared)


def _tilt(curves: Mapping[str, Array]) -> Figure:
    figure, axes = _figure(1, 2, 2.7, sharey=True)
    used = curves["used"] > 0.5
    drawn = [axis for axis in ("b", "c") if f"{axis}_fit_deg" in curves]
    seen = np.concatenate([curves[f"{axis}_seen_db"] for axis in drawn])
    fit, half = (np.concatenate([curves[f"{axis}_fit_{name}"] for axis in drawn]) for name in ("db", "half_db"))
    for ax, axis in zip(axes[0], ("b", "c"), strict=True):
        ax.set_xlabel(f"tilt about {axis.upper()} (deg)")
        if axis not in drawn:
            ax.text(0.5, 0.5, "not turned", ha="center", va="center", color=SOFT, transform=ax.transAxes)
            ax.set_xticks([])
            continue
        x, y, reach = (curves[f"{axis}_fit_{name}"] for name in ("deg", "db", "half_db"))
        ax.fill_between(x, y - reach, y + reach, color=ACCENT, alpha=0.22, lw=0, label="its 95 % band")
        ax.plot(x, y, color=ACCENT, linewidth=1.0, label="fitted")
        _points(ax, curves[f"{axis}_deg"], curves[f"{axis}_seen_db"], used, "o")
        ax.axhline(0.0, color=MUTED, linewidth=0.5, zorder=0)
    axes[0][0].set_ylabel("amplitude over the largest (dB)")
    # Noise floor and side lobes may lie far below; the curve is what this is about.
    top, lowest = max(np.nanmax(seen), (fit + half).max()), (fit - half).min()
    bottom = max(np.nanmin(seen), lowest - 0.5 * (top - lowest) - 1.0)
    rim = 0.05 * (top - bottom) + 0.02
    axes[0][0].set_ylim(bottom - rim, top + rim)
    _legend(axes[0]["bc".index(drawn[0])])
    return figure


def _couplant(curves: Mapping[str, Array]) -> Figure:
    figure, axes = _figure(1, 2, 2.5)
    key, label = ("gap_mm", "gap (mm)") if "gap_mm" in curves else ("step_mm", "moved by (mm)")
    way, echo, off, expected = curves[key], curves["echo"], curves["residual_us"], curves["expected_us"]
    left, right = axes[0]
    right.axhline(0.0, color=MUTED, linewidth=0.6)
    _spread(right, off)
    numbers = np.unique(echo)
    for i, number in enumerate(numbers):
        mine = echo == number
        order = np.argsort(way[mine], kind="stable")
        left.plot(way[mine][order], expected[mine][order], color=ACCENT, linewidth=0.9)
        yes, marker = np.ones(int(mine.sum()), dtype=bool), MARKERS[i % len(MARKERS)]
        title = f"echo {number:g}" if len(numbers) > 1 else "measured"
        _points(left, way[mine], (expected + off)[mine], yes, marker, title)
        _points(right, way[mine], off[mine], yes, marker, title)
    left.set_ylabel("time of flight (µs)")
    right.set_ylabel("residual (µs)")
    for ax in axes[0]:
        ax.set_xlabel(label)
    _legend(left)
    return figure


def _tcp(curves: Mapping[str, Array]) -> Figure:
    units = [unit for unit in DRAWN if f"residual_{unit}" in curves]
    figure, axes = _figure(len(units), 1, 0.5 + 1.15 * len(units), sharex=True)
    for ax, unit in zip(axes[:, 0], units, strict=True):
        off, used = curves[f"residual_{unit}"], curves[f"used_{unit}"] > 0.5
        known = np.isfinite(off)
        pose, off, used = curves["pose"][known], off[known], used[known]
        for start in curves["pass_start"]:
            ax.axvline(start - 0.5, color=MUTED, linewidth=0.4, zorder=0)
        ax.axhline(0.0, color=MUTED, linewidth=0.6)
        if used.any():
            _spread(ax, off[used])
            limit = BEYOND * float(np.abs(off[used]).max()) or 1.0
            high, low = off > limit, off < -limit
            for rim, marker, at in ((high, "^", limit), (low, "v", -limit)):
                ax.plot(pose[rim], np.full(int(rim.sum()), at), marker, markersize=2.6, color=OUT)
            ax.set_ylim(-1.05 * limit, 1.05 * limit)
            inside = ~(high | low)
            pose, off, used = pose[inside], off[inside], used[inside]
        _points(ax, pose, off, used, "o", size=1.6 if len(off) > MOST_SHAPES / 4 else 2.4)
        ax.set_ylabel(RESIDUAL_LABELS[unit])
        ax.locator_params(axis="y", nbins=5)
    axes[-1, 0].set_xlabel("pose, in the order recorded")
    figure.align_ylabels()
    return figure


def _points(
    ax: Axes, x: Array, y: Array, used: NDArray[np.bool_], marker: str, title: str = "measured", size: float = 2.6
) -> None:
    """Draw readings; those left out of the fit as rings."""
    look: dict[str, Any] = {"linestyle": "none", "markersize": size, "rasterized": len(x) > MOST_SHAPES}
    ax.plot(x[used], y[used], marker=marker, color=INK, markeredgewidth=0.0, label=title, zorder=2.5, **look)
    if not used.all():
        rings: dict[str, Any] = {
            "markerfacecolor": "none",
            "markeredgecolor": OUT,
            "markeredgewidth": 0.6 if len(x) < MOST_SHAPES else 0.25,
        }
        ax.plot(x[~used], y[~used], marker=marker, label="left out", zorder=2.0, **rings, **look)


def _spread(ax: Axes, off: Array) -> None:
    """Mark within what 95 % of normal residuals of this size lie."""
    reach = NORMAL_95 * float(np.sqrt(np.mean(off**2)))
    ax.axhspan(-reach, reach, color=ACCENT, alpha=0.12, lw=0)


def _legend(ax: Axes) -> None:
    ax.legend(
        frameon=False, fontsize=6.5, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.2,
        handlelength=1.6, columnspacing=1.2,
    )  # fmt: skip
