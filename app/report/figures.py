"""Drawings of the report as SVG text (matplotlib): maps on the part's own shape, and histograms."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from app.report.sheet import Sheet
from app.view.colour import MapName, paint, table
from planner.frames import Array

INK, SOFT, ACCENT, MUTED = "#1c2733", "#5b6b7a", "#0b6fa4", "#a9b4be"
FREE_RGB = (230, 234, 238)
"""What of the part was not measured."""
WIDTH_IN = 7.0
MOST_TALL_IN = 3.4
# Height over width below which maps of a part stand below each other.
LONG = 0.4
# Ratio of the highest bins of two states from which on counts are drawn on a log scale.
STEEP = 8.0
STYLES: dict[str, dict[str, Any]] = {
    "before": {"histtype": "stepfilled", "color": MUTED, "alpha": 0.85},
    "key points": {"histtype": "step", "color": INK, "linewidth": 1.0, "linestyle": (0, (3, 2))},
    "after": {"histtype": "stepfilled", "color": ACCENT, "alpha": 0.8},
}
STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "echobase",  # the same figure is the same bytes
    "font.family": "DejaVu Sans",
    "font.size": 7.5,
    "axes.titlesize": 7.5,
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.labelsize": 7,
    "axes.labelcolor": SOFT,
    "axes.edgecolor": MUTED,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.unicode_minus": True,
}


@dataclass(frozen=True)
class Scale:
    """What colours mean: from low to high, signed (diverging, symmetric) or not, with the quantity and its unit."""

    label: str
    low: float
    high: float

    @property
    def colours(self) -> MapName:
        """Diverging for signed quantities."""
        return "diverging" if self.low == -self.high else "sequential"


@dataclass(frozen=True, eq=False)
class Panel:
    """One map: a title and values over the cells of the sheet (rows, columns); NaN is drawn as not measured."""

    title: str
    values: Array
    scale: Scale


@dataclass(frozen=True, eq=False)
class Series:
    """Values of one state in a histogram. look: `before`, `key points` or `after`; title: its words in the legend."""

    look: str
    title: str
    values: Array


def maps_svg(sheet: Sheet, panels: Sequence[Panel], points: Array | None = None) -> str:
    """Return maps with a legend each, side by side; of a long part below each other.

    points (n, 2): places to mark, mm, on the sheet.
    """
    across = 1 if sheet.aspect < LONG else len(panels)
    wide = WIDTH_IN / across - 1.05
    tall = float(np.clip(wide * sheet.aspect, 0.45, MOST_TALL_IN))
    rows = -(-len(panels) // across)
    with mpl.rc_context(STYLE):
        figure, axes = _axes(rows, across, rows * (tall + 0.4) + 0.2)
        for k, (ax, panel) in enumerate(zip(axes.ravel(), panels, strict=True)):
            _map(ax, sheet, panel, points)
            _label(ax, sheet, k >= len(panels) - across, k % across == 0)
            _legend(figure, panel.scale, ax)
        return _svg(figure)


def states_svg(sheet: Sheet, quantities: Sequence[Sequence[Panel]]) -> str:
    """Return maps of some quantities (outer) in some states (inner): all of one quantity on one scale, with one legend.

    A quantity takes a row, of a long part a column.
    """
    long = sheet.aspect < LONG
    states = len(quantities[0])
    rows, across = (states, len(quantities)) if long else (len(quantities), states)
    wide = (WIDTH_IN - 0.5) / across - 0.15 if long else (WIDTH_IN - 1.25) / across - 0.1
    tall = float(np.clip(wide * sheet.aspect, 0.4, MOST_TALL_IN / 1.5))
    extra = 0.75 if long else 0.2
    with mpl.rc_context(STYLE):
        figure, axes = _axes(rows, across, rows * (tall + (0.22 if long else 0.42)) + extra)
        for q, panels in enumerate(quantities):
            own = axes[:, q] if long else axes[q]
            for s, (ax, panel) in enumerate(zip(own, panels, strict=True)):
                _map(ax, sheet, panel, None)
                row, column = (s, q) if long else (q, s)
                _label(ax, sheet, row == rows - 1, column == 0)
            _legend(figure, panels[0].scale, list(own), "bottom" if long else "right")
        return _svg(figure)


def _figure(tall_in: float) -> Figure:
    return Figure(figsize=(WIDTH_IN, tall_in), layout=ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03))


def _axes(rows: int, columns: int, tall_in: float) -> tuple[Figure, Any]:
    figure = _figure(tall_in)
    return figure, figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)


def _label(ax: Axes, sheet: Sheet, lowest: bool, leftmost: bool) -> None:
    if lowest:
        ax.set_xlabel(sheet.title(0))
    if leftmost:
        ax.set_ylabel(sheet.title(1))


def _legend(figure: Figure, scale: Scale, axes: Any, side: Literal["right", "bottom"] = "right") -> None:
    colours = ScalarMappable(Normalize(scale.low, scale.high), ListedColormap(table(scale.colours) / 255.0))
    shape: Any = {"pad": 0.015, "aspect": 18} if side == "right" else {"pad": 0.02, "aspect": 40}
    bar = figure.colorbar(colours, ax=axes, location=side, fraction=0.05, shrink=0.96, **shape)
    bar.set_label(scale.label)
    bar.outline.set_linewidth(0.4)
    bar.locator = MaxNLocator(6)
    bar.update_ticks()


def _map(ax: Axes, sheet: Sheet, panel: Panel, points: Array | None) -> None:
    # One opaque picture: a transparent one is blended with black at its rims by some viewers.
    rgb = paint(panel.values, panel.scale.low, panel.scale.high, panel.scale.colours)
    rgb[~np.isfinite(panel.values)] = FREE_RGB
    rgb[~sheet.inside] = 255
    image = ax.imshow(rgb, extent=sheet.extent, origin="lower", interpolation="none")
    if sheet.outline:
        rim = Path.make_compound_path(*(Path(line, closed=True) for line in sheet.outline))
        image.set_clip_path(rim, ax.transData)
    for line in sheet.outline:
        ax.plot(line[:, 0], line[:, 1], color=INK, linewidth=0.6)
    if points is not None and len(points):
        ax.plot(points[:, 0], points[:, 1], "o", markersize=2.6, markerfacecolor="none", color=INK, markeredgewidth=0.6)
    left, right, bottom, top = sheet.extent
    pad = 0.01 * max(right - left, top - bottom)
    ax.set_xlim(left - pad, right + pad)
    ax.set_ylim(bottom - pad, top + pad)
    ax.set_aspect("equal")
    ax.locator_params(axis="x", nbins=7)
    ax.locator_params(axis="y", nbins=3 if sheet.aspect < LONG else 6)
    ax.set_title(panel.title, pad=3)


def histograms_svg(
    quantities: Sequence[tuple[str, Sequence[Series], tuple[float, ...]]], counted: str, bins: int = 60
) -> str:
    """Return histograms side by side: of each quantity (label, its series on one scale, tolerances drawn as lines)."""
    with mpl.rc_context(STYLE):
        figure = _figure(2.15)
        for ax, (label, series, limits) in zip(
            figure.subplots(1, len(quantities), squeeze=False)[0], quantities, strict=True
        ):
            _histogram(ax, label, series, limits, bins)
            ax.set_ylabel(counted if ax.get_yscale() == "linear" else f"{counted} (log)")
        return _svg(figure)


def _histogram(ax: Axes, label: str, series: Sequence[Series], limits: tuple[float, ...], bins: int) -> None:
    finite = [(s.look, s.title, s.values[np.isfinite(s.values)]) for s in series]
    everything = np.concatenate([v for _, _, v in finite]) if finite else np.zeros(0)
    if everything.size:
        low, high = float(everything.min()), float(everything.max())
        pad = max(1e-3, 0.02 * (high - low))
        edges = np.linspace(low - pad, high + pad, bins + 1).tolist()
        highest = []
        for look, title, values in finite:
            if len(values):
                counts, _, _ = ax.hist(values, edges, label=title, **STYLES[look])
                highest.append(float(np.max(counts)))
        # A state that is nearly perfect fills one bin and would hide how the others are spread.
        if max(highest) > STEEP * min(highest):
            ax.set_yscale("log")
            ax.set_ylim(bottom=0.8)
        ax.legend(
            frameon=False,
            fontsize=6.5,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=3,
            borderaxespad=0.2,
            handlelength=1.6,
            columnspacing=1.2,
        )
        ax.set_xlim(low - pad, high + pad)
        for value in limits:
            if low - pad <= value <= high + pad:
                ax.axvline(value, color=INK, linewidth=0.7, linestyle=(0, (4, 3)))
    else:
        ax.text(0.5, 0.5, "nothing measured", ha="center", va="center", color=SOFT, transform=ax.transAxes)
    ax.set_xlabel(label)
    if ax.get_yscale() == "linear":
        ax.locator_params(axis="y", nbins=5, integer=True)


def _svg(figure: Figure) -> str:
    buffer = io.StringIO()
    FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
