"""The hint to turn the passes: travel on a cylinder in closed form."""

import re

import numpy as np
import pytest

from benchmarks.planning.panels import Panel
from planner.checks.orientation import orientation_issues
from tests.path.shapes import crystal, curved_of, plate, setup_of
from tests.surface.shapes import grid

RADIUS, LONG, WIDE = 200.0, 600.0, 250.0


def arc() -> Panel:
    v, f = grid(np.linspace(0, LONG, 30), np.linspace(-WIDE / 2, WIDE / 2, 40), lambda x, y: 0.0 * x)
    a = v[:, 1] / RADIUS
    bent = np.stack([v[:, 0], RADIUS * np.sin(a), RADIUS * np.cos(a)], axis=1)
    return Panel("arc", bent, f, lambda p: p)


def test_travel_both_ways_round_a_cylinder():
    found = orientation_issues(curved_of(arc()), setup_of())
    metres = [float(m) for m in re.findall(r"([0-9.]+) m[ ,]", found[0].message)]
    swath = 2.0 * RADIUS * np.tan(np.radians(1.0))
    assert metres[0] == pytest.approx(LONG * WIDE / (0.75 * swath) / 1000.0, rel=0.03)
    assert metres[1] == pytest.approx(LONG * WIDE / (0.75 * 30.0) / 1000.0, rel=0.03)
    assert "90" in found[0].remedy


def test_nothing_is_said_where_it_makes_no_difference_or_the_step_is_given():
    assert orientation_issues(curved_of(arc()), setup_of(direction_deg=90.0)) == []
    assert orientation_issues(curved_of(plate()), setup_of()) == []
    assert orientation_issues(curved_of(arc()), crystal()) == []
