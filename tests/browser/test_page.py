"""The whole job in the page, against the real server: from the sample part to a corrected program on disk."""

import io
import json
import re
import urllib.request
import zipfile

import numpy as np
import pytest

from tests.browser import journey
from tests.browser.eyes import Watch, bluish, picture, until
from tests.browser.real_server import RealServer

# A software renderer on busy cores takes its time.
pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(900)]
OFFSET = {"x": "1.1", "y": "-0.7", "z": "1.0", "a": "0.2", "b": "-0.8", "c": "0.5"}


@pytest.fixture
def server(tmp_path):
    made = RealServer(tmp_path / "data")
    yield made
    made.stop()


@pytest.fixture
def page(server, chromium):
    context = chromium.new_context(viewport={"width": 1280, "height": 800}, accept_downloads=True)
    page = context.new_page()
    page.watch = Watch(server.url).on(page)
    yield page
    context.close()


def rest(server, path):
    with urllib.request.urlopen(f"{server.url}/api/v1{path}") as answer:
        return json.load(answer)


def test_from_the_sample_to_the_corrected_program(server, page):
    journey.open_sample(page, server.url, "Try the flat plate")
    pid = re.search(r"#/p/([^/]+)", page.url)[1]
    assert "150.00 × 100.00 × 10.00 mm" in page.locator(".top .part").inner_text()
    journey.seen(page)
    until(page, lambda: picture(page, ".stage").std() > 10, what="the part on screen")

    # A key point by a real click in the middle of the view, and away again by undo.
    journey.step(page, "Key points")
    page.locator(".tools button", has_text="Top").click()
    page.wait_for_timeout(1500)
    box = page.locator("iframe").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    until(page, lambda: len(rest(server, f"/projects/{pid}/keypoints")) == 1, what="the key point")
    [point] = rest(server, f"/projects/{pid}/keypoints")
    assert abs(point["x_mm"] - 75.0) < 3.0
    assert abs(point["y_mm"] - 50.0) < 3.0
    assert point["z_mm"] == pytest.approx(10.0, abs=1e-3)
    page.get_by_role("button", name="Undo").click()
    until(page, lambda: rest(server, f"/projects/{pid}/keypoints") == [], what="the undo")

    journey.suggest(page)
    journey.plan(page)
    until(page, lambda: bluish(picture(page, ".stage")) > 0.002, what="the path on screen")
    journey.step(page, "Programs")
    page.locator(".krl pre", has_text="DEF ").wait_for(timeout=journey.SLOW)
    journey.rehearse(page, OFFSET)
    journey.align(page)
    shown = [t.replace("−", "-").replace("+", "") for t in page.locator("table.correction b").all_inner_texts()]
    truth = [float(v) for v in OFFSET.values()]
    # The page shows what the server found, and that is where the part was hidden.
    found = rest(server, f"/projects/{pid}/alignments/1")
    six = ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"]
    assert np.allclose([float(t) for t in shown], [found["correction"][k] for k in six], atol=6e-4)
    assert np.abs(np.array([float(t) for t in shown]) - truth).max() < 0.1

    journey.step(page, "Report")
    with page.expect_download() as download:
        page.get_by_role("link", name="Download the corrected program").click()
    names = zipfile.ZipFile(io.BytesIO(download.value.path().read_bytes())).namelist()
    assert any(n.endswith(".src") for n in names)
    assert page.watch.complaints == []
    assert page.watch.foreign == []


def test_the_page_goes_on_after_the_server_was_killed(server, page):
    journey.open_sample(page, server.url, "Try the flat plate")
    pid = re.search(r"#/p/([^/]+)", page.url)[1]
    journey.suggest(page)
    before = rest(server, f"/projects/{pid}/keypoints")
    assert len(before) >= 3
    server.kill()
    page.locator(".people.off").wait_for(timeout=journey.SLOW)
    server.restart()
    page.locator(".people:not(.off)").wait_for(timeout=journey.SLOW)
    assert rest(server, f"/projects/{pid}/keypoints") == before
    journey.seen(page)
    until(page, lambda: picture(page, ".stage").std() > 10, what="the part on screen again")
    journey.plan(page)


def test_two_browsers_see_each_others_key_points(server, page, chromium):
    journey.open_sample(page, server.url, "Try the flat plate")
    other = chromium.new_page(viewport={"width": 1280, "height": 800})
    other.goto(re.sub(r"/part$", "/keypoints", page.url))
    other.get_by_text("No key points yet").wait_for(timeout=journey.SLOW)
    journey.suggest(page)
    journey.chosen(other)
    other.close()


def test_names_are_data(server, page):
    evil = "<img src=x onerror=alert(1)><b>bold</b>"
    page.goto(server.url)
    page.get_by_role("button", name="New project").click()
    page.locator("dialog input").fill(evil)
    page.locator("dialog button[type='submit']").click()
    page.locator(".top .project", has_text="<img").wait_for()
    assert page.locator(".top .project").inner_text() == evil
    assert page.locator("img[src='x'], .top b").count() == 0
    page.goto(f"{server.url}/#/")
    page.get_by_role("link", name=evil).wait_for()


def test_a_setup_edit_is_checked_saved_and_undone(server, page):
    journey.open_sample(page, server.url, "Try the flat plate")
    pid = re.search(r"#/p/([^/]+)", page.url)[1]
    journey.step(page, "Cell")
    field = page.locator("input[name='standoff_mm']")
    field.wait_for()
    before = rest(server, f"/projects/{pid}/setup")["standoff_mm"]
    field.fill("17.5")
    field.press("Tab")
    page.get_by_role("button", name="Save the cell").click()
    page.get_by_role("button", name="Continue: the surface").wait_for()
    assert rest(server, f"/projects/{pid}/setup")["standoff_mm"] == 17.5
    page.locator(".inspector footer").get_by_role("button", name="Undo").click()
    until(page, lambda: rest(server, f"/projects/{pid}/setup")["standoff_mm"] == before, what="the undo")
    # Out of bounds: the browser says so and nothing is offered to save.
    page.locator("input[name='standoff_mm']").fill("-3")
    page.locator("input[name='standoff_mm']").press("Tab")
    assert page.get_by_role("button", name="Save the cell").count() == 0
