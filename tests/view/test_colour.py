"""Colours: published anchor values, round trips, and the tone curve against three.js' own constants."""

import numpy as np
import pytest

from app.view import colour


def test_linear_and_srgb_are_inverse_on_every_byte():
    every = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    assert (colour.srgb(colour.linear(every)) == every).all()


def test_middle_grey_is_the_published_value():
    # IEC 61966-2-1: sRGB 188 is about half of the light.
    assert colour.linear(np.array([[188, 188, 188]], dtype=np.uint8))[0, 0] == pytest.approx(0.5029, abs=2e-4)


def test_white_becomes_the_grey_that_browsers_show():
    assert colour.on_screen(np.array([[255, 255, 255]], dtype=np.uint8)).tolist() == [[226, 226, 226]]


def test_tone_mapping_keeps_order_and_black():
    grey = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    shown = colour.on_screen(grey)[:, 0].astype(int)
    assert shown[0] == 0
    assert (np.diff(shown) >= 0).all()


def test_sequential_map_gets_steadily_lighter():
    light = colour.linear(colour.table("sequential")) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(light) >= -1e-3).all()
    assert light[-1] > 20 * light[0]


def test_diverging_map_is_lightest_in_the_middle():
    light = colour.linear(colour.table("diverging")) @ [0.2126, 0.7152, 0.0722]
    assert 110 < int(np.argmax(light)) < 145


def test_values_beyond_the_limits_are_clipped_and_unknown_is_grey():
    table = colour.table("diverging")
    rgb = colour.paint(np.array([-9.0, 9.0, np.nan, -1.0, 1.0]), -1.0, 1.0, "diverging")
    assert (rgb[[0, 1]] == table[[0, -1]]).all()
    assert (rgb[[3, 4]] == table[[0, -1]]).all()
    assert rgb[2].tolist() == list(colour.UNKNOWN)


def test_legend_of_a_mesh_shows_the_mapped_colours():
    table = colour.table("diverging")
    mapped, plain = colour.legend_colours("diverging", True, 2), colour.legend_colours("diverging", False, 2)
    assert plain == colour.hex_of(table[[0, 255]])
    assert mapped == colour.hex_of(colour.on_screen(table[[0, 255]]))
    assert mapped != plain
