"""Makes docs/img/page.png: the aerofoil sample, aligned. Run `python -m tests.browser.picture`."""

import shutil
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

from tests.browser import journey
from tests.browser.eyes import ARGS
from tests.browser.real_server import ROOT, RealServer

STEPS = {"Key points": "keypoints", "Paths": "paths", "Alignment": "page"}


def main() -> None:
    """Go through the whole job and keep a picture of three steps."""
    folder = Path(tempfile.mkdtemp())
    server = RealServer(folder)
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), headless=True, args=ARGS)
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            journey.open_sample(page, server.url, "Try the aerofoil")
            journey.seen(page)
            journey.suggest(page)
            journey.plan(page)
            # Hidden where the sample says.
            journey.rehearse(page, {})
            journey.align(page)
            page.locator(".inspector .verdict.good", has_text="Pass").wait_for(timeout=journey.SLOW)
            for step, name in STEPS.items():
                journey.step(page, step)
                if step == "Alignment":
                    page.locator(".legend:not(.hidden)", has_text="Deviation after").wait_for(timeout=journey.SLOW)
                # The chart and the camera come to rest.
                page.wait_for_timeout(8_000)
                page.screenshot(path=ROOT / "docs" / "img" / f"{name}.png")
            browser.close()
    finally:
        server.stop()
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
