"""``python -m core.evaluate``: the command ``vlmgineer evaluate`` by its module's name."""

from __future__ import annotations

from core.__main__ import dispatch_words
from core.support.cli import command

if __name__ == "__main__":
    command(lambda words: dispatch_words(["evaluate", *words]))
