"""What an inspection scan looks like: maps over the part and histograms, after and before, on common scales."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing, distance_transform_edt

from alignment.metrics import Assessment
from app.view.charts import histogram
from app.view.colour import legend_colours
from app.view.deviation import symmetric_limit
from planner.frames import Array

MAX_CELLS_ALONG = 240
LEAST_CELL_MM = 1.0
MOST_HOLES = 0.02
LEAST_CELLS = 8
WIDEST_GAP = 8
AXES = ("X", "Y", "Z")


def assessment_charts(
    after: Assessment, before: Assessment | None, standoff_mm: float, loss_db: float
) -> dict[str, Any]:
    """Return `maps` and `histograms` of one or two scans, and the `colours` of a map from -limit to limit.

    Maps hold all laws whose beam is on the part, binned over the two CAD axes along which the part is longer; histograms
    hold the centre law, as the figures of the assessment do. standoff_mm: planned. loss_db: tolerance. "Front wall" is
    the measured distance less the planned standoff.
    """
    scans = {"after": after} | ({"before": before} if before is not None else {})
    quantities = (
        ("Front wall less standoff", "mm", {n: s.distance_mm - standoff_mm for n, s in scans.items()}, None),
        ("Amplitude from the reference", "dB", {n: s.db for n, s in scans.items()}, loss_db),
    )
    axes = _plane(after.feet_part[after.on_part])
    maps, histograms = [], []
    for title, unit, values, tolerance in quantities:
        used = {n: np.where(s.on_part & np.isfinite(values[n]), values[n], np.nan) for n, s in scans.items()}
        limit = symmetric_limit(np.concatenate(list(used.values())))
        for name in sorted(scans, reverse=True):
            shown = _map(scans[name].feet_part, used[name], axes)
            maps.append({"title": title, "series": name, "unit": unit, "limit": limit, **shown})
        of_centre = {n: used[n][s.centre & ~s.bubble] for n, s in scans.items()}
        span = symmetric_limit(np.concatenate(list(of_centre.values())))
        series = {n: histogram(of_centre[n], -span, span) for n in sorted(scans, reverse=True)}
        histograms.append({"title": title, "unit": unit, "series": series, "tolerance": tolerance})
    return {"maps": maps, "histograms": histograms, "colours": legend_colours("diverging", mapped=False)}


def _plane(feet: Array) -> tuple[int, int]:
    """Return the two CAD axes along which the points (n, 3) spread most, in their order."""
    longest = np.argsort(np.ptp(feet, axis=0))[1:] if len(feet) else np.array([0, 1])
    return int(min(longest)), int(max(longest))


def _map(feet: Array, values: Array, axes: tuple[int, int]) -> dict[str, Any]:
    """Return means of values (n,) over square cells of the plane of two axes; null where nothing was read."""
    known = np.isfinite(values)
    places = feet[known][:, axes]
    names = {"x_title": f"{AXES[axes[0]]}, mm", "y_title": f"{AXES[axes[1]]}, mm"}
    if not len(places):
        return {"x0": 0.0, "y0": 0.0, "cell_mm": LEAST_CELL_MM, "z": [[None]], **names}
    low, span = places.min(axis=0), np.ptp(places, axis=0)
    cell = max(float(span.max()) / MAX_CELLS_ALONG, LEAST_CELL_MM)
    # Cells narrower than the gaps between poses would draw stripes that are not there: widen them until few are empty.
    while True:
        columns, rows = (int(n) for n in span // cell + 1)
        x, y = ((places - low) // cell).astype(np.int64).T
        place = y * columns + x
        count = np.bincount(place, minlength=rows * columns)
        if _holes(count.reshape(rows, columns) > 0) <= MOST_HOLES or min(columns, rows) < LEAST_CELLS:
            break
        cell *= 1.25
    total = np.bincount(place, values[known], rows * columns)
    mean = np.divide(total, count, out=np.full(rows * columns, np.nan), where=count > 0)
    mean = _closed(mean.reshape(rows, columns)).ravel()
    rounded = np.round(mean, 3).astype(object)
    rounded[~np.isfinite(mean)] = None
    middle = low + cell / 2
    return {
        "x0": round(float(middle[0]), 3),
        "y0": round(float(middle[1]), 3),
        "cell_mm": round(cell, 4),
        "z": rounded.reshape(rows, columns).tolist(),
        **names,
    }


def _closed(mean: Array) -> Array:
    """Return the map (rows, columns) with gaps one cell wide taken from the nearest neighbour: where two passes meet."""
    filled = np.isfinite(mean)
    gaps = (binary_closing(filled, np.ones((1, 3))) | binary_closing(filled, np.ones((3, 1)))) & ~filled
    nearest = distance_transform_edt(~filled, return_distances=False, return_indices=True)
    return np.where(gaps, mean[tuple(nearest)], mean)


def _holes(filled: NDArray[np.bool_]) -> float:
    """Return the share of cells (rows, columns) that are empty between filled ones of the same row or column."""
    reach = np.ones((1, WIDEST_GAP + 1), dtype=bool)
    closed = binary_closing(filled, reach) | binary_closing(filled, reach.T)
    return float((closed & ~filled).sum() / max(int(filled.sum()), 1))
