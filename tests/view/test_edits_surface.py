"""What clicks make of the inspection settings, and what of them is drawn."""

import numpy as np
import pytest

from app.view.draw_regions import draw_regions
from app.view.edits_surface import INSPECTION_EDITS, drawn, kept_out
from app.view.picker import Picker
from planner.setup import Inspection, Setup
from tests.view.memory import height, panel

AT = np.array([10.0, -20.0, 5.00049])


def test_each_tool_does_its_own_thing_and_nothing_else():
    old = Inspection()
    painted = INSPECTION_EDITS["erase"](INSPECTION_EDITS["paint"](old, AT, 20.0, True), AT, 5.0, True)
    assert [(d.radius_mm, d.erase) for d in painted.paint] == [(20.0, False), (5.0, True)]
    assert painted.paint[0].centre_mm == (10.0, -20.0, 5.0)
    assert painted.model_copy(update={"paint": ()}) == old
    clamp = kept_out(kept_out(old, AT, 8.0, may_cross=False), AT + 30.0, 6.0, may_cross=False)
    assert [k.name for k in clamp.keep_outs] == ["clamp 1", "clamp 2"]
    assert not clamp.keep_outs[0].may_cross
    assert Inspection.model_validate(clamp.model_dump()) == clamp


def test_a_line_guides_the_passes_from_its_second_point_on():
    one = drawn(Inspection(), AT)
    assert one.direction == "extent"
    two = drawn(one, AT + 50.0)
    assert two.direction == "drawn"
    assert len(two.guide) == 2


class Scene:
    """Stands in for viser: remembers which nodes are there."""

    def __init__(self):
        self.nodes = {}
        self.scene = self

    def add_line_segments(self, name, points, colors, **_):
        self.nodes[name] = points

    def add_label(self, name, text, **_):
        self.nodes[name] = text

    def remove_by_name(self, name):
        self.nodes.pop(name, None)


@pytest.mark.parametrize("radius", [8.0, 40.0])
def test_a_disc_is_outlined_on_the_surface_and_goes_when_it_is_deleted(radius):
    part, surface = panel()
    centre = [60.0, 20.0, float(height(np.array(60.0), np.array(20.0)))]
    setup = Setup(inspection=kept_out(Inspection(), np.array(centre), radius, may_cross=False))
    scene, picker = Scene(), Picker(part, surface)
    shown = draw_regions(scene, surface, setup, picker, set())
    line = next(v for k, v in scene.nodes.items() if "keep" in k) * 1e3
    ends = line.reshape(-1, 3)
    # Lifted off the surface by 0.2 mm, on triangles that leave it by as much.
    assert np.abs(ends[:, 2] - height(ends[:, 0], ends[:, 1])).max() < 0.6
    assert np.linalg.norm(ends - centre, axis=1) == pytest.approx(radius, rel=0.03, abs=0.3)
    assert any("not to be crossed" in str(v) for v in scene.nodes.values())
    assert draw_regions(scene, surface, Setup(), picker, shown) == set()
    assert scene.nodes == {}
