"""Standoff, tilt, amplitude and shares: expected of a path before it is run, and measured by a scan after it was."""

from alignment.metrics.assess import Assessed, Assessment, assess, compare
from alignment.metrics.expected import Expected, expected

__all__ = ["Assessed", "Assessment", "Expected", "assess", "compare", "expected"]
