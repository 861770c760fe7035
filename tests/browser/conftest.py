"""Chromium without a window, and a server of one's own for every module."""

import shutil
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, sync_playwright

from tests.browser.bare_server import Running, bare_app
from tests.browser.eyes import ARGS
from tests.view.memory import MemoryModel


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """One browser for all tests."""
    path = shutil.which("chromium")
    assert path, "the browser tests need Chromium (Debian: apt-get install chromium)"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, headless=True, args=ARGS)
        yield browser
        browser.close()


class Bare:
    """A view of a project in memory, on a port of its own."""

    def __init__(self) -> None:
        from app.view.registry import ViewRegistry  # noqa: PLC0415

        self.model = MemoryModel()
        self.registry = ViewRegistry(lambda _: self.model)
        self.view = self.registry.get("demo")
        assert self.view.draw.wait()
        self.running = Running(bare_app(self.registry))

    def stop(self) -> None:
        self.running.stop()
        self.registry.close_all()


@pytest.fixture
def bare() -> Iterator[Bare]:
    """A fresh project in memory with its view."""
    made = Bare()
    yield made
    made.stop()
