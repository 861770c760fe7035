"""Tool paths: the line on the surface, direction of travel, the beam at selected poses, what is covered, the probe."""

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from app.view import colour
from app.view.draw_part import M, Sheet, lines
from app.view.layers import LAYERS
from planner.frames import Array
from planner.setup import Setup
from planner.toolpath import Role, ToolPath

MAX_ARROWS = 110
MAX_BEAMS = 70
MAX_SEGMENTS = 60_000


def thinned(path: ToolPath, limit: int) -> ToolPath:
    """Return the path with at most about `limit` poses: every n-th, and both ends of every pass and role."""
    if len(path) <= limit:
        return path
    turn = np.r_[True, (np.diff(path.role.astype(int)) != 0) | (np.diff(path.pass_id) != 0)]
    keep = turn | np.r_[turn[1:], True]
    keep[:: max(1, len(path) // limit)] = True
    return path.take(np.flatnonzero(keep))


def draw_path(
    server: viser.ViserServer, path: ToolPath | None, layer: str, size_mm: float, rgb: tuple[int, int, int]
) -> None:
    """Draw a path: data strong, the rest faint, cones along the travel, beams at selected poses."""
    node = LAYERS[layer].node
    if path is None or len(path) < 2:
        for child in ("data", "links", "arrows", "beams"):
            server.scene.remove_by_name(f"{node}/{child}")
        return
    p = thinned(path, MAX_SEGMENTS)
    contact, tcp = p.Ts_part_contact, p.Ts_part_tcp
    normal = contact.rotation_matrix[:, :, 2]
    lifted = contact.xyz_mm + normal * size_mm * 1.2e-3
    data = p.is_data[1:] & p.is_data[:-1] & (p.pass_id[1:] == p.pass_id[:-1])
    # Many passes close together must stay lines, not become a sheet.
    width = 2.4 if p.passes <= 12 else 1.3
    lines(server, f"{node}/data", np.stack([lifted[:-1], lifted[1:]], axis=1)[data], rgb, width)
    tcp_xyz = tcp.xyz_mm
    lines(server, f"{node}/links", np.stack([tcp_xyz[:-1], tcp_xyz[1:]], axis=1)[~data], colour.FAINT, 1.0)
    on = np.flatnonzero(p.is_data)
    if not len(on):
        return
    chosen = on[np.linspace(0, len(on) - 1, min(MAX_BEAMS, len(on))).round().astype(np.intp)]
    lines(server, f"{node}/beams", np.stack([tcp_xyz[chosen], contact.xyz_mm[chosen]], axis=1), colour.ACCENT_SOFT, 1.2)
    _arrows(server, f"{node}/arrows", p, on, lifted, size_mm, rgb)


def _arrows(
    server: viser.ViserServer,
    name: str,
    path: ToolPath,
    on: NDArray[np.intp],
    lifted: Array,
    size_mm: float,
    rgb: tuple[int, int, int],
) -> None:
    step = np.linalg.norm(np.diff(lifted[on], axis=0), axis=1)
    step[path.pass_id[on][1:] != path.pass_id[on][:-1]] = 0.0
    along = np.r_[0.0, np.cumsum(step)]
    count = int(min(MAX_ARROWS, max(path.passes, along[-1] / (size_mm * 0.07))))
    chosen = on[np.clip(np.searchsorted(along, (np.arange(count) + 0.5) / count * along[-1]), 0, len(on) - 1)]
    axes = path.Ts_part_contact.rotation_matrix[chosen]
    # The cone of trimesh points along z: turn z to the travel (contact x) and x to the normal.
    wxyz = Rotation.from_matrix(np.stack([axes[:, :, 2], axes[:, :, 1] * -1.0, axes[:, :, 0]], axis=2)).as_quat(
        scalar_first=True
    )
    cone = trimesh.creation.cone(radius=0.34, height=1.0, sections=14)
    server.scene.add_batched_meshes_simple(
        name,
        np.asarray(cone.vertices, dtype=np.float32),
        np.asarray(cone.faces, dtype=np.uint32),
        batched_wxyzs=wxyz.astype(np.float32),
        batched_positions=(lifted[chosen] * M).astype(np.float32),
        batched_scales=np.full(count, size_mm * 0.014 * M, dtype=np.float32),
        batched_colors=np.tile(np.array(rgb, dtype=np.uint8), (count, 1)),
        lod="off",
        cast_shadow=False,
        receive_shadow=False,
    )


def swept(path: ToolPath, centres: Array, setup: Setup) -> NDArray[np.bool_]:
    """Return which points (n, 3) of the surface a path sweeps with its data on.

    A point is swept if its nearest point of the track lies across the travel within half the swath. The track is
    densified to a quarter of the swath, or the nearest pose would miss it along the travel.
    """
    swath = setup.probe.swath_mm
    xyz, axes = path.Ts_part_contact.xyz_mm, path.Ts_part_contact.rotation_matrix
    pair = path.is_data[1:] & path.is_data[:-1] & (path.pass_id[1:] == path.pass_id[:-1])
    start = np.flatnonzero(pair)
    if not len(start) or not len(centres):
        return np.zeros(len(centres), dtype=np.bool_)
    length = np.linalg.norm(xyz[start + 1] - xyz[start], axis=1)
    parts = np.maximum(1, np.ceil(length / (swath / 4.0))).astype(np.intp)
    which = np.repeat(np.arange(len(start)), parts)
    offset = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    t = ((offset + 0.5) / parts[which])[:, None]
    track = xyz[start][which] * (1 - t) + xyz[start + 1][which] * t
    across = axes[start][which][:, :, 1]
    travel = axes[start][which][:, :, 0]
    _, near = cKDTree(track).query(centres, distance_upper_bound=swath * 0.75)
    hit = near < len(track)
    off = centres[hit] - track[near[hit]]
    y = np.abs(np.einsum("ij,ij->i", off, across[near[hit]]))
    x = np.abs(np.einsum("ij,ij->i", off, travel[near[hit]]))
    out = np.zeros(len(centres), dtype=np.bool_)
    out[hit] = (y <= swath / 2.0) & (x <= swath / 4.0)
    return out


def draw_coverage(server: viser.ViserServer, sheet: Sheet, path: ToolPath | None, setup: Setup) -> None:
    """Tint what the alignment scan sweeps."""
    name = f"{LAYERS['coverage'].node}/swept"
    hit = np.zeros(0, dtype=np.bool_)
    if path is not None and len(path) > 1:
        hit = swept(path, sheet.vertices[sheet.faces].mean(axis=1), setup)
    if not hit.any():
        server.scene.remove_by_name(name)
        return
    server.scene.add_mesh_simple(
        name,
        sheet.raised(7e-4).astype(np.float32),
        sheet.faces[hit].astype(np.uint32),
        color=colour.ACCENT,
        opacity=0.55,
        side="double",
        cast_shadow=False,
        receive_shadow=False,
    )


def draw_probe(server: viser.ViserServer, setup: Setup) -> None:
    """Draw the probe at its own node, in TCP coordinates: array face, nozzle, beam and array axis."""
    node = f"{LAYERS['probe'].node}/tcp"
    probe, tool = setup.probe, setup.tool
    server.scene.add_frame(node, show_axes=False)
    half = max(probe.swath_mm, 2.0) / 2.0
    face = trimesh.creation.box([2 * half, max(probe.elevation_mm, 1.0), 3.0])
    face.apply_translation([0, 0, -1.5])
    _solid(server, f"{node}/face", face, colour.ACCENT, None)
    if tool.nozzle_length_mm > 0 and tool.nozzle_radius_mm > 0:
        nozzle = trimesh.creation.cylinder(tool.nozzle_radius_mm, tool.nozzle_length_mm, sections=32)
        nozzle.apply_translation([0, 0, -tool.nozzle_length_mm / 2.0 - 3.0])
        _solid(server, f"{node}/nozzle", nozzle, colour.FAINT, 0.35)
    x = np.linspace(-half, half, 9 if probe.laws > 1 else 1) if probe.laws > 1 else np.zeros(1)
    start = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=1)
    lines(
        server,
        f"{node}/beam",
        np.stack([start, start + np.array([0.0, 0.0, setup.standoff_mm])], axis=1),
        colour.ACCENT,
        1.6,
    )


def _solid(
    server: viser.ViserServer, name: str, mesh: trimesh.Trimesh, rgb: tuple[int, int, int], opacity: float | None
) -> None:
    server.scene.add_mesh_simple(
        name,
        np.asarray(mesh.vertices * M, dtype=np.float32),
        np.asarray(mesh.faces, dtype=np.uint32),
        color=rgb,
        opacity=opacity,
        flat_shading=True,
        side="double",
        cast_shadow=False,
        receive_shadow=False,
    )


def role_name(role: int) -> str:
    """Return the words for a role."""
    return Role(role).name.lower().replace("_", " ")
