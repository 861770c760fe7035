"""Keep-out regions on the page: what may be said of them, and undo."""

import pytest

from tests.browser import journey
from tests.browser.eyes import Watch, until
from tests.browser.real_server import RealServer

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(300)]
CLAMP = {"type": "disc", "name": "clamp", "centre_mm": [60.0, 50.0, 10.0], "radius_mm": 8.0, "may_cross": False}
SPILLS = """list => [...list.querySelectorAll('*')].map(n => [n.textContent, n.getBoundingClientRect().right])
  .filter(([, right]) => right > list.getBoundingClientRect().right + 0.5)"""
LONGEST_NAME = "bracket at the rear spar, upper fastener "[:40]


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    made = RealServer(tmp_path_factory.mktemp("keepouts") / "data")
    yield made
    made.stop()


def test_the_height_of_a_keep_out_is_said_and_taken_back(server, chromium):
    pid = server.rest("/projects", "POST", {"name": "Clamped", "sample": "flat-plate"})["id"]
    setup = server.rest(f"/projects/{pid}/setup")
    box = {"type": "box", "name": LONGEST_NAME, "min_mm": [-1000.0, 0.0, 0.0], "max_mm": [30.0, 1000.0, 400.0]}
    setup["inspection"]["keep_outs"] = [CLAMP, box]
    server.rest(f"/projects/{pid}/setup", "PUT", setup)

    def heights():
        return [k["height_mm"] for k in server.rest(f"/projects/{pid}/setup")["inspection"]["keep_outs"]]

    context = chromium.new_context(viewport={"width": 1024, "height": 768})
    page = context.new_page()
    page.watch = Watch(server.url).on(page)
    page.goto(f"{server.url}/#/p/{pid}/surface")
    page.locator("[data-key='group-keep']").click(timeout=journey.SLOW)
    height = page.locator("input[name='keep-height-0']")
    assert height.input_value() == ""
    height.fill("22.5")
    height.press("Tab")
    until(page, lambda: heights() == [22.5, None], what="the height of the clamp")
    until(page, lambda: height.input_value() == "22.5", what="the height on the page")
    # Nothing stands 0 mm high: it is said, and nothing is sent.
    said = height.evaluate("n => { n.value = '0'; n.dispatchEvent(new Event('change')); return n.validationMessage; }")
    assert said == "A height is above 0; leave it blank if it is not known."
    assert heights() == [22.5, None]
    # Blank is not known again, and undo brings both back, one after the other.
    height.fill("")
    height.press("Tab")
    until(page, lambda: heights() == [None, None], what="the height unknown")
    undo = page.locator(".inspector footer").get_by_role("button", name="Undo")
    for expected in ([22.5, None], [None, None]):
        undo.click()
        until(page, lambda expected=expected: heights() == expected, what=f"undo to {expected}")
    # The list fits the inspector, however long a name and however big a box.
    assert page.locator(".keep-outs").evaluate(SPILLS) == []
    assert page.watch.complaints == []
    context.close()
