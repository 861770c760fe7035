"""Charts of a scan as plain numbers: histograms, C-scan maps, B-scan profiles. Small enough for any browser."""

from typing import Any

import numpy as np

from alignment.cloud import PointCloud
from app.view.deviation import deviation, less_shape, symmetric_limit
from app.view.model import ProjectModel
from planner.errors import fail
from planner.frames import Array
from planner.placement import assume_nominal

MAX_COLUMNS = 600
MAX_ROWS = 256


def histogram(values: Array, low: float, high: float, bins: int = 60) -> dict[str, Any]:
    """Return counts between low and high, and mean, standard deviation, range and number of all finite values."""
    known = values[np.isfinite(values)]
    counts, edges = np.histogram(np.clip(known, low, high), bins=bins, range=(low, high))
    stats = {
        "mean": float(known.mean()) if len(known) else None,
        "std": float(known.std()) if len(known) else None,
        "range": float(np.ptp(known)) if len(known) else None,
        "n": len(known),
    }
    return {"edges": edges.tolist(), "counts": counts.tolist(), **stats}


def deviation_chart(model: ProjectModel) -> dict[str, Any]:
    """Return histograms of the deviation of the scanned surface, before and (if aligned) after the correction, mm."""
    cloud, surface = _scanned(model), model.surface()
    if surface is None:
        raise fail("surface-missing", "There is no inspection surface.", "Choose one in step Surface.", "Surface")
    found = model.found()
    nominal = assume_nominal(model.setup().T_base_partnom)
    poses = {"before": nominal} | ({"after": found.T_base_part} if found else {})
    shapes = {"after": found.shape if found else None}
    measured = {n: less_shape(deviation(cloud, surface, pose), shapes.get(n)).values_mm for n, pose in poses.items()}
    return {
        "title": "Deviation along the normal",
        "unit": "mm",
        "series": {name: _about_zero(values) for name, values in measured.items()},
    }


def _about_zero(values: Array) -> dict[str, Any]:
    limit = symmetric_limit(values)
    return histogram(values, -limit, limit)


def amplitude_chart(model: ProjectModel) -> dict[str, Any]:
    """Return the histogram of the front-wall amplitude in dB from the reference."""
    cloud = _scanned(model)
    setup = model.setup()
    with np.errstate(divide="ignore", invalid="ignore"):
        loss = 20.0 * np.log10(cloud.amplitude_pct / setup.reference_amplitude_pct)
    known = loss[np.isfinite(loss)]
    low, high = (
        (max(-24.0, float(np.floor(known.min()))), min(12.0, float(np.ceil(known.max())) + 1e-9))
        if len(known)
        else (-6.0, 6.0)
    )
    within = float((np.abs(known) <= setup.tolerances.loss_db).mean()) if len(known) else None
    return {
        "title": "Amplitude from the reference",
        "unit": "dB",
        "series": {"scan": histogram(loss, low, max(high, low + 1.0))},
        "tolerance": setup.tolerances.loss_db,
        "within": within,
    }


def c_scan(model: ProjectModel, of: str) -> dict[str, Any]:
    """Return a map laws x poses of the amplitude (%FSH) or the measured distance (mm), thinned to the screen."""
    cloud = _scanned(model)
    values = cloud.amplitude_pct if of == "amplitude" else cloud.distance_mm
    poses = int(cloud.pose_index.max()) + 1
    laws = int(cloud.law.max())
    columns, rows = min(poses, MAX_COLUMNS), min(laws, MAX_ROWS)
    x = (cloud.pose_index.astype(np.int64) * columns) // poses
    y = ((cloud.law.astype(np.int64) - 1) * rows) // laws
    known = np.isfinite(values)
    cell = (y * columns + x)[known]
    total = np.bincount(cell, values[known], rows * columns)
    count = np.bincount(cell, minlength=rows * columns)
    mean = np.divide(total, count, out=np.full(rows * columns, np.nan), where=count > 0).reshape(rows, columns)
    title, unit = ("Amplitude", "%FSH") if of == "amplitude" else ("Distance", "mm")
    return {"title": f"C-scan, {title.lower()}", "unit": unit, "poses": poses, "laws": laws, "z": _json(mean)}


def b_scan(model: ProjectModel, law: int) -> dict[str, Any]:
    """Return the measured distance along the scan for one law (mm): the front wall, pose by pose."""
    cloud = _scanned(model)
    mine = np.flatnonzero(cloud.law == law)
    mine = mine[np.argsort(cloud.pose_index[mine], kind="stable")][:: max(1, len(mine) // 2000)]
    return {
        "title": f"Front wall along the scan, law {law}",
        "unit": "mm",
        "law": law,
        "laws": int(cloud.law.max()),
        "pose": cloud.pose_index[mine].tolist(),
        "pass": cloud.pass_id[mine].tolist(),
        "distance": _json(cloud.distance_mm[mine]),
        "standoff": model.setup().alignment_standoff_mm,
    }


def _scanned(model: ProjectModel) -> PointCloud:
    cloud = model.cloud()
    if cloud is None or not len(cloud):
        raise fail(
            "scan-missing", "There is no scan yet.", "Upload one, or rehearse with the simulated scanner.", "Scan"
        )
    return cloud


def _json(values: Array) -> list[Any]:
    rounded = np.round(values, 4)
    plain = rounded.astype(object)
    plain[~np.isfinite(rounded)] = None
    return list(plain.tolist())
