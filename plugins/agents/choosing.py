"""Find the run that the words of ``vlmgineer mcp`` name: a new one, or the one in its folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from omegaconf import OmegaConf

from core.config.compose import load
from core.config.gate import choose_again
from core.errors import UsageError
from core.store.reader import StoredRun
from core.support.text import hydra_word

CHOSEN = {"vlm": "agent", "evolution": "agent"}
"""What drives the run."""

USUAL = {"budget.elite_s": "0", "budget.curves": "20"}
"""What differs from other runs unless the words set it: an agent decides by itself what is worth more trials."""

_MAY_DIFFER = ("executor", "listener", "film", "name", "second", "patience_s")


def choose_run(folder: Path | None, words: Sequence[str]) -> list[str]:
    """Return the words with which the run begins, or goes on where there is one in its folder.

    Raises:
        UsageError: words of another model or strategy, or the folder holds another run.
    """
    given = {word.partition("=")[0]: word for word in words}
    if "resume" in given:
        if folder is not None:
            raise UsageError(f"{given['resume']}: leave folder={folder} away")
        return list(words)

    for key, value in CHOSEN.items():
        if given.get(key, f"{key}={value}") != f"{key}={value}":
            raise UsageError(
                f"{given[key]}: an agent drives this run; leave {key} away"
            )

    defaults = CHOSEN | USUAL
    missing = [f"{key}={defaults[key]}" for key in defaults if key not in given]
    chosen = [*words, *missing]
    if folder is None:
        return chosen
    if StoredRun(folder).exists and StoredRun(folder).config():
        _refuse_other_run(folder, chosen)
        return [f"resume={folder}", *choose_again(StoredRun(folder).config(), chosen)]
    return [*chosen, f"hydra.run.dir={hydra_word(str(folder))}"]


def _refuse_other_run(folder: Path, words: Sequence[str]) -> None:
    """Check that a folder's run is the one that the words name."""
    composed = OmegaConf.to_container(load("config", words), resolve=True)
    asked = cast(dict[str, Any], composed)
    stored = StoredRun(folder).config()
    for key in asked:
        if key not in _MAY_DIFFER and asked[key] != stored.get(key):
            raise UsageError(
                f"{folder} holds a run with another {key} than these words say; choose another folder, or give the "
                f"words with which it began. To go on with it: vlmgineer mcp resume={folder}"
            )
