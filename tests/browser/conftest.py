"""Chromium without a window, and a server of one's own for every module."""

import shutil
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, sync_playwright

from app.view.history import LIMIT, History
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

    def reset(self) -> None:
        """Start from the bare part again, and forget what was done and said."""
        self.model.reset()
        assert self.view.draw.wait()
        self.view.history = History(self.model.keypoint_history(LIMIT))
        self.model.published.clear()

    def stop(self) -> None:
        self.running.stop()
        self.registry.close_all()


@pytest.fixture(scope="module")
def shared_bare() -> Iterator[Bare]:
    """A project in memory with its view, one for a module."""
    made = Bare()
    yield made
    made.stop()


@pytest.fixture
def bare(shared_bare: Bare) -> Bare:
    """The project as new."""
    shared_bare.reset()
    return shared_bare
