"""The whole job in the page, against the real server: from the sample part to a corrected program on disk."""

import io
import re
import urllib.request
import zipfile

import numpy as np
import pytest
import trimesh

from planner.setup import Pose
from tests.browser import journey
from tests.browser.eyes import Watch, bluish, picture, until
from tests.browser.real_server import RealServer

# A software renderer on busy cores takes its time.
pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(900)]
SIX = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
TITLES = {"part": "Part", "cell": "Cell", "scan": "Scan", "keypoints": "Key points", "alignment": "Alignment"}
OFFSET = {"x": "1.1", "y": "-0.7", "z": "1.0", "a": "0.2", "b": "-0.8", "c": "0.5"}


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    made = RealServer(tmp_path_factory.mktemp("page") / "data")
    yield made
    made.stop()


@pytest.fixture(scope="module")
def pid(server):
    """A planned flat plate, for the tests that leave it as it is."""
    made = server.rest("/projects", "POST", {"name": "Plate", "sample": "flat-plate"})["id"]
    server.worked(f"/projects/{made}/plan", {})
    return made


@pytest.fixture(scope="module")
def page(server, chromium):
    context = chromium.new_context(viewport={"width": 1024, "height": 680}, accept_downloads=True)
    page = context.new_page()
    page.watch = Watch(server.url).on(page)
    yield page
    context.close()


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
    until(page, lambda: len(server.rest(f"/projects/{pid}/keypoints")) == 1, what="the key point")
    [point] = server.rest(f"/projects/{pid}/keypoints")
    assert abs(point["x_mm"] - 75.0) < 3.0
    assert abs(point["y_mm"] - 50.0) < 3.0
    assert point["z_mm"] == pytest.approx(10.0, abs=1e-3)
    page.get_by_role("button", name="Undo").click()
    until(page, lambda: server.rest(f"/projects/{pid}/keypoints") == [], what="the undo")

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
    found = server.rest(f"/projects/{pid}/alignments/1")
    assert np.allclose([float(t) for t in shown], [found["correction"][k] for k in SIX], atol=6e-4)
    # In the plate's plane one short scan across the edges is worth what it claims, no more: five of its sigmas.
    sigma = np.array([found["dof"][k]["sigma"] for k in "xyzabc"])
    error = np.abs(np.array([float(t) for t in shown]) - truth)
    assert (error < 5.0 * sigma).all()
    assert error[[2, 4, 5]].max() < 0.05

    journey.step(page, "Report")
    with page.expect_download() as download:
        page.get_by_role("link", name="Download the corrected program").click()
    names = zipfile.ZipFile(io.BytesIO(download.value.path().read_bytes())).namelist()
    assert any(n.endswith(".src") for n in names)

    # The inspection itself, rehearsed where the part really is: its maps are drawn.
    page.get_by_role("button", name="Rehearse corrected").click()
    assert page.locator("dialog input[name='x']").input_value() == OFFSET["x"]
    page.locator("dialog button[type='submit']").click()
    page.get_by_role("button", name="Assess the inspection scan").click(timeout=journey.SLOW)
    page.get_by_role("tab", name="Amplitude").click(timeout=journey.SLOW)
    page.locator(".drawer .heatmaplayer image").first.wait_for(timeout=journey.SLOW)
    assert server.rest(f"/projects/{pid}/assessments/1")["after"]["within_2db"] > 0.99
    assert page.watch.complaints == []
    assert page.watch.foreign == []


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


def opened(page, server, pid, step):
    page.goto(f"{server.url}/#/p/{pid}/{step}")
    page.locator(".inspector h2", has_text=TITLES[step]).wait_for()


OUTSIDE = """() => [...document.querySelectorAll('.top *, .steps *, .tools *, .inspector *, .drawer .tabs *')]
  .filter((n) => n.offsetParent && (n.getBoundingClientRect().right > innerWidth + 1 || n.getBoundingClientRect().left < -1))
  .map((n) => `${n.className} ${n.textContent.slice(0, 40)}`)"""


def test_nothing_leaves_a_narrow_window_and_colours_are_whole(server, page, pid):
    opened(page, server, pid, "part")
    journey.seen(page)
    for name in ("Part", "Cell", "Surface", "Key points", "Paths", "Programs", "Scan", "Alignment", "Report"):
        journey.step(page, name)
        assert page.evaluate(OUTSIDE) == [], name
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    # A legend is only true of a canvas that nothing shines through.
    canvas = page.frame_locator("iframe").locator("canvas").first
    assert canvas.evaluate("n => { n.style.opacity = '0.24'; return getComputedStyle(n).opacity; }") == "1"


