"""Serial parts in the page: the tab appears with the second part, parts are ticked on and off, the report opens."""

import pytest

from tests.browser.eyes import Watch, until
from tests.browser.real_server import RealServer

# Tabs of the step Alignment with a table, and a word of each.
TABLES = {"Key points": "matched", "Directions": "measured", "All alignments": "MAP", "Batch": "common"}
pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(600)]
KEYS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
OFFSETS = ((1.1, -0.7, 1.0, 0.2, -0.8, 0.5), (1.2, -0.5, 0.9, 0.22, -0.75, 0.45), (0.9, -0.9, 1.1, 0.15, -0.8, 0.5))


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    made = RealServer(tmp_path_factory.mktemp("serial") / "data")
    yield made
    made.stop()


def test_parts_are_compared_and_can_be_left_out(server, chromium):
    pid = server.rest("/projects", "POST", {"name": "Plates", "sample": "flat-plate"})["id"]
    server.worked(f"/projects/{pid}/plan", {})
    for seed, offset in enumerate(OFFSETS):
        server.worked(f"/projects/{pid}/simulate", {"offset": dict(zip(KEYS, offset, strict=True)), "seed": seed})
        newest = server.rest(f"/projects/{pid}/scans")[-1]["number"]
        server.worked(f"/projects/{pid}/alignments", {"scans": [newest]})
    context = chromium.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    watch = Watch(server.url).on(page)
    page.goto(f"{server.url}/#/p/{pid}/alignment")
    page.get_by_role("tab", name="Batch").click()
    table = page.locator(".drawer .batch table:not(.patch)")
    table.wait_for()
    said = server.rest(f"/projects/{pid}/batch")
    assert table.locator("th").first.inner_text() == "3 parts, BASE"
    common = table.locator("tr", has_text="common").locator("td").all_inner_texts()[1:]
    digits = {"deg": 4, "mm": 3}
    assert [float(v.replace("\N{MINUS SIGN}", "-")) for v in common] == [
        pytest.approx(d["mean"], abs=0.6 * 10 ** -digits[d["unit"]]) for d in said["directions"]
    ]
    assert table.locator("svg.strip circle").count() == 3 * len(said["directions"])
    tabs = page.locator(".drawer .tabs .tab")
    assert len({round(tabs.nth(i).bounding_box()["height"]) for i in range(tabs.count())}) == 1
    # Everything is in sight without scrolling sideways, in a narrow window too.
    for width in (1024, 1440, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        for name, word in TABLES.items():
            page.get_by_role("tab", name=name, exact=True).click()
            page.locator(".drawer .body", has_text=word).wait_for()
            assert page.locator(".drawer .body").evaluate("n => n.scrollWidth - n.clientWidth") <= 0, (width, name)
    hide = page.locator(".drawer .tabs .end").bounding_box()
    assert (
        hide["x"] + hide["width"]
        <= page.locator(".drawer").bounding_box()["x"] + page.locator(".drawer").bounding_box()["width"]
    )
    page.locator("input[name='part-2']").uncheck()
    page.locator(".drawer th", has_text="2 parts").wait_for()
    assert "not told" in table.locator("tr", has_text="scatter").first.inner_text()
    with context.expect_page() as opened:
        page.get_by_role("link", name="Report of the batch: open").click()
    opened.value.locator("h1", has_text="Batch of serial parts").wait_for()
    assert "2 parts cannot tell" in opened.value.content()
    page.locator("input[name='part-3']").uncheck()
    page.get_by_text("Choose two parts or more.").wait_for()
    # What is suggested is put in force, seen to be so, and taken back, with the alignments as they were.
    page.locator("input[name='part-2']").check()
    page.locator("input[name='part-3']").check()
    change = page.locator(".drawer .batch table.patch tr", has_text="fixture.sigma_mm")
    change.wait_for()
    before = server.rest(f"/projects/{pid}/setup")
    assert server.rest(f"/projects/{pid}/batch")["setup_version"] == 1
    page.get_by_role("button", name="Use in the setup").dblclick()
    page.locator(".batch .row .tag", has_text="in force").wait_for()
    sigma = said["patch"]["fixture"]["sigma_mm"]
    merged = {group: before[group] | fields for group, fields in said["patch"].items()}
    assert server.rest(f"/projects/{pid}/setup") == before | merged
    assert [float(v) for v in change.locator("td.num").all_inner_texts()] == [before["fixture"]["sigma_mm"], sigma]
    page.get_by_text("Its suggestion is in force now").wait_for()
    assert server.rest(f"/projects/{pid}/alignments")[-1]["stale"] is True
    page.locator(".drawer .batch").get_by_role("button", name="Undo").click()
    page.locator("input[name='part-3']").wait_for()
    until(page, lambda: not server.rest(f"/projects/{pid}/alignments")[-1]["stale"], what="the undo")
    assert server.rest(f"/projects/{pid}/setup") == before
    until(page, page.get_by_role("button", name="Use in the setup").is_enabled, what="the offer to use it again")
    assert watch.complaints == []
    assert watch.foreign == []
    context.close()
