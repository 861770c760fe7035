"""The robot: models as data files, closed-form kinematics, Status and Turn, reach of a whole path, backup import."""

from planner.robot.first import FirstAxes, first_axes
from planner.robot.kinematics import flange_poses, forward, inverse, status, turn
from planner.robot.load import load_robot, robot_names
from planner.robot.model import Robot
from planner.robot.reach import Reach, reach

__all__ = [
    "FirstAxes",
    "Reach",
    "Robot",
    "first_axes",
    "flange_poses",
    "forward",
    "inverse",
    "load_robot",
    "reach",
    "robot_names",
    "status",
    "turn",
]
