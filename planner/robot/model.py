"""`Robot`: a six-axis arm with ortho-parallel base and spherical wrist, as a data file states it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Self

import numpy as np
from py_opw_kinematics import KinematicModel
from py_opw_kinematics import Robot as OpwRobot
from pydantic import Field, model_validator

from planner.frames import Array
from planner.setup import Mm, PositiveMm, Strict

AxisDeg = Annotated[float, Field(ge=-3600.0, le=3600.0)]
Text = Annotated[str, Field(min_length=1, max_length=400)]
ROBOT_NAME = r"^[a-z0-9][a-z0-9-]{0,63}$"


class Opw(Strict):
    """Lengths of the arm (mm) in the notation of Brandstötter, Angerer, Hofbaur, Austrian Robotics Workshop 2014."""

    a1_mm: Mm
    """Axis 1 to axis 2, horizontally."""
    a2_mm: Mm
    """Forearm axis to elbow; positive: the wrist lies below the elbow when the forearm points forward."""
    b_mm: Mm = 0.0
    """Sideways offset of the arm plane."""
    c1_mm: Mm
    """Foot to axis 2, vertically."""
    c2_mm: PositiveMm
    """Axis 2 to axis 3."""
    c3_mm: PositiveMm
    """Axis 3 to the wrist centre, along the forearm."""
    c4_mm: Mm
    """Wrist centre to flange."""


class Axis(Strict):
    """Software limits and top speed of one axis."""

    min_deg: AxisDeg
    max_deg: AxisDeg
    speed_deg_s: Annotated[float, Field(gt=0.0, le=5000.0)] | None
    """Largest speed; null: not known, so not checked."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.min_deg >= self.max_deg:
            raise ValueError("min_deg must be below max_deg")
        return self


class Sources(Strict):
    """Where each group of numbers comes from."""

    geometry: Text
    limits: Text
    speeds: Text
    wrist: Text


class RobotFile(Strict):
    """A robot data file, `models/<name>.json`."""

    name: str = Field(pattern=ROBOT_NAME)
    title: Text
    opw: Opw
    offset_deg: tuple[AxisDeg, AxisDeg, AxisDeg, AxisDeg, AxisDeg, AxisDeg] = (0.0, -90.0, 0.0, 0.0, 0.0, 0.0)
    """Axis reading at the model's zero; KUKA reads A2 = -90 with the upper arm upright."""
    reversed: tuple[bool, bool, bool, bool, bool, bool] = (True, False, False, True, False, True)
    """Axes that turn against the right-hand rule of the model; KUKA's A1, A4 and A6."""
    axes: tuple[Axis, Axis, Axis, Axis, Axis, Axis]
    wrist_radius_mm: PositiveMm
    """Radius about the wrist centre that the collision check keeps clear of the part."""
    sources: Sources
    notes: tuple[Text, ...] = ()


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot ready to compute with: its file and the closed-form kinematics built from it.

    limits_deg (6, 2); speeds_deg_s (6,), NaN where unknown.
    """

    file: RobotFile

    @property
    def name(self) -> str:
        """Name of the data file."""
        return self.file.name

    @cached_property
    def limits_deg(self) -> Array:
        """Software limits (6, 2), deg."""
        return np.array([(axis.min_deg, axis.max_deg) for axis in self.file.axes])

    @cached_property
    def speeds_deg_s(self) -> Array:
        """Top speeds (6,), deg/s; NaN where the file does not know."""
        return np.array([np.nan if axis.speed_deg_s is None else axis.speed_deg_s for axis in self.file.axes])

    @property
    def reach_mm(self) -> float:
        """Largest horizontal distance of the wrist centre from axis 1, arm stretched (mm), limits apart."""
        o = self.file.opw
        return float(o.a1_mm + o.c2_mm + np.hypot(o.c3_mm, o.a2_mm))

    @property
    def elbow_singular_deg(self) -> float:
        """A3 at which elbow and wrist lie in one line with axis 2, the arm stretched (deg)."""
        o = self.file.opw
        return float(-np.degrees(np.arctan2(o.a2_mm, o.c3_mm)))

    @cached_property
    def opw(self) -> OpwRobot:
        """The closed-form solver, in mm and deg."""
        o = self.file.opw
        model = KinematicModel(
            a1=o.a1_mm,
            a2=o.a2_mm,
            b=o.b_mm,
            c1=o.c1_mm,
            c2=o.c2_mm,
            c3=o.c3_mm,
            c4=o.c4_mm,
            offsets=self.file.offset_deg,
            flip_axes=self.file.reversed,
        )
        return OpwRobot(model, degrees=True)
