"""Compose a run and start it, from a program of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from core.config.compose import add_search_words, load
from core.config.folders import new_folder, stamp, task_folder
from core.events import Result
from core.search.orchestration import run
from core.support.files import writing
from core.support.text import hydra_word


class Experiment:
    """A run, composed when it is created, and started by `run`.

    ``Experiment("budget.n_agent=2", task="BringCube", seed=1)``: positional arguments are the words of the command
    line. Config groups and top-level keys can be keyword arguments.

    Raises:
        UserError: a wrong choice, key or type; the message says what is possible.
    """

    def __init__(self, *overrides: str, **choices: Any) -> None:
        named = [f"{key}={hydra_word(value)}" for key, value in choices.items()]
        self.overrides = (*named, *overrides)
        composed = load("config", self.overrides)
        self.config: DictConfig = add_search_words(composed, self.overrides)
        self.result: Result | None = None
        self.folder: Path | None = None

    def run(self, folder: str | Path | None = None) -> Result:
        """Run in ``folder``, by default ``runs/<task>/<time>``, and leave there the files that the command leaves.

        Raises:
            UserError: a part or a setting is wrong, or the folder already holds a run or can't be written.
        """
        if folder is None:
            folder = new_folder(f"runs/{task_folder(self.config.task)}/{stamp()}")
        self.folder = Path(folder)
        with writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        self.result = run(self.config, self.folder)
        return self.result
