"""The same as ``python -m core.run``, from Python."""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from core.config.compose import load
from core.events import Result
from core.search.orchestration import run
from core.store.database import writing


class Experiment:
    """A run that is told what it is to do, then runs.

    ``Experiment("budget.n_agent=2", task="BringCube", seed=1)``: the words are those of the command line, and what is
    a choice or a plain setting may be told by name.

    Raises:
        UserError: a wrong choice, key or type; says what is possible.
    """

    def __init__(self, *overrides: str, **choices: Any) -> None:
        self.overrides = (*(f"{key}={_word(value)}" for key, value in choices.items()), *overrides)
        self.config: DictConfig = load("config", self.overrides)
        self.result: Result | None = None
        self.folder: Path | None = None

    def run(self, folder: str | Path | None = None) -> Result:
        """Run in ``folder``, by default ``runs/<task>/<time>``; what is there afterwards is what the command leaves.

        Raises:
            UserError: a part or setting that can't be had, or a folder that holds a run already or can't be written.
        """
        now = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")  # the clock on the wall, as the command's
        self.folder = Path(folder) if folder is not None else Path("runs") / self.config.task.name / now
        with writing(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        self.result = run(self.config, self.folder)
        return self.result


def _word(value: object) -> str:
    """As the command line has it."""
    if value is None:
        return "null"
    if isinstance(value, list | tuple):
        return f"[{','.join(map(_word, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    text = str(value)
    return text if re.fullmatch(r"[\w./+-]+", text) else "'" + text.replace("'", "\\'") + "'"
