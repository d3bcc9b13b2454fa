"""Several tasks for one tool: ``task=several task.of=[NAME,...]``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from core.config.compose import load, read_parts
from core.errors import UsageError
from core.geometry import Array
from core.interfaces import Robot, Task
from core.plugins import TASK
from core.scene import Scene, State
from plugins.several.search import SeveralSearch


class Several(Task):
    """Tasks that one tool must do, each with a plan of its own.

    Args:
        of: the tasks: names, or mappings of a ``name`` and settings that differ from the configuration's.
        combine: what counts of their rewards: the ``mean``, or the ``worst``.

    Raises:
        UserError: a task can't be used, or is named twice; or no tool kind suits all.
    """

    goals = ()
    builder = SeveralSearch

    def __init__(
        self, of: list[str | dict[str, Any]], combine: Literal["mean", "worst"] = "mean"
    ) -> None:
        super().__init__()
        self.sources = list(read_parts(TASK, of).values())

        self._parts: tuple[Task, ...] = tuple(
            source.create() for source in self.sources
        )
        names = [task.name for task in self._parts]

        if len(names) < 2 or len(set(names)) < len(names):
            raise UsageError(
                f"task.of needs two or more different tasks, got {', '.join(names)}"
            )

        self.tool_kinds = _find_common_kinds(of)
        texts = [f"{task.name}: {task.description}" for task in self._parts]
        in_words = [f"{task.name}: {task.in_words}" for task in self._parts]
        hidden: dict[str, Any] = {  # these hide the attributes of the class
            "name": "+".join(names),
            "combine": combine,
            "home": self._parts[0].home,
            "success_reward": min(task.success_reward for task in self._parts),
            "description": " ".join(texts),
            "in_words": " ".join(in_words),
        }

        vars(self).update(hidden)

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


def _find_common_kinds(entries: Sequence[str | Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the tool kinds that all tasks take.

    Args:
        entries: the tasks as the configuration has them: names, or mappings of a ``name`` and settings.

    Returns:
        In the order of the first task.

    Raises:
        UsageError: there is none.
    """
    kinds: dict[str, list[str]] = {}
    for entry in entries:
        settings = {"name": entry} if isinstance(entry, str) else entry
        name = str(settings["name"])
        usual = load("config", [f"task={name}"]).task.get("tool_kinds")
        kinds[name] = list(settings.get("tool_kinds") or usual or ("rigid",))

    first, *others = kinds.values()
    shared = set(first).intersection(*others)
    common = tuple(kind for kind in first if kind in shared)

    if not common:
        takes = [f"{name} takes {' or '.join(taken)}" for name, taken in kinds.items()]
        raise UsageError(
            f"these tasks have no tool kind in common: {', '.join(takes)}; "
            "set tool_kinds of one, or leave one out"
        )

    return common
