"""Keep-out regions, the box of the inspection surface and the line drawn for the passes, as lines on the part."""

import numpy as np
import trimesh
import viser

from app.view import colour
from app.view.draw_part import label, lines
from app.view.layers import LAYERS
from app.view.picker import Picker
from planner.errors import EchoBaseError
from planner.frames import Array
from planner.setup import Setup
from planner.shapes import BoxKeepOut, DiscKeepOut, KeepOut, PolygonKeepOut, SphereKeepOut
from planner.surface.inspection import InspectionSurface
from planner.surface.keepouts import KeepOuts, keep_outs_of
from planner.surface.normals import tangent_frames
from planner.surface.topology import edges_of

_AROUND = 48
_WIDTH_PX = 2.6


def draw_regions(
    server: viser.ViserServer, surface: InspectionSurface, setup: Setup, picker: Picker, old: set[str]
) -> set[str]:
    """Draw what there is; return the names of its nodes, so that the next call can remove those that are gone."""
    node, inspection = LAYERS["regions"].node, setup.inspection
    shown: set[str] = set()
    keep = _known(surface, setup)
    for i, shape in enumerate(inspection.keep_outs if keep is not None else ()):
        assert keep is not None
        segments = _outline(keep, i, shape, picker)
        if not len(segments):
            continue
        tone = colour.VERDICT["warn" if shape.may_cross else "bad"]
        lines(server, f"{node}/keep_{i}", segments, tone, _WIDTH_PX)
        text = keep.label(i) + ("" if shape.may_cross else " (not to be crossed)")
        label(server, f"{node}/name_{i}", text, tuple(segments[:, 0].mean(axis=0) + keep.up[i] * 2.0))
        shown |= {f"{node}/keep_{i}", f"{node}/name_{i}"}
    if inspection.box is not None:
        corners = trimesh.bounds.corners([inspection.box.min_mm, inspection.box.max_mm])
        lines(server, f"{node}/box", _box_edges(corners), colour.FAINT, 1.4)
        shown.add(f"{node}/box")
    if len(inspection.guide) > 1:
        line = np.array(inspection.guide)
        lines(server, f"{node}/guide", np.stack([line[:-1], line[1:]], axis=1), colour.ACCENT, _WIDTH_PX)
        shown.add(f"{node}/guide")
    for name in old - shown:
        server.scene.remove_by_name(name)
    return shown


def _known(surface: InspectionSurface, setup: Setup) -> KeepOuts | None:
    try:
        return keep_outs_of(surface, setup)
    except EchoBaseError:
        # Triangles of another part: the plan says so; there is nothing to draw.
        return None


def _outline(keep: KeepOuts, index: int, shape: KeepOut, picker: Picker) -> Array:
    """Return segments (e, 2, 3), part, mm."""
    up = keep.up[index]
    if isinstance(shape, SphereKeepOut | DiscKeepOut):
        first, second = (a[0] for a in tangent_frames(up[None]))
        angle = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)[:, None]
        ring = np.array(shape.centre_mm) + shape.radius_mm * (np.cos(angle) * first + np.sin(angle) * second)
        return _closed(_on_part(ring, up, shape.radius_mm, picker))
    if isinstance(shape, PolygonKeepOut):
        corners = np.array(shape.points_mm)
        along = np.roll(corners, -1, axis=0) - corners
        t = np.linspace(0.0, 1.0, 8, endpoint=False)
        return _closed(
            _on_part((corners[:, None] + t[:, None] * along[:, None]).reshape(-1, 3), up, shape.depth_mm, picker)
        )
    if isinstance(shape, BoxKeepOut):
        return _box_edges(trimesh.bounds.corners([shape.min_mm, shape.max_mm]))
    vertices, faces = keep.triangles(index)
    edges = edges_of(faces)
    return vertices[edges.vertices[edges.is_boundary]]


def _on_part(points: Array, up: Array, depth_mm: float, picker: Picker) -> Array:
    """Return points moved along the normal onto the part, where it is met within the depth."""
    out = points.copy()
    for i, p in enumerate(points):
        hit = picker.cast(p + up * depth_mm, -up)
        if hit is not None and float(np.linalg.norm(hit.point - p)) <= 2.0 * depth_mm:
            out[i] = hit.point
    return out + up * 0.2


def _closed(ring: Array) -> Array:
    return np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)


def _box_edges(corners: Array) -> Array:
    i, j = np.triu_indices(8, 1)
    along = np.count_nonzero(np.abs(corners[i] - corners[j]) > 1e-9, axis=1) == 1
    return np.stack([corners[i[along]], corners[j[along]]], axis=1)
