"""Wrong inputs, recognised and named: what else could have produced this scan?"""

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.capture import Captured
from alignment.estimate.problem import Problem
from planner.issues import Issue
from planner.setup import Setup


def temperature_issue(setup: Setup) -> list[Issue]:
    """Return what a wrong water temperature would do to Z."""
    return []


def floor_issues(problem: Problem) -> list[Issue]:
    """Return where the tessellation, not the scan, limits the result."""
    return []


def diagnose_fit(cloud: PointCloud, problem: Problem, found) -> list[Issue]:
    return []


def diagnose_lost(cloud: PointCloud, problem: Problem, captured: Captured) -> list[Issue]:
    return [Issue("error", "scan-not-on-part", "the scan does not fit the part.", "Check part, base and units.")]
