import importlib.metadata

import pytest

from core.plugins import Plugins


@pytest.fixture
def found(monkeypatch):
    """No plugins at all, until the test registers some."""
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **_: [])
    return Plugins()
