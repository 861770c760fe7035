"""`ToolPath`: where the probe goes on the part, pose by pose, tied to the surface it follows."""

from dataclasses import dataclass, fields, replace
from enum import IntEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array, Transform

PathKind = Literal["alignment", "inspection", "corrected"]


class Role(IntEnum):
    """What a pose is for, in the order of a pass."""

    APPROACH = 0
    """Above the lead-in, along the normal."""
    LEAD_IN = 1
    DATA = 2
    """Readings are taken on the way from one DATA pose to the next of the same pass."""
    LEAD_OUT = 3
    RETRACT = 4
    """Above the lead-out, along the normal."""
    LINK = 5
    """Travel between passes, clear of the part."""


@dataclass(frozen=True, eq=False)
class ToolPath:
    """A path of n poses in passes; the i-th row of every array belongs to the i-th pose.

    Ts_part_contact: on the surface (z outward normal, x along travel), stack n.
    standoff_mm (n,): distance of the TCP from the contact point along the normal (larger on approach and retract).
    heading (n,): +1 or -1; the array axis (TCP x) is `heading` times the contact y axis, so that it keeps its direction
    in space on forth and back passes.
    pass_id (n,): 0, 1, ... in order of travel. role (n,): `Role`. face (n,): index into `part.faces` of the contact
    point, -1 where it is off the surface (overrun past an edge). bary (n, 3): its barycentric coordinates.
    """

    kind: PathKind
    Ts_part_contact: Transform
    standoff_mm: Array
    heading: NDArray[np.int8]
    pass_id: NDArray[np.int32]
    role: NDArray[np.uint8]
    face: NDArray[np.int32]
    bary: Array

    def __post_init__(self) -> None:
        n = len(self.Ts_part_contact)
        for f in fields(self)[2:]:
            if len(getattr(self, f.name)) != n:
                raise ValueError(f"ToolPath.{f.name} has {len(getattr(self, f.name))} rows, not {n}")

    def __len__(self) -> int:
        return len(self.Ts_part_contact)

    @property
    def Ts_part_tcp(self) -> Transform:
        """TCP poses in part: z against the normal, x across the travel, `standoff_mm` off the surface."""
        return self.Ts_part_contact @ contact_to_tcp(self.standoff_mm, self.heading)

    @property
    def is_data(self) -> NDArray[np.bool_]:
        """Which poses are DATA (n,)."""
        return self.role == Role.DATA

    @property
    def passes(self) -> int:
        """Number of passes."""
        return int(self.pass_id.max(initial=-1)) + 1

    def take(self, index: NDArray[np.intp] | NDArray[np.bool_] | slice) -> "ToolPath":
        """Return the path of the selected poses, in order."""
        arrays = {f.name: getattr(self, f.name)[index] for f in fields(self)[1:]}
        return replace(self, **arrays)


def contact_to_tcp(standoff_mm: Array, heading: NDArray[np.int8]) -> Transform:
    """Return `Ts_contact_tcp`, stack n: the turn and lift from `contact` (z outward, x travel) to `tcp` (z beam, x array).

    TCP x = heading * contact y (across the travel), TCP z = -contact z, TCP y completes the right-handed triad.
    """
    n = len(standoff_mm)
    h = heading.astype(np.float64)
    zero = np.zeros(n)
    x = np.stack([zero, h, zero], axis=1)
    y = np.stack([h, zero, zero], axis=1)
    z = np.tile([0.0, 0.0, -1.0], (n, 1))
    origin = np.stack([zero, zero, np.asarray(standoff_mm, dtype=np.float64)], axis=1)
    return Transform.from_axes("contact", "tcp", x, y, z, origin)
