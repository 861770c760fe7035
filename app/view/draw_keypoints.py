"""Key points with their verdicts, as spheres and labels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
import viser

from app.view import colour
from app.view.draw_part import M, label
from app.view.layers import LAYERS
from app.view.model import Found, Insight
from planner.frames import Array
from planner.keypoint import KeyPoint

MAX_LABELS = 80


@dataclass(frozen=True)
class Mark:
    """How a key point is shown: tone (a verdict colour) and the word beside its name."""

    tone: str
    word: str


def marks(points: Sequence[KeyPoint], insight: Insight | None, found: Found | None) -> list[Mark]:
    """Return the mark of every point: what the alignment said if there is one, else what the planner says."""
    out = []
    worst: dict[str, tuple[int, str]] = {}
    for issue in insight.issues if insight else ():
        rank = {"error": 2, "warning": 1}.get(issue.severity, 0)
        name = issue.where.rsplit(" ", 1)[-1]
        if rank > worst.get(name, (0, ""))[0]:
            worst[name] = (rank, short(issue.code))
    for point in points:
        status = (found.keypoint_status.get(point.id) if found else None) or None
        if status is not None:
            out.append(Mark("good", "ok") if status[0] == "matched" else Mark("bad", f"x {status[0]}"))
        elif point.id in worst:
            rank, word = worst[point.id]
            out.append(Mark("bad" if rank == 2 else "warn", f"{'x' if rank == 2 else '!'} {word}"))
        else:
            out.append(Mark("good", "ok") if insight is not None else Mark("none", ""))
    return out


def short(code: str) -> str:
    """Return the telling word of an issue code: `keypoint-near-edge` -> `edge`."""
    words = [
        w for w in code.split("-") if w not in {"keypoint", "point", "near", "too", "at", "on", "the", "is", "key"}
    ]
    return " ".join(words[-2:]) if words else code


def draw_keypoints(
    server: viser.ViserServer, points: Sequence[KeyPoint], shown: Sequence[Mark], radius_mm: float, old: set[str]
) -> set[str]:
    """Draw the points; return the names of their labels, so that the next call can remove those that are gone."""
    node = LAYERS["keypoints"].node
    labels: set[str] = set()
    if points:
        ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
        where = np.array([p.xyz() for p in points]) * M
        server.scene.add_batched_meshes_simple(
            f"{node}/balls",
            np.asarray(ball.vertices, dtype=np.float32),
            np.asarray(ball.faces, dtype=np.uint32),
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (len(points), 1)).astype(np.float32),
            batched_positions=where.astype(np.float32),
            batched_scales=np.full(len(points), radius_mm * M, dtype=np.float32),
            batched_colors=np.array([colour.VERDICT[m.tone] for m in shown], dtype=np.uint8),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
    else:
        server.scene.remove_by_name(f"{node}/balls")
    for point, mark in list(zip(points, shown, strict=True))[:MAX_LABELS]:
        name = f"{node}/label_{point.id}"
        text = f"{point.id} {mark.word}".strip()
        x, y, z = point.xyz()
        label(server, name, text, (x, y, z + radius_mm * 1.6))
        labels.add(name)
    for name in old - labels:
        server.scene.remove_by_name(name)
    return labels


def positions(points: Sequence[KeyPoint]) -> Array:
    """Return the positions (n, 3) in part, mm."""
    return np.array([p.xyz() for p in points]).reshape(-1, 3)
