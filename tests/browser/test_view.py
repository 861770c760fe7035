"""The 3D view in a real browser: clicks become key points, layers become pixels, a lost link comes back."""

import json
import urllib.request

import numpy as np
import pytest

from tests.browser.eyes import bluish, picture, project, reddish, until
from tests.view.memory import height

# A software renderer on busy cores takes its time.
pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(900)]
SIZE = {"width": 760, "height": 460}


def command(bare, **body):
    request = urllib.request.Request(
        f"{bare.running.url}/api/v1/projects/demo/view",
        json.dumps(body).encode(),
        {"Content-Type": "application/json"},
    )
    with urllib.request.urlopen(request) as answer:
        return json.load(answer)


@pytest.fixture(scope="module")
def page(shared_bare, chromium):
    page = chromium.new_page(viewport=SIZE)
    page.goto(f"{shared_bare.running.url}/view/demo/")
    until(page, lambda: len(shared_bare.view.browsers) == 1, what="the view's connection")
    browser = shared_bare.view.browsers.chosen(None)[0]
    until(page, lambda: browser.moved, what="the first framing")
    until(page, lambda: picture(page).std() > 10, what="the part on screen")
    yield page
    page.close()


def on_screen(bare, x, y):
    """Pixel of a place on the outer face, and the place in part, mm."""
    place = np.array([x, y, float(height(np.array(x), np.array(y)))])
    in_base = bare.model.setup().T_base_partnom.points(place)
    camera = bare.view.browsers.chosen(None)[0].client.camera
    return project(camera, in_base * 1e-3, SIZE["width"], SIZE["height"]), place


def looking(bare, page, view):
    """Turn the camera and wait until the browser itself reports the new place."""
    camera = bare.view.browsers.chosen(None)[0].client.camera
    command(bare, camera=view)
    asked = camera.update_timestamp
    until(page, lambda: camera.update_timestamp > asked, what="the camera's answer")
    page.wait_for_timeout(150)


def test_clicks_become_key_points_where_they_were_made(bare, page):
    command(bare, step="keypoints", pick="keypoints")
    looking(bare, page, "top")
    places = [(-200.0, -60.0), (30.0, 70.0), (210.0, -20.0)]
    for i, (x, y) in enumerate(places):
        pixel, _ = on_screen(bare, x, y)
        page.mouse.click(*pixel)
        until(page, lambda n=i: len(bare.model.keypoints().points) == n + 1, what="the key point")
        page.wait_for_timeout(400)  # the next click is not a double click
    for point, (x, y) in zip(bare.model.keypoints().points, places, strict=True):
        _, place = on_screen(bare, x, y)
        # Half a pixel at this distance is about 0.7 mm.
        assert np.abs(np.array(point.xyz()) - place).max() < 2.0
    assert [p.id for p in bare.model.keypoints().points] == ["K1", "K2", "K3"]
    assert bare.view.clicks.last_ms < 100.0

    # Orbiting picks nothing; nor does a click beside the part; a double click is one click.
    page.mouse.move(300, 400)
    page.mouse.down()
    page.mouse.move(380, 420, steps=6)
    page.mouse.up()
    page.mouse.click(8, SIZE["height"] - 8)
    page.wait_for_timeout(400)
    assert len(bare.model.keypoints().points) == 3
    looking(bare, page, "top")
    page.mouse.dblclick(*on_screen(bare, -100.0, 30.0)[0])
    until(page, lambda: len(bare.model.keypoints().points) == 4, what="the fourth point")
    page.wait_for_timeout(300)
    assert len(bare.model.keypoints().points) == 4

    # Shift-click deletes, undo brings back.
    page.keyboard.down("Shift")
    page.mouse.click(*on_screen(bare, 30.0, 70.0)[0])
    page.keyboard.up("Shift")
    until(page, lambda: [p.id for p in bare.model.keypoints().points] == ["K1", "K3", "K4"], what="the deletion")
    assert bare.view.draw.wait()
    command(bare, undo=True)
    assert [p.id for p in bare.model.keypoints().points] == ["K1", "K2", "K3", "K4"]
    command(bare, redo=True)
    assert [p.id for p in bare.model.keypoints().points] == ["K1", "K3", "K4"]


