"""Clicks in the 3D view: a ray, a marker at once, then an edit of the model in the view's own thread."""

import time
from typing import TYPE_CHECKING

import numpy as np
import viser

from app.view.browsers import Browser
from app.view.draw_keypoints import positions
from app.view.edits import added, too_close, without
from app.view.edits_surface import INSPECTION_EDITS
from app.view.loopback import user_of
from app.view.picker import Hit, nearest_to_ray
from planner.errors import fail
from planner.frames import Array
from planner.keypoint import KeyPoint
from planner.surface.clip import is_chosen
from planner.surface.keepouts import keep_outs_of

if TYPE_CHECKING:
    from app.view.project_view import ProjectView

DOUBLE_CLICK_S = 0.35


def _refuse(region: str) -> None:
    raise fail(
        "keypoint-kept-out",
        f"This place lies in the keep-out region '{region}' or its margin: no data are taken there.",
        "Click elsewhere, or change the region in step Surface.",
        "3D view",
    )


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
        if browser.pick in INSPECTION_EDITS or browser.pick == "surface":
            self._edit_surface(browser, hit, picker is not None, who, added_seed=delete)
        elif delete:
            self._delete(origin, direction, who)
        else:
            self._add(picker is not None, hit, who)
        self.last_ms = (time.perf_counter() - started) * 1e3

    def _edit_surface(self, browser: Browser, hit: Hit | None, ready: bool, who: str, added_seed: bool) -> None:
        """Choose, paint, erase, keep out or draw at the place clicked; a shift-click adds to the places chosen."""
        view = self._view
        if hit is None:
            self._complain(ready, None)
            return
        place = hit.point
        if browser.pick == "surface":
            view.draw.put(lambda: view.model.select_surface(place[None], who, more=added_seed))
            return
        change = INSPECTION_EDITS[browser.pick]
        radius, may_cross = browser.brush_mm, browser.may_cross
        view.draw.put(lambda: view.model.edit_inspection(lambda old: change(old, place, radius, may_cross), who))

    def _add(self, ready: bool, hit: Hit | None, who: str) -> None:
        view = self._view
        if hit is None or not (hit.on_surface and is_chosen(view.model.setup().inspection, hit.point[None])[0]):
            self._complain(ready, hit)
            return
        region = self._region_at(hit.point)
        if region is not None:
            view.draw.put(lambda: _refuse(region))
            return
        points = self._ahead if self._ahead is not None else view.model.keypoints().points
        if too_close(points, hit.point, view.stage.ball_mm) is not None:
            return
        self._ahead = added(points, hit.point)
        view.stage.keypoints(self._ahead)
        where = hit.point
        view.draw.put(lambda: self._commit(where, who))

    def _region_at(self, where: Array) -> str | None:
        """Return the name of the keep-out region that forbids a key point here, or None."""
        surface = self._view.model.surface()
        keep = keep_outs_of(surface, self._view.model.setup()) if surface is not None else None
        if keep is None or not len(keep):
            return None
        room = keep.each_room_mm(where[None])[:, 0]
        return keep.label(int(room.argmin())) if room.min() < 0.0 else None

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
