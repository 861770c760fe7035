"""A binary glTF of one mesh with a colour per vertex, unlit: what is measured is never shaded. Spec: Khronos glTF 2.0."""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.view.colour import linear
from planner.frames import Array
from planner.part import Faces

_FLOAT, _UINT, _USHORT = 5126, 5125, 5123


def coloured_mesh(vertices_m: Array, faces: Faces, rgb: NDArray[np.uint8]) -> bytes:
    """Return the GLB of vertices (v, 3) in m, faces (f, 3) and sRGB colours (v, 3).

    glTF colours are linear light; 16 bits keep the dark end of a map free of steps.
    """
    position = np.ascontiguousarray(vertices_m, dtype=np.float32)
    colour = np.full((len(position), 4), 65535, dtype=np.uint16)
    colour[:, :3] = (linear(rgb) * 65535.0).round().astype(np.uint16)
    index = np.ascontiguousarray(faces, dtype=np.uint32)
    blobs = [position.tobytes(), colour.tobytes(), index.tobytes()]
    views: list[dict[str, Any]] = []
    offset = 0
    for blob, target in zip(blobs, (34962, 34962, 34963), strict=True):
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(blob), "target": target})
        offset += len(blob)
    low, high = (position.min(axis=0).tolist(), position.max(axis=0).tolist()) if len(position) else ([0] * 3, [0] * 3)
    document = {
        "asset": {"version": "2.0", "generator": "EchoBase"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "materials": [{"doubleSided": True, "extensions": {"KHR_materials_unlit": {}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": _FLOAT, "count": len(position), "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": _USHORT, "normalized": True, "count": len(position), "type": "VEC4"},
            {"bufferView": 2, "componentType": _UINT, "count": index.size, "type": "SCALAR"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": offset}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(blobs)
    head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(body))
    chunks = (head, struct.pack("<I4s", len(text), b"JSON"), text, struct.pack("<I4s", len(body), b"BIN\0"), body)
    return b"".join(chunks)
