"""Which directions a batch is told along: axes of base, or of the inspected face, and combinations where it must be."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alignment.batch.evidence import SEEN_SHARE, PartEvidence
from alignment.estimate.directions import Direction
from alignment.estimate.verdict import describe
from planner.frames import Array

NAMES = ("rx", "ry", "rz", "x", "y", "z")
LEAST_PARTS = 2


@dataclass(frozen=True, eq=False)
class BatchAxis:
    """A direction that scans of the batch show. vector (6,): unit length in prior standard deviations.

    text: the motion in words. unit: mm, deg, or "sigma" (of the fixture) for a motion that is shift and turn at once.
    scale: unit per prior sigma.
    """

    name: str
    text: str
    vector: Array
    unit: str
    scale: float


def batch_axes(
    parts: Sequence[PartEvidence], face_axes: Array | None = None
) -> tuple[str, Array, tuple[BatchAxis, ...]]:
    """Return (frame, its axes in base as columns (3, 3), directions).

    Axes of base are preferred; those of the inspected face (face_axes (3, 3), columns, z its normal) are taken where more
    of them are seen, as on a flat face that stands askew. What else the parts show becomes combined directions.
    """
    candidates = [("base", np.eye(3)), *([("face", face_axes)] if face_axes is not None else [])]
    frame, axes = max(candidates, key=lambda c: sum(_seen_by(parts, v) >= LEAST_PARTS for v in _vectors(c[1])))
    prior = parts[0].prior_sigma
    found = [
        BatchAxis(
            name, _text(name, frame), v, "deg" if i < 3 else "mm", float(np.degrees(prior[i]) if i < 3 else prior[i])
        )
        for i, (name, v) in enumerate(zip(NAMES, _vectors(axes), strict=True))
        if _seen_by(parts, v) >= LEAST_PARTS
    ]
    taken = np.array([a.vector for a in found]).reshape(-1, 6)
    rest = np.eye(6) - taken.T @ taken
    together = sum((rest @ p.seen @ p.seen.T @ rest for p in parts), np.zeros((6, 6)))
    value, vector = np.linalg.eigh(together)
    for share, v in sorted(zip(value, vector.T, strict=True), key=lambda t: -t[0]):
        if share >= LEAST_PARTS * SEEN_SHARE and _seen_by(parts, v) >= LEAST_PARTS:
            signed = v * np.sign(v[np.argmax(np.abs(v))])
            mixed = Direction("measured", 1.0, signed * prior, 0.0, 0.0)
            found.append(BatchAxis(f"combined {len(found) - len(taken) + 1}", describe(mixed), signed, "sigma", 1.0))
    return frame, axes, tuple(found)


def _text(name: str, frame: str) -> str:
    motion = f"a turn about {name[-1]}" if name.startswith("r") else f"a shift along {name}"
    return motion if frame == "base" else f"{motion} of the face"


def _vectors(axes: Array) -> Array:
    """Turns about, and shifts along, the columns of axes (3, 3): rows (6, 6)."""
    return np.block([[axes.T, np.zeros((3, 3))], [np.zeros((3, 3)), axes.T]])


def _seen_by(parts: Sequence[PartEvidence], direction: Array) -> int:
    return sum(p.along(direction) is not None for p in parts)
