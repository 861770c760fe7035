"""The scene of one project: what is drawn, redrawn only where the model changed. Used by one thread at a time."""

from functools import partial

import numpy as np
import viser

from app.view import colour
from app.view.deviation import deviation, less_shape, symmetric_limit
from app.view.draw_keypoints import draw_keypoints, marks
from app.view.draw_part import (
    Shape,
    Sheet,
    draw_axes,
    draw_ghost,
    draw_part,
    draw_surface,
    place,
    prepare,
    shape_of,
    sheet_of,
)
from app.view.draw_paths import draw_coverage, draw_path, draw_probe
from app.view.draw_regions import draw_regions
from app.view.draw_scan import Legend, draw_deviation, draw_scan
from app.view.layers import LAYERS
from app.view.model import Found, Insight, ProjectModel
from app.view.picker import Picker
from planner.frames import Array
from planner.keypoint import KeyPoint
from planner.part import Part
from planner.placement import assume_nominal
from planner.surface.inspection import InspectionSurface


class Stage:
    """Nodes of the scene and what they were drawn from."""

    def __init__(self, server: viser.ViserServer, model: ProjectModel) -> None:
        self.server = server
        self.model = model
        self.shape: Shape | None = None
        self.sheet: Sheet | None = None
        self.picker: Picker | None = None
        self.insight: Insight | None = None
        self.found: Found | None = None
        self.legends: dict[str, Legend] = {}
        self.scan_by = "standoff"
        self._part: Part | None = None
        self._surface: InspectionSurface | None = None
        self._labels: set[str] = set()
        self._regions: set[str] = set()
        self._frames = prepare(server)

    @property
    def size_mm(self) -> float:
        """Diagonal of the part, mm."""
        return self.shape.size_mm if self.shape else 1000.0

    @property
    def ball_mm(self) -> float:
        """Radius of a key point on screen, mm."""
        return float(np.clip(self.size_mm * 0.008, 0.8, 25.0))

    def part(self) -> None:
        """Draw the part, and prepare picking on it."""
        part = self.model.part()
        if part is self._part:
            return
        self._part = part
        self.picker = None
        for name in ("cad", "found"):
            self._clear(name, "body", "edges")
        self._clear("ghost", "edges", "sheet")
        self.shape = None
        if part is None:
            return
        self.shape = shape_of(part)
        self.placement()
        draw_part(self.server, self.shape, "cad")
        draw_axes(self.server, self.size_mm)
        self.server.flush()
        self.picker = Picker(part, self.model.surface())

    def placement(self) -> None:
        """Move the believed and the found part to their places in base."""
        T_base_partnom = self.model.setup().T_base_partnom
        place(self._frames["/base/partnom"], T_base_partnom)
        nominal = assume_nominal(T_base_partnom)
        place(self._frames["/base/part"], self.found.T_base_part if self.found else nominal)
        if self.shape is not None:
            draw_probe(self.server, self.model.setup())

    def surface(self) -> None:
        """Tint the inspection surface."""
        surface = self.model.surface()
        if surface is not None and surface is self._surface:
            return
        self._surface = surface
        self.sheet = sheet_of(surface) if surface is not None else None
        if self.shape is not None:
            draw_ghost(self.server, self.shape, self.sheet)
        if self.sheet is not None:
            draw_surface(self.server, self.sheet)
        else:
            self._clear("surface", "tint", "outline")
            self._clear("coverage", "swept")
            self._clear("ghost", "sheet")
        if self.picker is not None:
            self.picker.use(surface)

    def regions(self) -> None:
        """Outline the keep-out regions, the box, and the line drawn for the passes."""
        surface = self.model.surface()
        if surface is None or self.picker is None:
            return
        self._regions = draw_regions(self.server, surface, self.model.setup(), self.picker, self._regions)
        self.server.flush()

    def keypoints(self, points: tuple[KeyPoint, ...] | None = None) -> None:
        """Draw the key points; with their verdicts if those are known for this very set."""
        state = self.model.keypoints()
        shown = state.points if points is None else points
        insight = self.insight if self.insight and points is None and self.insight.version == state.version else None
        self._labels = draw_keypoints(self.server, shown, marks(shown, insight, self.found), self.ball_mm, self._labels)
        self.server.flush()

    def coverage(self) -> None:
        """Tint what the alignment scan of now would sweep."""
        if self.sheet is None:
            return
        path = self.insight.path if self.insight else self.model.path("alignment")
        draw_coverage(self.server, self.sheet, path, self.model.setup())

    def paths(self) -> None:
        """Draw the planned paths."""
        draw = partial(draw_path, self.server, size_mm=self.size_mm)
        draw(self.model.path("alignment"), "alignment", rgb=colour.ACCENT)
        draw(self.model.path("inspection"), "inspection", rgb=colour.ACCENT)
        draw(self.model.path("corrected"), "corrected", rgb=colour.ACCENT)

    def scan(self) -> None:
        """Draw the scan points."""
        cloud = self.model.cloud()
        self.legends.pop("scan", None)
        if cloud is None or not len(cloud):
            self._clear("scan", "points")
            return
        standoff = self.model.setup().alignment_standoff_mm
        self.legends["scan"] = draw_scan(self.server, cloud, self.scan_by, standoff, self.size_mm)

    def alignment(self) -> None:
        """Draw the part where it was found, and the deviation maps before and after."""
        self.found = self.model.found()
        self.placement()
        cloud, surface = self.model.cloud(), self.model.surface()
        for layer in ("before", "after"):
            self.legends.pop(layer, None)
        if self.found is None or cloud is None or surface is None or self.sheet is None or self.shape is None:
            self._clear("found", "body", "edges")
            self._clear("before", "map")
            self._clear("after", "map")
            return
        draw_part(self.server, self.shape, "found")
        nominal = assume_nominal(self.model.setup().T_base_partnom)
        reach = max(self.model.setup().probe.swath_mm * 0.35, self.sheet.size_mm / 60.0)
        for layer, pose in (("before", nominal), ("after", self.found.T_base_part)):
            measured = less_shape(deviation(cloud, surface, pose), self.found.shape if layer == "after" else None)
            limit = symmetric_limit(measured.values_mm)
            self.legends[layer] = draw_deviation(self.server, self.sheet, measured, layer, limit, reach)

    def points_m(self) -> Array | None:
        """Return corners of what is on stage in base, m, for framing; None on an empty stage."""
        if self.shape is None:
            return None
        v = self.shape.vertices
        step = max(1, len(v) // 4000)
        return (
            self.model.setup().T_base_partnom.points(
                np.concatenate([v[::step], v.min(axis=0)[None], v.max(axis=0)[None]])
            )
            * 1e-3
        )

    def _clear(self, layer: str, *children: str) -> None:
        for child in children:
            self.server.scene.remove_by_name(f"{LAYERS[layer].node}/{child}")
