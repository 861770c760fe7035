"""A store in a folder of its own."""

import pytest

from app.settings import ServerSettings
from app.store.store import open_store


@pytest.fixture
def store(tmp_path):
    opened = open_store(ServerSettings(data=tmp_path))
    yield opened
    opened.close()
