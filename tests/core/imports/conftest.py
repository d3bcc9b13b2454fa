import pytest

from core.imports import solids
from core.imports.convex import cut_bytes


@pytest.fixture(autouse=True)
def isolated(request, tmp_path_factory, monkeypatch):
    """An empty cache; meshes are read in this process, which starts no other for each, unless a test asks for it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
    solids._cut.cache_clear()
    if not getattr(request, "param", False):
        monkeypatch.setattr(solids, "_isolated", lambda data, words, name: cut_bytes(data, *words))
