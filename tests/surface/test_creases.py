"""Creases between the faces of a surface: how many faces, how sharp, how long."""

import numpy as np
import pytest

from planner.part import Part, Provenance
from planner.surface.creases import creases_of
from planner.surface.select import inspection_surface


def roof(turn_deg: float, length: float = 80.0, width: float = 30.0) -> Part:
    """Two rectangles that meet along the x axis and turn by an angle there."""
    half = np.radians(turn_deg) / 2
    down = width * np.array([0.0, np.cos(half), -np.sin(half)])
    a, b = np.zeros(3), np.array([length, 0.0, 0.0])
    vertices = np.array([a, b, b + down, a + down, a + down * [1, -1, 1], b + down * [1, -1, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 0, 4], [1, 4, 5]], dtype=np.int32)
    return Part(vertices, faces, Provenance("roof", "0", "mm"))


@pytest.mark.parametrize("turn", [35.0, 60.0, 90.0])
def test_two_faces_meet_at_the_angle_and_length_they_were_built_with(turn):
    half = np.radians(turn) / 2
    seeds = [[40.0, y * np.cos(half), -10.0 * np.sin(half)] for y in (10.0, -10.0)]
    found = creases_of(inspection_surface(roof(turn), seeds))
    assert found.faces == 2
    assert found.turn_deg == pytest.approx(turn, abs=1e-9)
    assert found.length_mm == pytest.approx(80.0)


def test_one_face_and_a_gentle_bend_have_none():
    assert creases_of(inspection_surface(roof(90.0), [[40.0, 7.0, -7.0]])) is None
    assert creases_of(inspection_surface(roof(20.0), [[40.0, 9.8, -1.7]])) is None
