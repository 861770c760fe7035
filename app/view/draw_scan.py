"""Scan points and deviation maps, with the legend that belongs to their pixels."""

from dataclasses import dataclass, field

import numpy as np
import viser

from alignment.cloud import PointCloud
from app.view import colour
from app.view.deviation import Deviation, spread, symmetric_limit, thin
from app.view.draw_part import M, Sheet
from app.view.glb import coloured_mesh
from app.view.layers import LAYERS

MAX_POINTS = 1_500_000


@dataclass(frozen=True)
class Legend:
    """A colour bar: colours from low to high as they appear on screen, and what the ends mean."""

    title: str
    unit: str
    low: float
    high: float
    colours: list[str] = field(default_factory=list)
    unknown: str | None = None
    """Colour of what was not measured, where that is drawn."""


def draw_scan(server: viser.ViserServer, cloud: PointCloud, by: str, standoff_mm: float, size_mm: float) -> Legend:
    """Draw the measured points, coloured by `standoff` (measured minus planned) or `amplitude`."""
    index = thin(cloud, MAX_POINTS)
    if by == "amplitude":
        values, name, title, unit = cloud.amplitude_pct[index], "sequential", "Amplitude", "%FSH"
        known = values[np.isfinite(values)]
        low, high = (0.0, float(max(10.0, np.ceil(np.quantile(known, 0.99) / 10) * 10))) if len(known) else (0.0, 100.0)
    else:
        values, name, title, unit = cloud.distance_mm[index] - standoff_mm, "diverging", "Standoff minus planned", "mm"
        high = symmetric_limit(values)
        low = -high
    kind: colour.MapName = "sequential" if name == "sequential" else "diverging"
    server.scene.add_point_cloud(
        f"{LAYERS['scan'].node}/points",
        np.ascontiguousarray(cloud.axial_points_base[index] * M, dtype=np.float32),
        colour.paint(values, low, high, kind),
        point_size=float(max(size_mm * M * 0.0016, 2e-4)),
        point_shape="circle",
        point_shading="flat",
        precision="float32",
    )
    return Legend(title, unit, low, high, colour.legend_colours(kind, mapped=False))


def draw_deviation(
    server: viser.ViserServer, sheet: Sheet, measured: Deviation, layer: str, limit_mm: float, reach_mm: float
) -> Legend:
    """Draw a deviation map on the surface, unlit, in a symmetric diverging map; unmeasured surface stays grey."""
    values = spread(measured, sheet.vertices, reach_mm)
    rgb = colour.paint(values, -limit_mm, limit_mm, "diverging")
    server.scene.add_glb(
        f"{LAYERS[layer].node}/map",
        coloured_mesh(sheet.raised(9e-4), sheet.faces, rgb),
        cast_shadow=False,
        receive_shadow=False,
    )
    title = "Deviation before" if layer == "before" else "Deviation after"
    grey = colour.hex_of(colour.on_screen(np.array([colour.UNKNOWN], dtype=np.uint8)))[0]
    return Legend(title, "mm", -limit_mm, limit_mm, colour.legend_colours("diverging", mapped=True), grey)
