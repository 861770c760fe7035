"""`ProjectView`: one open project on the screens of everybody who looks at it."""

import asyncio
import contextlib
import time
from dataclasses import asdict

import numpy as np
import viser

from app.view.browsers import Browser, Browsers
from app.view.cameras import Sight, sight, towards
from app.view.clicks import Clicks
from app.view.commands import ViewCommand, ViewState
from app.view.draw_part import FOV_RAD
from app.view.edits import without
from app.view.history import LIMIT, History, Points
from app.view.layers import LAYERS
from app.view.loopback import start_loopback, user_of
from app.view.model import Insight, ProjectModel, Topic
from app.view.probe_at import probe_facts, probe_index
from app.view.stage import Stage
from app.view.summary import insight_json
from app.view.worker import Worker
from planner.errors import EchoBaseError
from planner.issues import Issue
from planner.placement import assume_nominal

FIRST_MOMENTS_S = (0.15, 0.8, 2.5)


class ProjectView:
    """Draws a project model and turns what people do in the view into edits of the model.

    Every method may be called from any thread, but not from an event loop: `command` can wait for a lock.
    """

    def __init__(self, model: ProjectModel, key: str) -> None:
        self.model = model
        self.server = start_loopback(key)
        self.browsers = Browsers()
        self.stage = Stage(self.server, model)
        self.history = History(model.keypoint_history(LIMIT))
        self.last_used = time.monotonic()
        self.draw = Worker(f"view-{model.project_id}", self._issue)
        self._think = Worker(f"insight-{model.project_id}", self._issue)
        self.clicks = Clicks(self)
        self.server.on_client_connect(self._connected)
        self.server.on_client_disconnect(self._disconnected)
        self._unsubscribe = model.subscribe(self._changed)
        for topic in ("part", "surface", "keypoints", "plan", "scan", "alignment"):
            self._changed(topic)

    @property
    def port(self) -> int:
        """Loopback port of the viser server."""
        return int(self.server.get_port())

    @property
    def connected(self) -> int:
        """How many browsers show this project."""
        return len(self.browsers)

    def people(self) -> list[str]:
        """Return the names of those who look, without repetition."""
        names = [user_of(self.server, b.client.client_id) for b in self.browsers.chosen(None)]
        return sorted({n for n in names if n})

    def close(self) -> None:
        """Stop drawing and close every connection."""
        self._unsubscribe()
        self._think.stop()
        self.draw.stop()
        self.server.stop()

    def command(self, command: ViewCommand) -> ViewState:
        """Do what a page asks and return what its view shows now. Raises EchoBaseError for what cannot be done."""
        self.last_used = time.monotonic()
        self._edit(command)
        browsers = self.browsers.chosen(command.client)
        for browser in browsers:
            self._arrange(browser, command)
        if command.scan_by is not None and command.scan_by != self.stage.scan_by:
            self.stage.scan_by = command.scan_by
            self.draw.put(self.stage.scan, "scan")
            self.draw.wait(30.0)
        return self.state(command.client)

    def state(self, client: int | None = None) -> ViewState:
        """Return what a browser's view shows (the first one's, for None)."""
        chosen = self.browsers.chosen(client)
        browser = chosen[0] if chosen else None
        keypoints = self.model.keypoints()
        shown = browser.shown if browser else set()
        legend = next(
            (self.stage.legends[n] for n in ("after", "before", "scan") if n in shown and n in self.stage.legends), None
        )
        probe = None
        if (
            browser is not None
            and "probe" in shown
            and (path := self.model.path(browser.probe[0])) is not None
            and len(path)
        ):
            probe = probe_facts(path, probe_index(path, browser.probe[1]), self.model.setup(), browser.probe[0])[1]
        insight = self.stage.insight
        fresh = insight if insight is not None and insight.version == keypoints.version else None
        return ViewState(
            client=browser.client.client_id if browser else None,
            step=browser.step if browser else "part",
            layers={name: name in shown for name in LAYERS},
            titles={name: layer.title for name, layer in LAYERS.items()},
            pick=browser.pick if browser else "none",
            legend=asdict(legend) if legend else None,
            probe=probe,
            undo=self.history.undos,
            redo=self.history.redos,
            keypoints=len(keypoints.points),
            version=keypoints.version,
            clients=len(self.browsers),
            insight=insight_json(fresh) if fresh is not None else None,
            pick_ms=self.clicks.last_ms,
        )

    def put_keypoints(self, points: Points, who: str, version: int | None = None) -> None:
        """Give the model another set of key points."""
        self.model.set_keypoints(points, version, who)

    def _edit(self, command: ViewCommand) -> None:
        points = self.model.keypoints().points
        if command.delete is not None:
            self.put_keypoints(without(points, command.delete), command.who)
        if command.clear and points:
            self.put_keypoints((), command.who)
        if command.undo or command.redo:
            target = self.history.step(-1 if command.undo else 1)
            if target is not None:
                self.put_keypoints(target, command.who)

    def _arrange(self, browser: Browser, command: ViewCommand) -> None:
        if command.step is not None:
            browser.turn_to(command.step, self.stage.found is not None)
        for name, on in (command.layers or {}).items():
            if name in LAYERS:
                (browser.shown.add if on else browser.shown.discard)(name)
        browser.brush_mm = command.brush_mm or browser.brush_mm
        browser.may_cross = browser.may_cross if command.may_cross is None else command.may_cross
        if command.pick is not None:
            browser.pick = command.pick
            self.clicks.listen(browser)
        if command.probe is not None:
            browser.probe = (command.probe.path, command.probe.at)
            browser.shown.add("probe")
        if command.probe is not None or (command.step is not None and "probe" in browser.shown):
            self._place_probe(browser)
        browser.apply()
        if command.camera is not None:
            self._look(browser, command.camera)
        if command.focus is not None:
            self._focus(browser, command.focus)
        browser.client.flush()

    def _place_probe(self, browser: Browser) -> None:
        path = self.model.path(browser.probe[0])
        if path is None or not len(path):
            browser.shown.discard("probe")
            return
        T_part_tcp, _ = probe_facts(path, probe_index(path, browser.probe[1]), self.model.setup(), browser.probe[0])
        x, y, z = (float(v) * 1e-3 for v in T_part_tcp.xyz_mm)
        browser.probe_pose = ((x, y, z), tuple(float(v) for v in T_part_tcp.wxyz))

    def _look(self, browser: Browser, view: str) -> None:
        points = self.stage.points_m()
        if points is None:
            return
        camera = browser.client.camera
        size = (int(camera.image_width), int(camera.image_height))
        aspect = size[0] / max(size[1], 1)
        surface = self.model.surface()
        if view == "surface" and surface is not None:
            T = assume_nominal(self.model.setup().T_base_partnom)
            self._move(
                browser,
                towards(
                    T.directions(surface.mean_normal_part),
                    np.array([0.0, 1.0, 0.0]),
                    T.points(surface.vertices) * 1e-3,
                    camera.fov,
                    aspect,
                ),
            )
        else:
            self._move(browser, sight("iso" if view == "surface" else view, points, FOV_RAD, aspect))
        browser.framed = (view, np.asarray(camera.position).copy(), size)

    def _focus(self, browser: Browser, name: str) -> None:
        found = next((p for p in self.model.keypoints().points if p.id == name), None)
        if found is None:
            return
        target = self.model.setup().T_base_partnom.points(np.array(found.xyz())) * 1e-3
        back = np.asarray(browser.client.camera.position) - target
        length = float(np.linalg.norm(back)) or 1.0
        reach = self.stage.size_mm * 1e-3 * 0.6
        self._move(browser, Sight(target + back / length * min(length, reach), target, np.array([0.0, 0.0, 1.0])))

    @staticmethod
    def _move(browser: Browser, to: Sight) -> None:
        camera = browser.client.camera
        browser.moved = True
        with browser.client.atomic():
            camera.up_direction = to.up
            camera.position = to.position
            camera.look_at = to.look_at

    async def _connected(self, client: viser.ClientHandle) -> None:
        browser = self.browsers.add(client)
        self.last_used = time.monotonic()
        # The page reads its number from the title of viser's own (hidden) panel.
        client.gui.set_panel_label(f"echobase-view-{client.client_id}")
        browser.apply()

        @client.camera.on_update
        async def _(camera: viser.CameraHandle) -> None:
            # A picture that nobody moved keeps holding the whole part when its frame changes.
            if browser.framed is None:
                return
            view, place, size = browser.framed
            now = (int(camera.image_width), int(camera.image_height))
            if now != size and np.allclose(camera.position, place, atol=1e-4 * self.stage.size_mm):
                self._look(browser, view)

        async def settle() -> None:
            # The shared scene and this browser's own messages travel in separate streams, without a common order.
            for moment in FIRST_MOMENTS_S:
                await asyncio.sleep(moment)
                browser.apply()
                if not browser.moved and self.stage.shape is not None:
                    with contextlib.suppress(AttributeError):
                        self._look(browser, "iso")

        self._settling = asyncio.get_running_loop().create_task(settle())
        self._announce()

    def _disconnected(self, client: viser.ClientHandle) -> None:
        self.browsers.drop(client.client_id)
        self.last_used = time.monotonic()
        self._announce()

    def _announce(self) -> None:
        self.draw.put(
            lambda: self.model.publish("people", {"clients": len(self.browsers), "names": self.people()}), "people"
        )

    def _issue(self, issue: Issue) -> None:
        self.model.publish("view-error", dict(issue.to_json()))

    def _changed(self, topic: Topic | str) -> None:
        stage = self.stage
        tasks = {
            "part": (stage.part, stage.surface),
            "surface": (stage.surface, stage.regions, stage.coverage),
            "setup": (stage.placement, stage.surface, stage.regions, stage.coverage),
            "keypoints": (self._note, stage.surface, stage.keypoints),
            "plan": (stage.paths, stage.coverage),
            "scan": (stage.scan,),
            "alignment": (stage.alignment, stage.keypoints, stage.paths),
        }
        for task in tasks.get(topic, ()):
            self.draw.put(task, task.__name__)
        if topic == "part":
            self.draw.put(self._frame_all, "frame")
        if topic == "alignment":
            self.draw.put(self._show_found, "found")
        if topic in {"part", "surface", "setup", "keypoints"}:
            self._think.put(self._look_into, "insight")
        self.draw.put(lambda: self.model.publish("view", {"topic": topic}), f"told-{topic}")

    def _note(self) -> None:
        self.history.note(self.model.keypoints().points)

    def _frame_all(self) -> None:
        for browser in self.browsers.chosen(None):
            if not browser.moved:
                self._look(browser, "iso")

    def _show_found(self) -> None:
        """Turn those who look at the alignment to what it found, or away from what no longer holds."""
        for browser in self.browsers.chosen(None):
            if browser.step in {"alignment", "report"}:
                browser.turn_to(browser.step, self.stage.found is not None)
                browser.apply()
                browser.client.flush()

    def _look_into(self) -> None:
        try:
            insight = self.model.insight()
        except EchoBaseError as error:
            insight = Insight(self.model.keypoints().version, error.issues)
        self.stage.insight = insight
        self.draw.put(self.stage.keypoints, "keypoints")
        self.draw.put(self.stage.coverage, "coverage")
        self.model.publish("insight", insight_json(insight))