def test_a_setup_edit_is_checked_saved_and_undone(server, page, pid):
    opened(page, server, pid, "cell")
    field = page.locator("input[name='standoff_mm']")
    field.wait_for()
    before = server.rest(f"/projects/{pid}/setup")["standoff_mm"]
    field.fill("17.5")
    field.press("Tab")
    page.get_by_role("button", name="Save the cell").click()
    page.get_by_role("button", name="Continue: the surface").wait_for()
    assert server.rest(f"/projects/{pid}/setup")["standoff_mm"] == 17.5
    page.locator(".inspector footer").get_by_role("button", name="Undo").click()
    until(page, lambda: server.rest(f"/projects/{pid}/setup")["standoff_mm"] == before, what="the undo")
    # Out of bounds: the browser says so and nothing is offered to save.
    page.locator("input[name='standoff_mm']").fill("-3")
    page.locator("input[name='standoff_mm']").press("Tab")
    assert page.get_by_role("button", name="Save the cell").count() == 0


def test_a_program_name_given_and_taken_back_leaves_the_plan_as_it_was(server, page, pid):
    opened(page, server, pid, "cell")
    field = page.locator("input[name='program_name']")

    def programs() -> str:
        return next(s["state"] for s in server.rest(f"/projects/{pid}/state")["steps"] if s["name"] == "programs")

    def named(text: str) -> None:
        before = server.rest(f"/projects/{pid}/setup")
        field.wait_for(state="attached")
        field.evaluate("e => { const group = e.closest('details'); if (group) group.open = true; }")
        field.fill(text)
        field.press("Tab")
        page.get_by_role("button", name="Save the cell").click()
        until(page, lambda: server.rest(f"/projects/{pid}/setup") != before, what="the saved cell")
        page.get_by_role("button", name="Save the cell").wait_for(state="detached")

    assert programs() == "done"
    named("EB_TRIAL")
    assert programs() != "done"
    named("")
    assert server.rest(f"/projects/{pid}/setup")["program_name"] is None
    assert programs() == "done"


def test_base_is_fitted_to_touched_points_and_saved(server, page, pid):
    opened(page, server, pid, "cell")
    setup = server.rest(f"/projects/{pid}/setup")
    truth = Pose(x_mm=1080.0, y_mm=-64.0, z_mm=405.0, a_deg=11.0, b_deg=0.4, c_deg=-0.7)
    T_base_partnom = Pose(**setup["placement"]).transform("base", "partnom")
    cad = np.array([[0.0, 0.0, 10.0], [150.0, 0.0, 10.0], [0.0, 100.0, 10.0]])
    touched = (truth.transform("world", "base") @ T_base_partnom).points(cad)
    page.get_by_role("button", name="Fit to touched points").click()
    for row, pair in enumerate(np.hstack([cad, touched])):
        for column, value in enumerate(pair):
            page.locator(f"input[name='pair-{row}-{column}']").fill(f"{value:.6f}")
    page.get_by_role("button", name="Fit BASE").click()
    page.get_by_role("button", name="Use this BASE").click()
    page.get_by_role("button", name="Save the cell").click()
    page.get_by_role("button", name="Continue: the surface").wait_for()
    saved = server.rest(f"/projects/{pid}/setup")["base"]
    assert np.allclose([saved[k] for k in SIX], truth.xyzabc(), atol=1e-5)
    assert saved["number"] == setup["base"]["number"]
    page.locator(".inspector footer").get_by_role("button", name="Undo").click()
    until(page, lambda: server.rest(f"/projects/{pid}/setup") == setup, what="the undo")


def test_a_mesh_without_a_unit_is_told_by_its_size(server, page, tmp_path):
    made = server.rest("/projects", "POST", {"name": "Own part"})["id"]
    opened(page, server, made, "part")
    file = tmp_path / "panel.stl"
    trimesh.creation.box((0.3, 0.2, 0.01)).export(file)
    page.locator(".drop input[type=file]").set_input_files(file)
    page.locator(".inspector tr", has_text="300.00 × 200.00 × 10.00 mm").locator("input").check(timeout=journey.SLOW)
    page.get_by_role("button", name="Take panel.stl in m").click()
    page.locator(".top .part").wait_for(timeout=journey.SLOW)
    assert server.rest(f"/projects/{made}/part")["extents_mm"] == pytest.approx([300.0, 200.0, 10.0], abs=1e-3)


