"""Edits and history of key points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.view.draw_keypoints import marks, short
from app.view.edits import added, next_id, too_close, without
from app.view.history import History
from app.view.model import Insight
from planner.errors import EchoBaseError
from planner.issues import Issue
from planner.keypoint import KeyPoint


def points(*names):
    return tuple(KeyPoint(id=n, x_mm=10.0 * i, y_mm=0.0, z_mm=0.0) for i, n in enumerate(names))


def test_names_go_on_after_the_highest():
    assert next_id(()) == "K1"
    assert next_id(points("K1", "K7", "left-3")) == "K8"


def test_points_are_added_to_the_micrometre_and_removed_by_name():
    more = added(points("K1"), np.array([1.23456, -2.0, 3.0]))
    assert more[-1] == KeyPoint(id="K2", x_mm=1.235, y_mm=-2.0, z_mm=3.0)
    assert without(more, "K1") == more[1:]
    with pytest.raises(EchoBaseError, match="no key point K9"):
        without(more, "K9")


def test_a_second_click_on_the_same_place_is_found():
    assert too_close(points("K1", "K2"), np.array([10.5, 0.0, 0.0]), 1.0).id == "K2"
    assert too_close(points("K1", "K2"), np.array([5.0, 0.0, 0.0]), 1.0) is None
    assert too_close((), np.zeros(3), 1.0) is None


@given(
    st.lists(
        st.one_of(st.integers(0, 5).map(lambda n: ("edit", n)), st.sampled_from([("undo", 0), ("redo", 0)])),
        max_size=40,
    )
)
def test_history_is_a_line_that_can_be_walked(actions):
    history, line, at = History([()]), [()], 0
    for what, n in actions:
        if what == "edit":
            state = points(*(f"K{i}" for i in range(n)))
            history.note(state)
            if state != line[at]:
                line, at = [*line[: at + 1], state], at + 1
        else:
            target = at + (-1 if what == "undo" else 1)
            expected = line[target] if 0 <= target < len(line) else None
            assert history.step(-1 if what == "undo" else 1) == expected
            at = target if expected is not None else at
        assert (history.undos, history.redos) == (at, len(line) - 1 - at)


def test_the_worst_issue_of_a_point_is_its_word():
    issues = (
        Issue("warning", "keypoint-curvature", "m", "r", "K1"),
        Issue("error", "keypoint-near-edge", "m", "r", "K1"),
        Issue("warning", "coverage-outside", "m", "r", ""),
    )
    shown = marks(points("K1", "K2"), Insight(1, issues), None)
    assert (shown[0].tone, shown[0].word) == ("bad", "x edge")
    assert (shown[1].tone, shown[1].word) == ("good", "ok")
    assert marks(points("K1"), None, None)[0].tone == "none"
    assert short("keypoint-too-near-corner") == "corner"
