"""An executor without processes."""

import pytest

from core.interfaces import Executor
from plugins.executors.local import LocalExecutor


class Inline(Executor):
    """Evaluate in this process, and keep the chunks; ``order`` shuffles the results' arrival."""

    def __init__(self, order=None):
        self.order = order
        self.chunks = []

    def map(self, function, chunks):
        results = []
        for chunk in chunks:
            self.chunks.append(list(chunk))
            try:
                result = function(chunk)
            except Exception as error:
                result = error
            if self.order is None:
                yield chunk, result
            results.append((chunk, result))
        if self.order is not None:
            for i in self.order.permutation(len(results)):
                yield results[i]

    def close(self):
        pass


def evaluate_here(monkeypatch):
    """Let ``executor=local`` evaluate in this process, which starts none."""
    monkeypatch.setattr(
        LocalExecutor,
        "map",
        lambda self, function, chunks: Inline().map(function, chunks),
    )


@pytest.fixture
def inline(monkeypatch):
    """Evaluate in this process for a test; what lasts longer calls `evaluate_here`."""
    evaluate_here(monkeypatch)
