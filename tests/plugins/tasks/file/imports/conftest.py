import pytest

from core.errors import UserError
from plugins.tasks.file.imports import solids


@pytest.fixture(autouse=True)
def isolated(request, tmp_path_factory, monkeypatch):
    """An empty cache; meshes are read in this process, which starts no other for each, unless a test asks for it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
    solids._read.cache_clear()
    if not getattr(request, "param", False):
        monkeypatch.setattr(solids, "isolated", called)


def called(function, what, data, *words, limit_s=None, step=""):
    """Call a function without a process of its own."""
    try:
        return function(data, *words)
    except UserError as error:
        raise UserError(f"{what} {error}") from error
