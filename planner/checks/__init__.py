"""What can go wrong on a path, found before the robot moves."""

from planner.checks.check import check, check_path
from planner.checks.path_check import PathCheck

__all__ = ["PathCheck", "check", "check_path"]
