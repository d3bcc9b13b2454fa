"""Several tasks for one tool: ``task=several task.of=[NAME,...]``."""

from __future__ import annotations

from typing import Any, Literal

from core.config.compose import listed, load, part
from core.errors import UsageError
from core.geometry import Array
from core.hooks import Factories, hookimpl
from core.interfaces import Robot, Task
from core.plugins import TASK
from core.scene import Scene, State


@hookimpl
def tasks() -> Factories:
    return {"several": Several}


class Several(Task):
    """Tasks that one tool must do, each with a plan of its own.

    Args:
        of: the tasks: names, or mappings of a ``name`` and settings that differ from the configuration's.
        combine: what counts of their rewards: the ``mean``, or the ``worst``.

    Raises:
        UserError: a task can't be used, or is named twice; or no tool kind suits all.
    """

    goals = ()

    def __init__(
        self, of: list[str | dict[str, Any]], combine: Literal["mean", "worst"] = "mean"
    ) -> None:
        super().__init__()
        self._parts = tuple(
            part(TASK, node).create() for node in listed("task", "task", of).values()
        )
        names = [task.name for task in self._parts]
        if len(names) < 2 or len(set(names)) < len(names):
            raise UsageError(
                f"task.of needs two or more different tasks, got {', '.join(names)}"
            )
        kinds = dict[str, list[str]]()
        for settings in (
            {"name": entry} if isinstance(entry, str) else entry for entry in of
        ):
            usual = load("config", [f"task={settings['name']}"]).task.get("tool_kinds")
            kinds[str(settings["name"])] = list(
                settings.get("tool_kinds") or usual or ("rigid",)
            )
        self.tool_kinds = tuple(
            k
            for k in next(iter(kinds.values()))
            if all(k in own for own in kinds.values())
        )
        if not self.tool_kinds:
            takes = ", ".join(
                f"{name} takes {' or '.join(own)}" for name, own in kinds.items()
            )
            mend = "set tool_kinds of one, or leave one out"
            raise UsageError(
                f"these tasks have no tool kind in common: {takes}; {mend}"
            )
        own: dict[str, Any] = {
            "name": "+".join(names),
            "combine": combine,
            "home": self._parts[0].home,
        }
        own["success_reward"] = min(task.success_reward for task in self._parts)
        own["description"] = " ".join(
            f"{task.name}: {task.description}" for task in self._parts
        )
        own["in_words"] = " ".join(
            f"{task.name}: {task.in_words}" for task in self._parts
        )
        vars(self).update(own)  # these hide the attributes of the class

    @property
    def parts(self) -> tuple[Task, ...]:
        return self._parts

    @property
    def robot(self) -> Robot:
        """The arm of all of them."""
        return self._parts[0].robot

    @robot.setter
    def robot(self, robot: Robot) -> None:
        for task in self._parts:
            task.robot = robot

    def scene(self, seed: int) -> Scene:
        raise UsageError(
            f"{self.name} has several scenes: choose one of its tasks, as in task={self._parts[0].name}"
        )

    def reward(self, start: State, end: State) -> Array:
        raise UsageError(f"{self.name} has several rewards: choose one of its tasks")
