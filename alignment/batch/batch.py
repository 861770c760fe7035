"""`Batch`: the fixture's common offset and scatter, each part's own departure, and what to write into `setup.json`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from alignment.batch.axes import BatchAxis, batch_axes
from alignment.batch.evidence import PartEvidence
from alignment.batch.scatter import LEAST_FOR_OUTLIERS, LEAST_FOR_SCATTER, Common, common
from alignment.estimate.motion import moved
from planner.errors import fail
from planner.frames import AXES, Array, Transform
from planner.issues import Issue

# How improbable a part must be to be named, over all parts and directions together.
ODD = 0.05
SAME_CENTRE_MM = 0.01


@dataclass(frozen=True, eq=False)
class Batch:
    """k parts along d directions, in the unit of each.

    values, sigma, departure, z (k, d): place of each part, its scan's standard deviation, difference from the common place,
    the same in standard deviations; NaN where its scan does not show it. common (d,). T_base_common: nominal base to
    the common place, directions that no scan shows left at nominal. odd (k, d): named as an outlier.
    """

    names: tuple[str, ...]
    frame: str
    frame_axes: Array
    axes: tuple[BatchAxis, ...]
    values: Array
    sigma: Array
    departure: Array
    z: Array
    common: tuple[Common, ...]
    odd: Array
    T_base_common: Transform
    centre_mm: Array
    prior_sigma: Array
    issues: tuple[Issue, ...]

    @property
    def offset_known(self) -> bool:
        """True if the common place differs from nominal along some direction (95 %)."""
        return any(abs(c.mean) > c.half_95 for c in self.common)

    def to_json(self) -> dict[str, Any]:
        """Return the content of batch.json but for patch, shape and inputs."""
        return {
            "parts": [self._part(i) for i in range(len(self.names))],
            "frame": self.frame,
            "frame_axes_base": self.frame_axes.T.tolist(),
            "centroid_mm": self.centre_mm.tolist(),
            "directions": [self._direction(j) for j in range(len(self.axes))],
            "common": dict(zip(pose_keys(), (float(v) for v in self.T_base_common.xyzabc), strict=True)),
            "issues": [i.to_json() for i in self.issues],
        }

    def _part(self, i: int) -> dict[str, Any]:
        rows = {}
        for j, axis in enumerate(self.axes):
            seen = bool(np.isfinite(self.values[i, j]))
            numbers = (self.values, self.sigma, self.departure, self.z)
            of = {k: float(v[i, j]) if seen else None for k, v in zip(NUMBERS, numbers, strict=True)}
            rows[axis.name] = {**of, "odd": bool(self.odd[i, j])}
        return {"name": self.names[i], "directions": rows}

    def _direction(self, j: int) -> dict[str, Any]:
        axis, c = self.axes[j], self.common[j]
        return {
            "name": axis.name,
            "text": axis.text,
            "unit": axis.unit,
            "vector": (axis.vector * self.prior_sigma).tolist(),
            "parts": int(np.isfinite(self.values[:, j]).sum()),
            "mean": c.mean,
            "half_95": c.half_95,
            "scatter": c.scatter,
            "scatter_95": None if c.scatter_95 is None else list(c.scatter_95),
        }


NUMBERS = ("value", "sigma", "departure", "z")


def pose_keys() -> list[str]:
    """Return x_mm .. c_deg."""
    return [f"{k}_{'mm' if k in 'xyz' else 'deg'}" for k in AXES]


def batch(parts: Sequence[PartEvidence], face_axes: Array | None = None) -> Batch:
    """Return what k >= 2 parts of one plan have in common along the directions that two or more of their scans show.

    face_axes (3, 3): axes of the inspected face in base, as columns, its normal last; for a face that stands askew.
    Raises EchoBaseError `batch-parts` with fewer, `batch-plans` if their nominal places differ, `batch-unseen` if no
    direction is shown by two.
    """
    if len(parts) < 2:
        raise fail(
            "batch-parts", f"A batch needs two parts or more; here are {len(parts)}.", "Add corrections or scans."
        )
    centre, prior = parts[0].centre_mm, parts[0].prior_sigma
    for p in parts:
        if np.abs(p.centre_mm - centre).max() > SAME_CENTRE_MM or np.abs(p.prior_sigma / prior - 1.0).max() > 1e-3:
            raise fail(
                "batch-plans",
                "Its nominal placement or its fixture differs from that of the first part.",
                "Compare parts of one plan.",
                p.name,
            )
    frame, frame_axes, axes = batch_axes(parts, face_axes)
    if not axes:
        raise fail(
            "batch-unseen", "No direction is shown by two of the scans.", "Cross edges, or cover more of the surface."
        )
    shape = (len(parts), len(axes))
    values, sigma, departure, z, chance = (np.full(shape, np.nan) for _ in range(5))
    found = []
    for j, axis in enumerate(axes):
        told = [p.along(axis.vector) for p in parts]
        seen = np.array([t is not None for t in told])
        y, s2 = np.array([t for t in told if t is not None]).T
        c = common(y, s2)
        values[seen, j], sigma[seen, j] = y * axis.scale, np.sqrt(s2) * axis.scale
        departure[seen, j] = (y - c.mean) * axis.scale
        spread = s2 + (1.0 if c.scatter is None else c.scatter**2)
        z[seen, j], chance[seen, j] = (y - c.mean) / np.sqrt(spread), c.odd
        found.append(_scaled(c, axis.scale))
    odd = np.nan_to_num(chance, nan=1.0) < ODD / max(np.isfinite(chance).sum(), 1)
    xi = sum((a.vector * prior * c.mean / a.scale for a, c in zip(axes, found, strict=True)), np.zeros(6))
    place = Transform.identity("base", "basecorr")
    T = moved(place, np.r_[xi[:3], np.zeros(3)], centre)
    T = moved(T, np.r_[np.zeros(3), xi[3:]], centre)
    names = tuple(p.name for p in parts)
    issues = tuple(_say(names, axes, values, sigma, odd))
    return Batch(
        names, frame, frame_axes, axes, values, sigma, departure, z, tuple(found), odd, T, centre, prior, issues
    )


def _scaled(c: Common, k: float) -> Common:
    interval = None if c.scatter_95 is None else (k * c.scatter_95[0], k * c.scatter_95[1])
    scatter, ahead = (None if v is None else k * v for v in (c.scatter, c.next_sigma))
    return Common(k * c.mean, k * c.half_95, scatter, interval, ahead, c.odd)


def _say(names: tuple[str, ...], axes: tuple[BatchAxis, ...], values: Array, sigma: Array, odd: Array) -> list[Issue]:
    issues = []
    k = len(names)
    for i, j in zip(*np.nonzero(odd), strict=True):
        others = np.isfinite(values[:, j]) & (np.arange(k) != i)
        rest, axis = common(values[others, j], sigma[others, j] ** 2), axes[j]
        off = float(values[i, j] - rest.mean)
        digits = 2 if axis.unit == "mm" else 3
        without = (
            f"common {rest.mean:+.{digits}f} +-{rest.half_95:.{digits}f} {axis.unit}, scatter {rest.scatter:.{digits}f}"
        )
        issues.append(
            Issue(
                "warning",
                "batch-outlier",
                f"{names[i]} {_stands(axis, off, digits)} than the other {int(others.sum())}.",
                f"Look at how it sat in the fixture, and leave it out; without it: {without} {axis.unit}.",
                names[i],
            )
        )
    if k < LEAST_FOR_SCATTER:
        issues.append(
            Issue(
                "info",
                "batch-few",
                f"{k} parts cannot tell how much parts differ; the scatter is taken from fixture in the setup.",
                "Add a third part, better five.",
            )
        )
    elif k < LEAST_FOR_OUTLIERS:
        issues.append(
            Issue("info", "batch-few", f"Among {k} parts none can be called an outlier.", "Five parts can show one.")
        )
    shown = {a.name for a in axes if a.unit != "sigma"}
    unseen = [n for n in ("rx", "ry", "rz", "x", "y", "z") if n not in shown]
    if unseen:
        issues.append(
            Issue(
                "info",
                "batch-unseen",
                f"Nothing is said of {', '.join(unseen)}: fewer than two scans show it.",
                "Cross edges with the alignment scan, or cover more of the surface.",
            )
        )
    return issues


def _stands(axis: BatchAxis, off: float, digits: int) -> str:
    if axis.unit == "mm":
        return f"sits {abs(off):.{digits}f} mm {'further' if off > 0 else 'less far'} along {axis.name}"
    if axis.unit == "deg":
        return f"is turned by {abs(off):.{digits}f} deg {'more' if off > 0 else 'less'} about {axis.name[-1]}"
    return f"lies {abs(off):.{digits}f} sigma of the fixture {'further' if off > 0 else 'less far'} along {axis.name}"
