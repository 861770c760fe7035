"""The engineer's way through the page, click by click; used by the test and by the picture."""

import re

from playwright.sync_api import Page

from tests.browser.eyes import until

SLOW = 180_000


def step(page: Page, name: str) -> None:
    """Choose a step by its line on the left."""
    page.locator(".steps .step", has_text=name).first.click()
    page.locator(".inspector h2", has_text=name).wait_for()


def open_sample(page: Page, url: str, button: str) -> None:
    """Make a project from a sample with one click, and wait until its part is on the page."""
    page.goto(url)
    page.get_by_role("button", name=button).click()
    page.locator(".top .part").wait_for(timeout=SLOW)


MET = (
    "() => Boolean(document.querySelector('iframe')?.contentDocument?.querySelector('[data-testid=\"floating-panel\"]')"
    "?.textContent.includes('echobase-view-'))"
)


def seen(page: Page) -> None:
    """Wait until the 3D view has met the server."""
    until(page, lambda: page.evaluate(MET), SLOW / 1000, "the meeting of view and server")


def chosen(page: Page) -> None:
    """Wait until the page speaks of a number of key points."""
    page.locator(".inspector .verdict", has_text=re.compile(r"\d+ key points")).wait_for(timeout=SLOW)


def suggest(page: Page) -> None:
    step(page, "Key points")
    page.get_by_role("button", name="Suggest key points").click()
    chosen(page)


def plan(page: Page) -> None:
    step(page, "Paths")
    page.get_by_role("button", name="Plan both paths").click()
    page.locator(".inspector .verdict", has_text="Both paths keep to the tolerances").wait_for(timeout=SLOW)


def rehearse(page: Page, offset: dict[str, str]) -> None:
    step(page, "Scan")
    page.get_by_role("button", name="Rehearse the alignment scan").click()
    for axis, value in offset.items():
        page.locator(f"dialog input[name='{axis}']").fill(value)
    page.locator("dialog button[type='submit']").click()
    page.get_by_role("button", name="Continue: align").wait_for(timeout=SLOW)


def align(page: Page) -> None:
    step(page, "Alignment")
    page.get_by_role("button", name="Align", exact=True).click()
    page.locator(".inspector table.correction").wait_for(timeout=SLOW)
