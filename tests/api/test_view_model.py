"""What the 3D view asks of a project, answered from the store."""

import numpy as np
import pytest

from app.api.part import keep_part
from app.api.project_model import StoreModel
from app.jobs.thinker import Thinker
from app.settings import ServerSettings
from app.store import inputs, projects
from app.store.content import put_bytes
from app.store.refusal import Refusal
from app.store.store import open_store
from app.view.edits_surface import dabbed, kept_out
from app.view.model import ProjectModel
from app.view.registry import ViewRegistry
from planner.errors import EchoBaseError
from planner.keypoint import KeyPoint

POINT = KeyPoint(id="A", x_mm=1.0, y_mm=2.0, z_mm=0.0)


@pytest.fixture
def model(tmp_path):
    store = open_store(ServerSettings(data=tmp_path, workflow="tests.api.fake_workflow"))
    thinker = Thinker()
    yield StoreModel(store, projects.create(store, "a").id, thinker)
    thinker.close()
    store.close()


def with_part(model: StoreModel) -> None:
    with model._store.busy():
        blob = put_bytes(model._store.blobs, b"solid")
        keep_part(model._store, model.project_id, blob, "a.stl", "cm", None)


def test_an_empty_project_has_nothing_to_show(model):
    assert isinstance(model, ProjectModel)
    assert model.part() is None
    assert model.surface() is None
    assert model.insight() is None
    assert (model.path("alignment"), model.cloud(), model.found()) == (None, None, None)
    assert model.keypoints().version == 0


def test_the_part_is_what_was_read(model):
    with_part(model)
    part = model.part()
    assert part.extents_mm.tolist() == [100.0, 50.0, 0.0]
    assert part.provenance.unit == "cm"
    assert model.part() is part
    assert np.array_equal(model.surface().part_faces, [0, 1])


def test_edits_by_view_and_by_rest_meet(model):
    heard: list[str] = []
    stop = model.subscribe(heard.append)
    assert model.set_keypoints((POINT,), 0, "view") == 1
    with pytest.raises(EchoBaseError) as late:
        model.set_keypoints((), 0, "view")
    assert late.value.issues[0].code == "keypoints-changed"
    inputs.put(model._store, model.project_id, "keypoints", [], 1, "rest")
    assert model.keypoints().points == ()
    model.select_surface(np.array([[1.0, 2.0, 3.0]]), "view")
    assert heard == ["keypoints", "keypoints", "surface"]
    stop()
    model.set_keypoints((POINT,), None, "view")
    assert len(heard) == 3


def test_a_key_point_keeps_the_surface_object(model):
    with_part(model)
    surface = model.surface()
    model.set_keypoints((POINT,), 0, "view")
    assert model.surface() is surface


def test_a_project_that_is_not_there_has_no_view(model):
    registry = ViewRegistry(lambda pid: StoreModel(model._store, pid, model._thinker))
    for name in ("0" * 20, "..", "x"):
        with pytest.raises(Refusal):
            registry.get(name)
    assert registry.peek("0" * 20) is None


def test_the_thinker_survives_what_it_thinks_of(model):
    thinker = model._thinker
    assert thinker.ask(abs, -3) == 3
    with pytest.raises(EchoBaseError, match="ended unexpectedly"):
        thinker.ask(_die)
    assert thinker.ask(abs, -4) == 4


def _die() -> None:
    import os  # noqa: PLC0415

    os._exit(7)


def test_clicks_edit_the_inspection_settings_whatever_was_saved_in_between(model):
    with_part(model)
    at = np.array([5.0, 5.0, 0.0])
    model.edit_inspection(lambda old: kept_out(old, at, 4.0, may_cross=False), "view")
    assert [k.name for k in model.setup().inspection.keep_outs] == ["clamp 1"]

    def late(old):
        # Somebody saves the cell while the click is on its way.
        if len(seen) == 0:
            changed = model.setup().model_copy(update={"standoff_mm": 22.0}).model_dump(mode="json")
            inputs.put(model._store, model.project_id, "setup", changed, None, "rest")
        seen.append(old)
        return dabbed(old, at, 10.0, erase=False)

    seen: list = []
    model.edit_inspection(late, "view")
    assert len(seen) == 2
    assert model.setup().standoff_mm == 22.0
    assert len(model.setup().inspection.paint) == 1
    model.select_surface(np.array([[1.0, 2.0, 0.0]]), "view")
    model.select_surface(np.array([[4.0, 2.0, 0.0]]), "view", more=True)
    assert len(model._input("surface").content["seeds"]) == 2
