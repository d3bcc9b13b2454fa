"""Several tasks for one tool: ``task=multitask task.of=[NAME,...]``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np

from core.config.compose import load, read_parts
from core.design import Fixture
from core.errors import UsageError
from core.geometry import Array
from core.hooks import PartsOf
from core.interfaces import Robot, Task
from core.plugins import TASK
from core.scene import Region, Scene, State
from plugins.multitask.multitask_search import MultitaskSearch


class Multitask(Task):
    """Tasks that one tool must do, each with a plan of its own; the tool's fixture stands in the scene of each.

    Args:
        of: the tasks: names, or mappings of a ``name`` and settings that differ from the configuration's.
        combine: what counts of their rewards: the ``mean``, or the ``worst``.

    Raises:
        UserError: a task can't be used, or is named twice; or no tool kind suits all, or no place for a fixture that
            goals name.
    """

    goals = ()
    builder = MultitaskSearch

    def __init__(
        self,
        of: Annotated[list[str | dict[str, Any]], PartsOf("task")],
        combine: Literal["mean", "worst"] = "mean",
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
            "description": " ".join(texts),
            "in_words": " ".join(in_words),
            "fixture": _find_common_region(self._parts),
        }

        vars(self).update(hidden)
        self._check_fixture()

    def _check_fixture(self) -> None:
        """Refuse tasks of which one needs a fixture, and that have no place for it in common.

        Raises:
            UsageError: names the one that needs it.
        """
        if self.fixture is not None:
            return

        for task in self._parts:
            if any(task.find_goal_faults(None)):
                raise UsageError(
                    f"the goals of {task.name} name the fixture, and these tasks have no place for it in common; give "
                    "each of them the same one, such as fixture: {box: [0.3, 0.3, 0.3], position: [0.6, 0, 0.15]}"
                )

    def find_goal_faults(self, fixture: Fixture | None) -> Iterator[str]:
        """See `core.interfaces.Task.find_goal_faults`: those of each task."""
        for task in self._parts:
            for fault in task.find_goal_faults(fixture):
                yield f"in {task.name}, {fault}"

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


def _find_common_region(tasks: Sequence[Task]) -> Region | None:
    """Return where a fixture may stand in the scenes of all tasks; None: there is no such place."""
    regions = [task.fixture for task in tasks if task.fixture is not None]
    if len(regions) < len(tasks):
        return None

    lows = [np.array(region.low) for region in regions]
    highs = [np.array(region.high) for region in regions]
    low = np.max(lows, axis=0)
    high = np.min(highs, axis=0)
    if (low >= high).any():
        return None

    return Region(low, high)


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
