"""Fixtures for calls to models: planted keys, no proxies, short waits."""

import os

import pytest

from plugins.vlms.litellm import failures
from tests.plugins.vlms.asking import KEYS, PROTOCOLS, VARIABLES, model_at
from tests.plugins.vlms.servers import Say, request, serving


@pytest.fixture
def planted(monkeypatch):
    """An environment with a key of every provider, and without proxies."""
    for name in [
        n for n in os.environ if n.endswith("_API_KEY") or n.lower().endswith("_proxy")
    ]:
        monkeypatch.delenv(name)
    for protocol, key in KEYS.items():
        monkeypatch.setenv(VARIABLES[protocol], key)
    monkeypatch.setattr(failures, "FIRST_WAIT_S", 0.05)


@pytest.fixture
def one_try(monkeypatch):
    """A call is not repeated."""
    monkeypatch.setattr(failures, "TRIES", 1)


@pytest.fixture(scope="session")
def warm():
    """LiteLLM imports parts of itself at a first call, which may take longer than a test's time-outs."""
    with serving(lambda call: Say()) as server:
        for protocol in PROTOCOLS:
            list(model_at(server, protocol).complete([request(0)]))
