"""Figures of the report as inline SVG text (matplotlib)."""

import io
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from planner.frames import Array

INK, ACCENT, MUTED = "#1c2733", "#0b6fa4", "#9aa7b4"
MAX_MAP_POINTS = 20_000

STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "echobase",  # the same figure is the same bytes
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
}


def histogram_svg(before: Array, after: Array, label: str, limits: tuple[float, ...] = ()) -> str:
    """Return two overlaid histograms of the same quantity; `limits` are drawn as tolerance lines."""
    before, after = before[np.isfinite(before)], after[np.isfinite(after)]
    both = np.concatenate([before, after])
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.6, 2.4), layout="constrained")
        axes = figure.add_subplot()
        if both.size:
            low, high = float(both.min()), float(both.max())
            pad = max(1e-3, 0.02 * (high - low))
            bins = np.linspace(low - pad, high + pad, 61).tolist()
            axes.hist(before, bins, color=MUTED, alpha=0.75, label="before")
            axes.hist(after, bins, color=ACCENT, alpha=0.85, label="after")
        for value in limits:
            axes.axvline(value, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
        axes.set_xlabel(label)
        axes.set_ylabel("poses")
        axes.legend(frameon=False, loc="upper right")
        return _svg(figure)


def map_svg(points_uv: Array, values: Array, label: str, limit: float, outline: Sequence[Array] = ()) -> str:
    """Return a map of a signed quantity over the surface: points (n, 2) mm, diverging and symmetric about zero."""
    step = max(1, len(points_uv) // MAX_MAP_POINTS)
    points_uv, values = points_uv[::step], values[::step]
    size = np.ptp(points_uv, axis=0) if len(points_uv) else np.ones(2)
    ratio = float(np.clip(size[1] / max(size[0], 1e-9), 0.15, 1.2))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 7.0 * ratio * 0.85 + 0.9), layout="constrained")
        axes = figure.add_subplot()
        drawn = axes.scatter(
            points_uv[:, 0],
            points_uv[:, 1],
            c=values,
            s=4,
            cmap="RdBu_r",
            vmin=-limit,
            vmax=limit,
            linewidths=0,
            rasterized=True,
        )
        for line in outline:
            axes.plot(line[:, 0], line[:, 1], color=INK, linewidth=0.7)
        axes.set_aspect("equal")
        axes.set_xlabel("along the surface (mm)")
        axes.set_ylabel("across (mm)")
        bar = figure.colorbar(drawn, ax=axes, shrink=0.9, pad=0.02)
        bar.set_label(label)
        bar.outline.set_linewidth(0.5)
        return _svg(figure)


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
