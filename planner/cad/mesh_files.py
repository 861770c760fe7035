"""OBJ, PLY and GLB through trimesh, with the checks that it leaves out. Runs in the sandbox."""

import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import fail

MAX_ELEMENTS = 30_000_000
Result = tuple[dict[str, NDArray[Any]], dict[str, Any]]


def parse_obj(source: Path, options: dict[str, Any]) -> Result:
    """Return vertices and faces of an OBJ: geometry only, in the file's unit; groups, materials and normals are dropped."""
    name = str(options["name"])
    kept: list[bytes] = []
    vertices = polygons = 0
    for line in source.read_bytes().replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == b"v":
            vertices += 1
            kept.append(b" ".join(words[:4]))
        elif words[0] == b"f":
            polygons += 1
            kept.append(b" ".join([b"f", *(w.partition(b"/")[0] for w in words[1:])]))
    if not vertices or not polygons:
        what = "no faces" if vertices else "no vertices: it is not an OBJ mesh"
        raise fail("part-empty", f"The file holds {what}.", "Export the part as a mesh.", name)
    arrays = _load(io.BytesIO(b"\n".join(kept) + b"\n"), "obj", name)
    _expect_count(len(arrays["faces"]), polygons, "faces", name)
    return arrays, {"kind": "OBJ"}


def parse_ply(source: Path, options: dict[str, Any]) -> Result:
    """Return vertices and faces of a PLY, in the file's unit."""
    name = str(options["name"])
    data = source.read_bytes()
    header, mark, _ = data[:65536].partition(b"end_header")
    counts = {k.decode(): int(n) for k, n in re.findall(rb"element\s+(\w+)\s+(\d+)", header)}
    if not mark or "vertex" not in counts:
        raise fail("part-damaged", "The PLY header is incomplete.", "Export it again.", name)
    if not counts.get("face"):
        raise fail(
            "part-empty",
            "The file holds points but no faces.",
            "Give the CAD as a mesh; point clouds are scan data.",
            name,
        )
    if max(counts.values()) > min(MAX_ELEMENTS, len(data)):
        raise fail(
            "part-truncated", "The header declares more elements than the file can hold.", "Export it again.", name
        )
    arrays = _load(io.BytesIO(data), "ply", name)
    _expect_count(len(arrays["vertices"]), counts["vertex"], "vertices", name)
    _expect_count(len(arrays["faces"]), counts["face"], "faces", name)
    return arrays, {"kind": "PLY"}


def parse_glb(source: Path, options: dict[str, Any]) -> Result:
    """Return vertices and faces of a GLB in metres, all nodes placed."""
    name = str(options["name"])
    data = source.read_bytes()
    _check_glb(data, name)
    return glb_mesh(data, name), {"kind": "GLB"}


def glb_mesh(data: bytes, name: str) -> dict[str, NDArray[Any]]:
    """Return vertices (v, 3), m, and faces (f, 3) of the bytes of a GLB file."""
    return _load(io.BytesIO(data), "glb", name)


def _check_glb(data: bytes, name: str) -> None:
    """Raise unless the GLB's lengths, accessors and nodes are sane; a few hundred bytes can ask for gigabytes otherwise."""
    size = int.from_bytes(data[8:12], "little")
    length = int.from_bytes(data[12:16], "little")
    if len(data) < 20 or size != len(data) or 20 + length > len(data):
        raise fail(
            "part-truncated", f"The file declares {size} bytes but has {len(data)}.", "Export or copy it again.", name
        )
    try:
        tree = json.loads(data[20 : 20 + length])
        accessors, nodes, views = (tree.get(key, []) for key in ("accessors", "nodes", "bufferViews"))
        total = sum(int(a["count"]) for a in accessors)
        loose = [a for a in accessors if "bufferView" not in a or "sparse" in a]
        outside = [b for b in tree.get("buffers", []) + tree.get("images", []) if "uri" in b]
        required = tree.get("extensionsRequired", [])
        reach = max((int(v.get("byteOffset", 0)) + int(v["byteLength"]) for v in views), default=0)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise fail("part-damaged", "The GLB's description is not valid.", "Export it again.", name) from error
    if not accessors or not tree.get("meshes"):
        raise fail("part-empty", "The file holds no mesh.", "Export the part again, as a mesh.", name)
    if outside or required or loose:
        what = "refers to other files" if outside else f"needs {', '.join(map(str, required)) or 'sparse accessors'}"
        raise fail("part-format", f"The GLB {what}.", "Export it as one plain, uncompressed GLB, or as STL.", name)
    if total > MAX_ELEMENTS or reach > len(data) or len(nodes) > 100_000 or _depth(nodes) > 200:
        raise fail("part-damaged", "The GLB declares more than the file can hold.", "Export it again.", name)


def _depth(nodes: list[dict[str, Any]]) -> int:
    """Return the depth of the node tree; more than the number of nodes where it runs in circles."""
    depth, level = 0, set(range(len(nodes)))
    while level and depth <= len(nodes):
        level = {int(c) for i in level if i < len(nodes) for c in nodes[i].get("children", [])}
        depth += 1
        if depth > 200:
            break
    return depth


def _load(file: io.BytesIO, file_type: str, name: str) -> dict[str, NDArray[Any]]:
    import trimesh  # noqa: PLC0415  takes half a second; the strict STL reader needs none of it

    scene = trimesh.load_scene(file, file_type=file_type, process=False, resolver=None)
    meshes = [m for m in scene.dump(concatenate=False) if isinstance(m, trimesh.Trimesh) and len(m.faces)]
    if not meshes:
        raise fail("part-empty", "The file holds no triangles.", "Export the part again, as a mesh.", name)
    first = np.cumsum([0] + [len(m.vertices) for m in meshes])
    vertices = np.concatenate([np.asarray(m.vertices, dtype=np.float64) for m in meshes])
    faces = np.concatenate([np.asarray(m.faces, dtype=np.int64) + k for m, k in zip(meshes, first, strict=False)])
    return {"vertices": vertices, "faces": faces}


def _expect_count(found: int, declared: int, what: str, name: str) -> None:
    if found < declared:
        raise fail(
            "part-damaged",
            f"The file declares {declared} {what} but only {found} could be read.",
            "Export it again.",
            name,
        )
