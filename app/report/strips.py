"""Strip plots: every part a dot with its uncertainty, beside what all of them have in common."""

import io
from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from app.report.figures import ACCENT, INK, MUTED, SOFT, STYLE, WIDTH_IN
from planner.frames import Array

ODD = "#b3261e"
MOST_ACROSS = 3
# Nominal is drawn where it is no farther than this many times the spread of the parts, which it would else squeeze together.
NEAR = 2.0


@dataclass(frozen=True, eq=False)
class Strip:
    """One direction: values (k,) and their 95 % half widths, NaN where unknown; mean with half width; scatter or None."""

    title: str
    values: Array
    half_95: Array
    mean: float
    mean_half_95: float
    scatter: float | None
    odd: Array


def strips_svg(strips: Sequence[Strip], names: Sequence[str]) -> str:
    """Return the strips side by side, parts from top to bottom in the order given."""
    across = min(MOST_ACROSS, len(strips))
    rows = -(-len(strips) // across)
    tall = rows * (0.55 + 0.17 * max(len(names), 2))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, tall), layout=ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03))
        axes = figure.subplots(rows, across, squeeze=False, sharey=True).ravel()
        for ax in axes[len(strips) :]:
            ax.set_visible(False)
        at = np.arange(len(names))
        for ax, strip in zip(axes, strips, strict=False):
            if strip.scatter is not None:
                ax.axvspan(
                    strip.mean - 2 * strip.scatter, strip.mean + 2 * strip.scatter, color=MUTED, alpha=0.22, lw=0
                )
            low, high = strip.mean - strip.mean_half_95, strip.mean + strip.mean_half_95
            ax.axvspan(low, high, color=ACCENT, alpha=0.22, lw=0)
            ax.axvline(strip.mean, color=ACCENT, linewidth=0.9)
            known = np.isfinite(strip.values)
            if abs(strip.mean) < NEAR * float(np.ptp(strip.values[known]) + strip.half_95[known].max()):
                ax.axvline(0.0, color=SOFT, linewidth=0.6, linestyle=(0, (3, 3)))
            ax.errorbar(
                strip.values[known], at[known], xerr=strip.half_95[known], fmt="o", markersize=3.0, color=INK,
                ecolor=INK, elinewidth=0.7, capsize=0,
            )  # fmt: skip
            ax.plot(strip.values[strip.odd], at[strip.odd], "o", markersize=5.5, markerfacecolor="none", color=ODD)
            ax.set_title(strip.title, pad=3)
            ax.set_yticks(at, names)
            ax.set_ylim(len(names) - 0.5, -0.5)
            ax.locator_params(axis="x", nbins=5)
        buffer = io.StringIO()
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
