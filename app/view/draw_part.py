"""The part, its edges, the inspection surface and the frames, as nodes of the scene. mm in, metres out."""

from dataclasses import dataclass

import numpy as np
import viser

from app.view import colour
from app.view.layers import FRAMES, LAYERS
from app.view.meshes import Creases, creases, finer, lighter, split_smooth, vertex_normals
from planner.frames import Array, Transform
from planner.part import Faces, Part
from planner.surface.inspection import InspectionSurface

M = 1e-3
FOV_RAD = 0.6


@dataclass(frozen=True, eq=False)
class Shape:
    """What of a part is drawn: a mesh with vertices doubled along creases, its crease edges, and its size (mm)."""

    vertices: Array
    faces: Faces
    edges: Array
    size_mm: float


@dataclass(frozen=True, eq=False)
class Sheet:
    """The inspection surface cut finely enough to carry a map. normals (v, 3); edge (e, 2, 3): its outline. mm."""

    vertices: Array
    faces: Faces
    normals: Array
    outline: Array
    size_mm: float

    def raised(self, share: float) -> Array:
        """Return the vertices in m, lifted off the surface by a share of its size so that layers do not flicker."""
        return (self.vertices + self.normals * (self.size_mm * share)) * M


def shape_of(part: Part) -> Shape:
    """Return what is drawn of a part; up to a few seconds on millions of triangles."""
    vertices, faces = lighter(part.vertices, part.faces)
    found: Creases = creases(vertices, faces)
    split, split_faces = split_smooth(vertices, faces, found.smooth)
    return Shape(split, split_faces, found.edges, float(np.linalg.norm(part.extents_mm)))


def sheet_of(surface: InspectionSurface) -> Sheet:
    """Return the drawable inspection surface."""
    vertices, faces = lighter(surface.vertices, surface.faces, 400_000)
    outline = creases(vertices, faces, 179.0).edges
    fine, fine_faces = finer(vertices, faces)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return Sheet(fine, fine_faces, vertex_normals(fine, fine_faces), outline, size)


def prepare(server: viser.ViserServer) -> dict[str, viser.FrameHandle]:
    """Add lights, camera defaults and the empty tree of frames and layers; return the frames by name."""
    server.scene.configure_default_lights(enabled=True, cast_shadow=False)
    server.scene.set_up_direction("+z")
    server.scene.configure_environment_map(environment_intensity=0.45)
    server.initial_camera.fov = FOV_RAD
    server.initial_camera.near = 0.01
    server.initial_camera.far = 200.0
    frames = {name: server.scene.add_frame(name, show_axes=False) for name in FRAMES}
    for layer in LAYERS.values():
        server.scene.add_frame(layer.node, show_axes=False)
    return frames


def place(frame: viser.FrameHandle, T_base_frame: Transform) -> None:
    """Move a frame of the tree to its pose in base."""
    frame.position, frame.wxyz = _xyz_m(T_base_frame), _wxyz(T_base_frame)


def pose_m(T: Transform) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return a transform as viser wants it: position in m, quaternion wxyz."""
    return _xyz_m(T), _wxyz(T)


def _xyz_m(T: Transform) -> tuple[float, float, float]:
    x, y, z = (float(v) * M for v in T.xyz_mm)
    return x, y, z


def _wxyz(T: Transform) -> tuple[float, float, float, float]:
    w, x, y, z = (float(v) for v in T.wxyz)
    return w, x, y, z


def draw_part(
    server: viser.ViserServer, shape: Shape, layer: str, edges_rgb: tuple[int, int, int] = colour.EDGE
) -> None:
    """Draw the CAD body with its feature edges."""
    node = LAYERS[layer].node
    server.scene.add_mesh_simple(
        f"{node}/body",
        (shape.vertices * M).astype(np.float32),
        shape.faces.astype(np.uint32),
        color=colour.STEEL,
        side="double",
        cast_shadow=False,
        receive_shadow=False,
    )
    lines(server, f"{node}/edges", shape.edges, edges_rgb, 1.4)


def draw_ghost(server: viser.ViserServer, shape: Shape, sheet: Sheet | None) -> None:
    """Draw the inspection surface as if of glass, with the feature edges of the part."""
    node = LAYERS["ghost"].node
    lines(server, f"{node}/edges", shape.edges, colour.EDGE, 1.4)
    if sheet is not None:
        server.scene.add_mesh_simple(
            f"{node}/sheet",
            (sheet.vertices * M).astype(np.float32),
            sheet.faces.astype(np.uint32),
            color=colour.STEEL,
            opacity=0.25,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )


def draw_axes(server: viser.ViserServer, size_mm: float) -> None:
    """Draw the triads of base and of the CAD origin."""
    length = size_mm * M * 0.12
    server.scene.add_frame(
        f"{LAYERS['axes'].node}/base", axes_length=length, axes_radius=length * 0.022, origin_radius=length * 0.05
    )
    label(server, f"{LAYERS['axes'].node}/label", "BASE", (0.0, 0.0, -length * 1e3 * 0.12))


def draw_surface(server: viser.ViserServer, sheet: Sheet) -> None:
    """Tint the inspection surface and outline it."""
    node = LAYERS["surface"].node
    server.scene.add_mesh_simple(
        f"{node}/tint",
        sheet.raised(3e-4).astype(np.float32),
        sheet.faces.astype(np.uint32),
        color=colour.ACCENT_SOFT,
        side="double",
        cast_shadow=False,
        receive_shadow=False,
    )
    lines(server, f"{node}/outline", sheet.outline, colour.ACCENT, 2.2)


def lines(server: viser.ViserServer, name: str, segments: Array, rgb: object, width_px: float) -> None:
    """Draw line segments (e, 2, 3) in mm, one colour (3,) or one per end (e, 2, 3); remove the node if there are none."""
    if not len(segments):
        server.scene.remove_by_name(name)
        return
    colours = np.asarray(rgb, dtype=np.uint8)
    server.scene.add_line_segments(
        name,
        np.ascontiguousarray(segments * M, dtype=np.float32),
        np.ascontiguousarray(np.broadcast_to(colours, (len(segments), 2, 3))),
        thickness=float(width_px),
        thickness_units="screen",
    )


def label(server: viser.ViserServer, name: str, text: str, xyz_mm: tuple[float, ...]) -> None:
    """Put a small text at a point in mm."""
    x, y, z = (float(v) * M for v in xyz_mm)
    server.scene.add_label(name, str(text), position=(x, y, z), font_screen_scale=0.8, anchor="bottom-center")
