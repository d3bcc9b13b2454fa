"""Say more or less of a task's scene: the levels of ``prompt.context``."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from core.interfaces import Evaluation, Image, Observation, Picture, Recording, Task
from core.scene import Body, Camera
from core.task import NO_CONTEXT, Level
from core.values.observations import Sight
from plugins.vlms.context.bodies_table import bodies_table
from plugins.vlms.context.calibrated_views import VIEWS, calibrated_pictures
from plugins.vlms.context.excerpts import class_source, helpers, task_source
from plugins.vlms.context.feedback import report
from plugins.vlms.context.layout_table import layout_table
from plugins.vlms.context.sight import Hidden, hide_numbers
from plugins.vlms.context.strip import SIZE, draw_strip


class Told(Level):
    """Says of a task with several parts the same of each."""

    frame_size = SIZE

    def values(self, task: Task, seed: int) -> dict[str, Any]:
        """See `Level.values`."""
        parts = [part for part in task.parts if part is not task]
        if not parts:
            return self.values_of_part(task, seed)

        several = []
        for part in parts:
            values = self.values_of_part(part, seed)
            several.append({"task": part, **NO_CONTEXT, **values})
        return {"several": several}

    def report(self, evaluation: Evaluation, task: Task) -> dict[str, Any]:
        return report(evaluation, task)

    def strip(
        self,
        recording: Recording,
        draw: Callable[..., Image],
        seen: Observation | None,
    ) -> Image:
        return draw_strip(recording, draw, seen)

    @abstractmethod
    def values_of_part(self, task: Task, seed: int) -> dict[str, Any]:
        """Return the values of a task without parts, in the layout of this seed."""


class Source(Told):
    """The task's source and a table of all bodies: the paper's way."""

    in_words = False

    def values_of_part(self, task: Task, seed: int) -> dict[str, Any]:
        return {
            "description": task.description,
            "layout": layout_table(task, seed),
            "task_source": task_source(task).rstrip("\n"),
            "goals": task.reward_in_words(),
            "vocabulary": class_source(Body),
            "helpers": helpers(task),
        }


class Words(Told):
    """A description, and a table of places and sizes; masses and friction in words."""

    def values_of_part(self, task: Task, seed: int) -> dict[str, Any]:
        return {
            "description": task.in_words,
            "layout": layout_table(task, seed, worded=True),
        }


class Pictures(Told):
    """The description, the bodies' names and conventions, and calibrated pictures; no number of a body."""

    numbers = False
    views = VIEWS

    def values_of_part(self, task: Task, seed: int) -> dict[str, Any]:
        return {"description": task.in_words, "layout": bodies_table(task, seed)}

    def sight(self, task: Task, seed: int) -> Sight:
        return Hidden.for_layout(task, seed)

    def strip(
        self,
        recording: Recording,
        draw: Callable[..., Image],
        seen: Observation | None,
    ) -> Image:
        """See `Level.strip`; what is written on it has no number of a body either."""
        if seen is not None:
            seen = replace(seen, what=hide_numbers(seen.what))
        return super().strip(recording, draw, seen)

    def draw(
        self,
        task: Task,
        seed: int,
        render: Callable[..., Image],
        only: str | Camera = "",
        cut: float | None = None,
    ) -> tuple[Picture, ...]:
        return calibrated_pictures(task, seed, render, only, cut)
