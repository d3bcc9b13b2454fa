"""``python -m core.prompt``: the command ``vlmgineer prompt`` by its module's name."""

from __future__ import annotations

from core.__main__ import dispatch_words
from core.support.cli import command

if __name__ == "__main__":
    command(lambda words: dispatch_words(["prompt", *words]))
