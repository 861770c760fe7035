"""Geometry of the probe in the TCP frame: TCP z is the beam, TCP x the array axis."""

import numpy as np

from planner.frames import Array, Transform
from planner.setup import Probe, Tool

_AXIS = {
    name: sign * np.eye(3)[i] for i, letter in enumerate("xyz") for name, sign in ((letter, 1.0), ("-" + letter, -1.0))
}


def law_offsets_mm(probe: Probe) -> Array:
    """Return the position x_k of each law's origin on the array axis (TCP x), shape (laws,), mm.

    x_k = (k - (N + 1) / 2) pitch for k = 1..N; `reversed` mirrors the sign.
    """
    k = np.arange(1, probe.laws + 1, dtype=np.float64)
    x = (k - (probe.laws + 1) / 2.0) * probe.pitch_mm
    return -x if probe.reversed else x


def law_origins_tcp(probe: Probe) -> Array:
    """Return the origins of all laws in the TCP frame, (laws, 3), mm: on the array axis, behind the TCP."""
    origins = np.zeros((probe.laws, 3))
    origins[:, 0] = law_offsets_mm(probe)
    origins[:, 2] = -probe.face_offset_mm
    return origins


def tool_axes(tool: Tool) -> Transform:
    """Return `T_tcp_tcp`-like rotation from EchoBase's TCP (beam z, array x) to the tool as taught, about the TCP.

    A pose of the taught tool is `T_base_tcp @ tool_axes(tool).inv()`; with beam z and array x it is the identity.
    The frame names are both `tcp`: it is the same point with its axes renamed.
    """
    beam, array = _AXIS[tool.beam_axis], _AXIS[tool.array_axis]
    return Transform.from_axes("tcp", "tcp", array, np.cross(beam, array), beam, np.zeros(3))