def test_a_click_off_the_inspection_surface_says_why(bare, page):
    command(bare, step="keypoints", pick="keypoints")
    looking(bare, page, "bottom")
    page.mouse.click(*on_screen(bare, 0.0, 0.0)[0])
    until(page, lambda: any(e == "view-error" for e, _ in bare.model.published), what="the explanation")
    told = next(data for event, data in bare.model.published if event == "view-error")
    assert told["code"] == "keypoint-off-surface"
    assert told["remedy"]
    assert not bare.model.keypoints().points


def test_clicks_paint_keep_out_and_draw(bare, page):
    def use(**tool):
        command(bare, **tool)
        page.wait_for_timeout(400)  # the browser learns what a click means

    def click(x, y, shown):
        page.mouse.click(*on_screen(bare, x, y)[0])
        until(page, shown, what="the edit")
        page.wait_for_timeout(400)

    def now():
        return bare.model.setup().inspection

    use(step="surface", pick="paint", brush_mm=60.0)
    looking(bare, page, "top")
    click(-60.0, 0.0, lambda: len(now().paint) == 1)
    assert np.hypot(now().paint[0].centre_mm[0] + 60.0, now().paint[0].centre_mm[1]) < 2.0
    use(pick="keepout", brush_mm=12.0, may_cross=False)
    click(-40.0, 10.0, lambda: len(now().keep_outs) == 1)
    use(pick="guide")
    click(-100.0, -20.0, lambda: len(now().guide) == 1)
    click(0.0, 20.0, lambda: now().direction == "drawn")
    # A key point in the clamp is refused in words.
    use(step="keypoints", pick="keypoints")
    page.mouse.click(*on_screen(bare, -38.0, 10.0)[0])
    until(page, lambda: any(d.get("code") == "keypoint-kept-out" for _, d in bare.model.published), what="the refusal")
    assert not bare.model.keypoints().points


def test_layers_are_pixels_of_their_own_browser(bare, page, chromium):
    bare.model.plan()
    bare.model.scan()
    bare.model.align()
    assert bare.view.draw.wait()
    mine = bare.view.browsers.chosen(None)[0].client.client_id
    other = chromium.new_page(viewport=SIZE)
    other.goto(f"{bare.running.url}/view/demo/")
    until(other, lambda: len(bare.view.browsers) == 2, what="the second browser")
    theirs = next(b.client.client_id for b in bare.view.browsers.chosen(None) if b.client.client_id != mine)
    for client in (mine, theirs):
        command(bare, client=client, step="part", layers={"axes": False}, camera="top")
    until(other, lambda: bluish(picture(other)) < 0.005 and picture(other).std() > 10, what="the bare part")

    # The path is blue lines on a grey part, in this browser only.
    command(bare, client=mine, step="paths", layers={"probe": False, "keypoints": False})
    until(page, lambda: bluish(picture(page)) > 0.01, what="the path")
    assert bluish(picture(other)) < 0.005

    # The offset shows in the map before, and is gone in the map after.
    state = command(
        bare, client=mine, step="alignment", layers={"before": True, "cad": True, "after": False, "found": False}
    )
    assert state["legend"]["title"] == "Deviation before"
    assert state["legend"]["high"] >= 1.0
    until(page, lambda: reddish(picture(page)) + bluish(picture(page)) > 0.05, what="the deviation before")
    # The colours of the map are those of the legend.
    image = picture(page).reshape(-1, 3).astype(int)
    legend = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in state["legend"]["colours"]])
    coloured = image[np.ptp(image, axis=1) > 60]
    gap = np.abs(coloured[:: max(1, len(coloured) // 2000), None, :] - legend[None]).max(axis=2).min(axis=1)
    assert np.quantile(gap, 0.9) <= 8
    state = command(bare, client=mine, step="alignment")
    assert state["legend"]["title"] == "Deviation after"
    assert state["legend"]["high"] <= 0.2
    other.close()


def test_a_lost_link_comes_back_with_the_whole_scene(bare, page):
    before = bare.view.browsers.chosen(None)[0].client.client_id
    bare.view.server._websock_server.disconnect_all_clients()
    until(
        page,
        lambda: any(b.client.client_id != before for b in bare.view.browsers.chosen(None)),
        what="the second connection",
    )
    until(page, lambda: picture(page).std() > 10, what="the part on screen")


def test_a_fault_while_drawing_becomes_visible(bare):
    bare.model.broken = True
    bare.model.tell("part")
    assert bare.view.draw.wait()
    told = [data for event, data in bare.model.published if event == "view-error"]
    assert told
    assert told[0]["code"] == "view-failed"
    assert "on fire" in told[0]["message"]
