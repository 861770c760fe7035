"""Two projects of one part in the page: aligned together by a tick, and whose record is edited."""

import pytest

from tests.browser import journey
from tests.browser.eyes import Watch
from tests.browser.real_server import RealServer

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    made = RealServer(tmp_path_factory.mktemp("several") / "data")
    yield made
    made.stop()


def test_tick_align_and_write_the_record_of_the_result(server, chromium):
    pids = [server.rest("/projects", "POST", {"name": n, "sample": "flat-plate"})["id"] for n in ("Face A", "Face B")]
    for pid in pids:
        server.worked(f"/projects/{pid}/plan", {})
    server.worked(f"/projects/{pids[0]}/simulate", {"offset": {"x_mm": 0.5, "z_mm": 0.7}, "seed": 3})
    context = chromium.new_context(viewport={"width": 1024, "height": 900})
    page = context.new_page()
    page.watch = Watch(server.url).on(page)
    page.goto(f"{server.url}/#/p/{pids[0]}/alignment")
    tick = page.locator('input[name^="together-"]')
    page.get_by_text("It has no alignment scan yet.").wait_for(timeout=journey.SLOW)
    assert tick.is_disabled()
    server.worked(f"/projects/{pids[1]}/simulate", {"offset": {"x_mm": 0.5, "z_mm": 0.7}, "seed": 4})
    page.reload()
    page.locator('input[name^="together-"]:not([disabled])').check(timeout=journey.SLOW)
    page.get_by_role("button", name="Align", exact=True).click()
    table = page.locator(".inspector table", has_text="Face B")
    table.wait_for(timeout=journey.SLOW)
    assert "Face A" in table.inner_text()
    for pid, other in zip(pids, ("Face B", "Face A"), strict=True):
        (made,) = server.rest(f"/projects/{pid}/alignments")
        assert made["options"]["together"] == [other]
    page.goto(f"{server.url}/#/p/{pids[0]}/report")
    page.get_by_text("filled in").click(timeout=journey.SLOW)
    serial = page.locator('input[name="part.serial"]')
    serial.fill("SN-ONE")
    serial.blur()
    page.locator('input[name="record-next"]').uncheck()
    page.get_by_role("button", name="Save the record").click()
    page.locator("button[disabled]", has_text="Save the record").wait_for(timeout=journey.SLOW)
    assert server.rest(f"/projects/{pids[0]}/alignments/1/record")["part"]["serial"] == "SN-ONE"
    assert server.rest(f"/projects/{pids[0]}/record")["part"]["serial"] == ""
    page.locator('select[name="record-of"]').select_option("")
    page.get_by_text("0 of ").wait_for(timeout=journey.SLOW)
    assert page.watch.complaints == []
    context.close()
