"""A calibration in the page: files in, values and curve seen, the patch put in force and taken back."""

import os
import signal

import pytest

from tests.api.test_calibrations import couplant_csv, tilt_csv
from tests.api.test_hangup import calibrating
from tests.browser.eyes import Watch, until
from tests.browser.real_server import RealServer

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(300)]


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    made = RealServer(tmp_path_factory.mktemp("calibration") / "data")
    yield made
    made.stop()


def give(page, name, content):
    files = page.locator('input[name="calibration-files"]')
    files.set_input_files({"name": name, "mimeType": "text/csv", "buffer": content})


def test_calibrate_see_use_and_undo(server, chromium, tmp_path):
    pid = server.rest("/projects", "POST", {"name": "Cell"})["id"]
    context = chromium.new_context(viewport={"width": 1024, "height": 900}, accept_downloads=True)
    page = context.new_page()
    page.watch = Watch(server.url).on(page)
    page.goto(f"{server.url}/#/p/{pid}/cell")
    page.locator('[data-key="group-probe"]').click()
    page.locator('[data-key="calibrate-probe"]').click()

    def losses():
        return server.rest(f"/projects/{pid}/setup")["probe"]["tilt_loss_db_per_deg2"]

    before = losses()
    # A file of another kind is a sentence, and the tab stays usable.
    give(page, "gaps.csv", couplant_csv())
    page.locator(".calibrate .issue.error", has_text="b_deg").wait_for()
    give(page, "tilt.csv", tilt_csv())
    row = page.locator(".calibrate tr", has_text="Tilt loss about B")
    row.wait_for()
    assert "measured" in row.inner_text()
    assert "1.7" in row.inner_text()
    drawn = page.locator(".calibrate .figure img")
    until(page, lambda: drawn.evaluate("i => i.complete && i.naturalWidth > 300"), what="the drawing")
    assert losses() == before
    change = page.locator(".calibrate table.patch tr", has_text="tilt_loss_db_per_deg2.c")
    assert [float(v) for v in change.locator("td.num").all_inner_texts()] == [before["c"], 0.8]
    with context.expect_page() as report:
        page.get_by_role("link", name="Report of the calibration: open").click()
    report.value.get_by_text("Tilt loss of the probe").first.wait_for()
    report.value.close()
    with page.expect_download() as got:
        page.get_by_role("link", name="Report of the calibration: PDF").click()
    got.value.save_as(tmp_path / "report.pdf")
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF-")
    listed = page.locator(".calibrate .past tr", has_text="tilt.csv")
    assert "not used" in listed.inner_text()

    use = page.get_by_role("button", name="Use in the setup")
    use.dblclick()
    page.locator(".calibrate .row .tag", has_text="in force").wait_for()
    listed.get_by_text("in force").wait_for()
    assert losses() == {"b": 1.7, "c": 0.8}
    assert use.is_disabled()
    undo = page.locator(".inspector footer").get_by_role("button", name="Undo")
    undo.click()
    # The server knows of the undo before the page does.
    until(page, lambda: losses() == before, what="the undo")
    until(page, undo.is_disabled, what="the undo button, with nothing left to undo,")
    # Somebody else changes the cell: the patch is of an earlier one and can no longer be used by a wrong click.
    use.wait_for()
    until(page, use.is_enabled, what="the offer to use it again")
    other = server.rest(f"/projects/{pid}/setup")
    other["tool"]["tcp"]["z_mm"] = 123.0
    server.rest(f"/projects/{pid}/setup", "PUT", other)
    page.get_by_text("It was computed with an earlier cell.").wait_for()
    assert use.is_disabled()
    assert losses() == before
    # It is kept: a reload finds it again, with what it would have changed, and it can be deleted.
    page.reload()
    page.locator('[data-key="group-probe"]').click()
    page.locator('[data-key="calibrate-probe"]').click()
    listed.get_by_text("was in force").wait_for()
    listed.get_by_role("button", name="Show calibration 1").click()
    change.wait_for()
    assert [float(v) for v in change.locator("td.num").all_inner_texts()] == [before["c"], 0.8]
    page.get_by_text("It was computed with an earlier cell.").wait_for()
    listed.get_by_role("button", name="Delete calibration 1").click()
    page.locator("dialog button[type='submit']").click()
    listed.wait_for(state="detached")
    assert server.rest(f"/projects/{pid}/calibrations") == []
    refused = "the server responded with a status of 422"
    assert [c for c in page.watch.complaints if refused not in c] == []
    assert page.watch.foreign == []
    context.close()


def test_cancel_ends_the_work_and_keeps_nothing(server, chromium):
    pid = server.rest("/projects", "POST", {"name": "Impatient"})["id"]
    page = chromium.new_page(viewport={"width": 1024, "height": 768})
    page.watch = Watch(server.url).on(page)
    page.goto(f"{server.url}/#/p/{pid}/cell")
    page.locator('[data-key="group-probe"]').click()
    page.locator('[data-key="calibrate-probe"]').click()
    give(page, "tilt.csv", tilt_csv())
    until(page, lambda: calibrating(server.process.pid), what="the calibration")
    # Held, it would be there for ever.
    for child in calibrating(server.process.pid):
        os.kill(child, signal.SIGSTOP)
    page.locator('[data-key="calibration-cancel"]').click()
    page.locator(".calibrate .issue", has_text="The calibration was cancelled; nothing was kept.").wait_for()
    until(page, lambda: not calibrating(server.process.pid), what="the end of the work")
    assert server.rest(f"/projects/{pid}/calibrations") == []
    # The tab is ready for other readings.
    page.locator('[data-key="calibration-choose"]').wait_for()
    assert page.watch.complaints == []
    page.close()
