"""`StoreModel`: what the 3D view asks of a project, answered from the store. Nouns are kept while their digests stand."""

import json
import threading
from collections.abc import Callable
from importlib import import_module
from typing import Any, cast

import numpy as np

from alignment.cloud import PointCloud
from app.api.insight import Question, think
from app.api.parts import load_part
from app.api.results_model import found_of, load_cloud, load_paths
from app.jobs.thinker import Thinker
from app.store import inputs, projects, results
from app.store.events import Event
from app.store.freshness import changed_since
from app.store.refusal import Refusal, refuse
from app.store.store import Store
from app.view.model import TOPICS, Found, Insight, KeyPointSet, Topic
from planner.frames import Array
from planner.keypoint import KeyPoint, KeyPointList
from planner.part import Part
from planner.setup import Inspection, Setup
from planner.surface.inspection import InspectionSurface
from planner.toolpath import PathKind, ToolPath

EDIT_ATTEMPTS = 5
MOST_SEEDS = 64


class StoreModel:
    """One project as the view sees it. Safe to call from many threads; each noun is computed once per digest."""

    def __init__(self, store: Store, project_id: str, thinker: Thinker) -> None:
        with store.db.read() as session:
            projects.get(session, project_id)
        self._store, self._id, self._thinker = store, project_id, thinker
        self._lock = threading.RLock()
        self._kept: dict[str, tuple[Any, Any]] = {}

    @property
    def project_id(self) -> str:
        """Identifier of the project."""
        return self._id

    def _keep(self, name: str, key: Any, make: Callable[[], Any]) -> Any:
        """Return the noun kept under a name if it was made for this key, else make it."""
        with self._lock:
            if name not in self._kept or self._kept[name][0] != key:
                self._kept.pop(name, None)
                self._kept[name] = (key, make())
            return self._kept[name][1]

    def _input(self, kind: str) -> inputs.Input:
        with self._store.db.read() as session:
            return inputs.current(session, self._id, kind)

    def setup(self) -> Setup:
        """Return the settings in force."""
        return Setup.model_validate(self._input("setup").content)

    def part(self) -> Part | None:
        """Return the part."""
        given = self._input("part")
        if not given.is_given:
            return None
        return cast(Part, self._keep("part", given.sha256, lambda: load_part(self._store, self._id)))

    def surface(self) -> InspectionSurface | None:
        """Return the inspection surface: flooded from seeds and key points, as the plan will do it."""
        part = self.part()
        if part is None:
            return None
        setup = self.setup()
        with self._store.db.read() as session:
            seeds = inputs.seeds_in(session, self._id)
            points = inputs.keypoints_in(session, self._id)
        wanted = tuple(seeds) + tuple(p.xyz() for p in points)
        choose = import_module(self._store.settings.workflow).choose_surface
        key = (id(part), setup.placement, wanted, setup.inspection.box, setup.inspection.paint, setup.probe)
        made = self._keep("flood", key, lambda: choose(part, setup, wanted))
        # The same triangles stay the same object, so that nothing behind it is built again at every key point.
        return cast(InspectionSurface, self._keep("surface", (id(made.part), made.part_faces.tobytes()), lambda: made))

    def keypoints(self) -> KeyPointSet:
        """Return the key points and their version."""
        given = self._input("keypoints")
        return KeyPointSet(tuple(KeyPointList.validate_python(given.content)), given.version)

    def keypoint_history(self, limit: int) -> list[tuple[KeyPoint, ...]]:
        """Return the sets that were in force, oldest first, the present one last."""
        with self._store.db.read() as session:
            rows = inputs.recent(session, self._id, "keypoints", limit)
        sets = [tuple(KeyPointList.validate_python(row.content)) for row in rows]
        return sets if len(sets) == limit else [(), *sets]

    def set_keypoints(self, points: tuple[KeyPoint, ...], version: int | None, who: str) -> int:
        """Replace the key points if `version` is still theirs; return the new version."""
        content = KeyPointList.dump_python(list(points), mode="json")
        try:
            return inputs.put(self._store, self._id, "keypoints", content, version, who).version
        except Refusal as refusal:
            if refusal.status != 412:
                raise
            text = "somebody else changed the key points meanwhile."
            raise refuse(
                412, "keypoints-changed", text, "Look again, then repeat your change.", "keypoints"
            ) from refusal

    def select_surface(self, seeds_part: Array, who: str, more: bool = False) -> None:
        """Choose the inspection surface by flooding from seed points (n, 3) in `part`; `more`: besides those there are."""
        rows = np.asarray(seeds_part, dtype=np.float64).reshape(-1, 3)
        if more:
            with self._store.db.read() as session:
                rows = np.vstack([*inputs.seeds_in(session, self._id), rows])[-MOST_SEEDS:]
        seeds = [dict(zip(("x_mm", "y_mm", "z_mm"), map(float, row), strict=True)) for row in rows]
        inputs.put(self._store, self._id, "surface", {"seeds": seeds}, None, who)

    def edit_inspection(self, change: Callable[[Inspection], Inspection], who: str) -> None:
        """Replace the inspection part of the settings by what `change` makes of the one in force."""
        for attempt in range(EDIT_ATTEMPTS):
            given = self._input("setup")
            setup = Setup.model_validate(given.content)
            after = setup.model_copy(update={"inspection": change(setup.inspection)})
            # Validated once more: a change is made of numbers from a click.
            content = Setup.model_validate(after.model_dump()).model_dump(mode="json")
            try:
                inputs.put(self._store, self._id, "setup", content, given.version, who)
            except Refusal as refusal:
                # Somebody saved the cell in between: the click still means what it meant.
                if refusal.status != 412 or attempt + 1 == EDIT_ATTEMPTS:
                    raise
            else:
                return

    def insight(self) -> Insight | None:
        """Compute what the key points of now are worth, in the thinker's process."""
        with self._store.db.read() as session:
            part = inputs.current(session, self._id, "part")
            files = inputs.files_of(session, self._id, f"part:{part.version}")
            seeds = tuple(inputs.seeds_in(session, self._id))
        given = self.keypoints()
        if not part.is_given:
            return None
        if not given.points:
            return Insight(given.version)
        settings = self._store.settings
        content, setup = json.dumps(part.content), self.setup().model_dump_json()
        arrays = files["part.npz"].sha256
        question = Question(settings.store_url(), settings.workflow, arrays, content, setup, seeds, given)
        return self._thinker.ask(think, question)

    def path(self, kind: PathKind) -> ToolPath | None:
        """Return a planned path, unless it is stale."""
        with self._store.db.read() as session:
            plan = results.latest(session, self._id, "plan")
            if plan is None or changed_since(session, plan):
                return None
        paths = self._keep("paths", plan.sha256, lambda: load_paths(self._store, plan))
        return cast("ToolPath | None", paths.get(kind))

    def cloud(self) -> PointCloud | None:
        """Return the readings of the newest alignment scan, in the nominal base."""
        return cast("PointCloud | None", load_cloud(self._store, self._id, self.setup(), self._keep))

    def found(self) -> Found | None:
        """Return the last alignment, unless it failed or is stale."""
        with self._store.db.read() as session:
            row = results.latest(session, self._id, "alignment")
            if row is None or row.verdict == "fail" or changed_since(session, row):
                return None
        return cast(
            Found,
            self._keep("found", (row.sha256, id(self.surface())), lambda: found_of(self._store, row, self.setup())),
        )

    def subscribe(self, callback: Callable[[Topic], None]) -> Callable[[], None]:
        """Call back at every change."""

        def hear(event: Event) -> None:
            what = event.data.get("what") if event.name == "changed" else None
            for topic in TOPICS:
                if topic == what:
                    callback(topic)
            # The surface is flooded from key points where nobody picked seeds, and from the part in any case.
            if what == "part":
                callback("surface")

        return self._store.exchange.listen(f"project:{self._id}", hear)

    def publish(self, event: str, data: dict[str, object]) -> None:
        """Send an event to every page that has the project open."""
        self._store.exchange.publish(f"project:{self._id}", event, data)