def test_why_a_job_failed_is_said(server, page, pid):
    request = urllib.request.Request(f"{server.url}/api/v1/projects/{pid}/scans?name=wrong.csv", b"x_mm,law\n1,2\n")
    urllib.request.urlopen(request).close()
    opened(page, server, pid, "alignment")
    page.get_by_role("button", name="Align", exact=True).click()
    said = page.locator(".inspector .issue.error", has_text="missing").filter(has_text=re.compile(r"scan-\d+\.csv"))
    said.wait_for(timeout=journey.SLOW)
    # It is still there for somebody who comes later.
    page.reload()
    said.wait_for(timeout=journey.SLOW)


def test_what_can_be_no_scan_is_said_at_once_and_readings_go_only_when_asked(server, page, pid):
    opened(page, server, pid, "scan")
    before = server.rest(f"/projects/{pid}/scans")
    files = page.locator(".inspector .drop input[type=file]")
    files.set_input_files({"name": "wrong.csv", "mimeType": "text/csv", "buffer": b"a;b\n1;2\n"})
    page.locator(".inspector .issue.error", has_text="semicolons").wait_for(timeout=journey.SLOW)
    assert server.rest(f"/projects/{pid}/scans") == before
    files.set_input_files({"name": "half.csv", "mimeType": "text/csv", "buffer": b"x_mm,law\n1,2\n"})
    until(page, lambda: len(server.rest(f"/projects/{pid}/scans")) == len(before) + 1, what="the scan")
    number = server.rest(f"/projects/{pid}/scans")[-1]["number"]
    delete = page.get_by_role("button", name=f"Delete scan {number}", exact=True)
    delete.click(timeout=journey.SLOW)
    page.locator("dialog").get_by_role("button", name="Cancel").click()
    assert len(server.rest(f"/projects/{pid}/scans")) == len(before) + 1
    delete.click()
    page.locator("dialog button[type='submit']").click()
    until(page, lambda: server.rest(f"/projects/{pid}/scans") == before, what="the scan to go")
    delete.wait_for(state="detached")


def test_two_browsers_see_each_others_key_points(server, page, chromium, pid):
    opened(page, server, pid, "keypoints")
    other = chromium.new_page(viewport={"width": 640, "height": 420})
    other.goto(f"{server.url}/#/p/{pid}/keypoints")
    journey.seen(page)
    journey.chosen(other)
    page.get_by_role("button", name="Clear").click()
    other.get_by_text("No key points yet").first.wait_for(timeout=journey.SLOW)
    page.get_by_role("button", name="Undo").click()
    journey.chosen(other)
    other.close()


@pytest.mark.parametrize("lost", ["refused", "cut off"])
def test_an_answer_that_did_not_come_is_asked_for_again(server, chromium, pid, lost):
    """Without another event, which may never come."""
    before = server.rest(f"/projects/{pid}/keypoints")
    other = chromium.new_page(viewport={"width": 1024, "height": 680})
    other.goto(f"{server.url}/#/p/{pid}/keypoints")
    journey.chosen(other)
    left = [3]

    def fail(route):
        left[0] -= 1
        if left[0] < 0:
            route.continue_()
        elif lost == "refused":
            route.fulfill(status=503, json={"error": {"message": "busy"}})
        else:
            route.abort()

    other.route("**/keypoints", lambda route: fail(route) if route.request.method == "GET" else route.continue_())
    other.get_by_role("button", name="Clear").click()
    until(other, lambda: server.rest(f"/projects/{pid}/keypoints") == [], what="the edit")
    other.get_by_text("No key points yet").first.wait_for(timeout=journey.SLOW)
    until(other, lambda: left[0] < 0, what="the answer asked for again")
    other.get_by_role("button", name="Undo").click()
    until(other, lambda: server.rest(f"/projects/{pid}/keypoints") == before, what="the undo")
    other.close()


def test_the_page_goes_on_after_the_server_was_killed(server, page, pid):
    opened(page, server, pid, "keypoints")
    journey.chosen(page)
    before = server.rest(f"/projects/{pid}/keypoints")
    assert len(before) >= 3
    page.get_by_role("button", name="Clear").click()
    until(page, lambda: server.rest(f"/projects/{pid}/keypoints") == [], what="the edit")
    server.kill()
    page.locator(".people.off").wait_for(timeout=journey.SLOW)
    server.restart()
    page.locator(".people:not(.off)").wait_for(timeout=journey.SLOW)
    journey.seen(page)
    until(page, lambda: picture(page, ".stage").std() > 10, what="the part on screen again")
    # What was edited before can still be undone.
    page.get_by_role("button", name="Undo").click(timeout=journey.SLOW)
    until(page, lambda: server.rest(f"/projects/{pid}/keypoints") == before, what="the undo")
    # The same points again: the plan of before holds.
    journey.step(page, "Paths")
    page.locator(".inspector .verdict", has_text="Both paths keep to the tolerances").wait_for(timeout=journey.SLOW)
