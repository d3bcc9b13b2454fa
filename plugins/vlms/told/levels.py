"""Say more or less of a task's scene: the levels of ``prompt.told``."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from core.interfaces import Image, Picture, Task
from core.scene import Body
from core.task import NOTHING_TOLD, Level
from core.values.observations import Sight
from plugins.vlms.told.bodies import bodies_table
from plugins.vlms.told.sight import Hidden
from plugins.vlms.told.source import (
    BODY,
    class_source,
    helpers,
    layout_table,
    task_source,
)
from plugins.vlms.told.views import calibrated_pictures


class Told(Level):
    """Says of a task with several parts the same of each."""

    def values(self, task: Task, seed: int) -> dict[str, Any]:
        several = [part for part in task.parts if part is not task]
        if not several:
            return self.of_one(task, seed)
        return {
            "several": [
                {"task": part, **NOTHING_TOLD, **self.of_one(part, seed)}
                for part in several
            ]
        }

    @abstractmethod
    def of_one(self, task: Task, seed: int) -> dict[str, Any]:
        """Return the values of a task without parts."""


class Source(Told):
    """The task's source and a table of all bodies: the paper's way."""

    in_words = False

    def of_one(self, task: Task, seed: int) -> dict[str, Any]:
        return {
            "description": task.description,
            "layout": layout_table(task, seed),
            "task_source": task_source(task).rstrip("\n"),
            "goals": task.reward_in_words(),
            "vocabulary": class_source(Body, *BODY),
            "helpers": helpers(task),
        }


class Words(Told):
    """A description, and a table of places and sizes; masses and friction in words."""

    def of_one(self, task: Task, seed: int) -> dict[str, Any]:
        return {
            "description": task.in_words,
            "layout": layout_table(task, seed, worded=True),
        }


class Pictures(Told):
    """The description, the bodies' names and conventions, and calibrated pictures; no number of a body."""

    numbers = False

    def of_one(self, task: Task, seed: int) -> dict[str, Any]:
        return {"description": task.in_words, "layout": bodies_table(task, seed)}

    def sight(self, task: Task, seed: int) -> Sight:
        return Hidden.of(task, seed)

    def draw(
        self, task: Task, seed: int, render: Callable[..., Image]
    ) -> tuple[Picture, ...]:
        return calibrated_pictures(task, seed, render)
