"""Clicks in the 3D view: a ray, a marker at once, then an edit of the model in the view's own thread."""

import time
from typing import TYPE_CHECKING

import numpy as np
import viser

from app.view.browsers import Browser
from app.view.draw_keypoints import positions
from app.view.edits import added, too_close, without
from app.view.loopback import user_of
from app.view.picker import Hit, nearest_to_ray
from planner.errors import fail
from planner.frames import Array
from planner.keypoint import KeyPoint

if TYPE_CHECKING:
    from app.view.project_view import ProjectView

DOUBLE_CLICK_S = 0.35


class Clicks:
    """Listens to the clicks of those browsers that pick."""

    def __init__(self, view: "ProjectView") -> None:
        self._view = view
        self._last_s = 0.0
        self._ahead: tuple[KeyPoint, ...] | None = None
        self.last_ms: float | None = None

    def listen(self, browser: Browser) -> None:
        """Register or remove the click handlers of one browser, according to what it picks."""
        scene = browser.client.scene
        scene.remove_click_callback()
        if browser.pick == "none":
            return

        # Both are quick and must keep their order, hence coroutines (viser runs plain functions in a pool).
        @scene.on_click()
        async def _(event: viser.SceneClickEvent) -> None:
            self._clicked(browser, event, delete=False)

        @scene.on_click(modifier="shift")
        async def _(event: viser.SceneClickEvent) -> None:
            self._clicked(browser, event, delete=True)

    def _clicked(self, browser: Browser, event: viser.SceneClickEvent, delete: bool) -> None:
        started = time.perf_counter()
        # A double click is one click.
        if started - self._last_s < DOUBLE_CLICK_S and not delete:
            return
        self._last_s = started
        view = self._view
        T_part_base = view.model.setup().T_base_partnom.inv()
        origin = T_part_base.points(np.asarray(event.ray_origin) * 1e3)
        direction = T_part_base.directions(np.asarray(event.ray_direction))
        picker = view.stage.picker
        hit = picker.cast(origin, direction) if picker is not None else None
        who = user_of(view.server, browser.client.client_id)
        if browser.pick == "surface":
            if hit is not None:
                view.draw.put(lambda: view.model.select_surface(hit.point[None], who))
            else:
                self._complain(picker is not None, None)
        elif delete:
            self._delete(origin, direction, who)
        else:
            self._add(picker is not None, hit, who)
        self.last_ms = (time.perf_counter() - started) * 1e3

    def _add(self, ready: bool, hit: Hit | None, who: str) -> None:
        view = self._view
        if hit is None or not hit.on_surface:
            self._complain(ready, hit)
            return
        points = self._ahead if self._ahead is not None else view.model.keypoints().points
        if too_close(points, hit.point, view.stage.ball_mm) is not None:
            return
        self._ahead = added(points, hit.point)
        view.stage.keypoints(self._ahead)
        where = hit.point
        view.draw.put(lambda: self._commit(where, who))

    def _commit(self, where: Array, who: str) -> None:
        try:
            state = self._view.model.keypoints()
            self._view.put_keypoints(added(state.points, where), who, state.version)
        except Exception:
            # The marker shown ahead was not accepted: draw what is really there.
            self._view.draw.put(self._view.stage.keypoints, "keypoints")
            raise
        finally:
            self._ahead = None

    def _delete(self, origin: Array, direction: Array, who: str) -> None:
        view = self._view
        points = view.model.keypoints().points
        index = nearest_to_ray(positions(points), origin, direction, view.stage.ball_mm * 1.8)
        if index is None:
            return
        name = points[index].id
        view.draw.put(lambda: view.put_keypoints(without(view.model.keypoints().points, name), who))

    def _complain(self, ready: bool, hit: Hit | None) -> None:
        def tell() -> None:
            if not ready:
                raise fail(
                    "view-preparing",
                    "The part is still being prepared for picking.",
                    "Try again in a moment.",
                    "3D view",
                )
            if hit is not None:
                raise fail(
                    "keypoint-off-surface",
                    "This place is on the part but not on the inspection surface.",
                    "Click inside the tinted surface, or choose another inspection surface first.",
                    "3D view",
                )

        self._view.draw.put(tell)
