"""Plans for several tasks, and how they are written: ``action=multitask``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from core.design import DesignError
from core.designs.planning import named_actions, parse_plan
from core.interfaces import ActionPlan, ActionRepresentation, Brief, Seen, Waypoints
from core.plugins import ACTION, installed
from core.support.text import clean, kind

MAX_NAME = 200  # characters of a task's name,
MAX_PROBLEM = 2000  # and of what is wrong with its plan


@dataclass(frozen=True)
class TaskPlans(ActionPlan):
    """A plan for each of several tasks by its name, or the reason why there is none."""

    action: ClassVar[str] = "multitask"
    plans: tuple[tuple[str, ActionPlan | str], ...] = ()

    def of(self, task: str) -> ActionPlan | str:
        return dict(self.plans).get(task, "the design has no plan for this task")

    def resolve(self, seen: Seen) -> Waypoints:
        raise TypeError("plans for several tasks are resolved one by one")

    def dump(self) -> list[Any]:
        return [
            {"task": task, "problem": plan}
            if isinstance(plan, str)
            else {"task": task, "action": plan.action, "plan": plan.dump()}
            for task, plan in self.plans
        ]


class TaskActions(ActionRepresentation):
    """Plans for several tasks: a list with an object for each, of its ``task``, ``action`` and ``plan``.

    One that can't be read has a ``problem`` in place of its plan.
    """

    def instructions(self, brief: Brief) -> str:
        literal = installed().create(ACTION, Waypoints.action)
        return (
            "- A list with an object for each task: its name as `task`, and its `plan`.\n"
            + literal.instructions(brief).strip()
        )

    def schema(self, *, gripper: bool) -> dict[str, Any]:
        literal = installed().create(ACTION, Waypoints.action)
        fields = {"task": {"type": "string"}, "plan": literal.schema(gripper=gripper)}
        item = {"type": "object", "properties": fields, "required": list(fields)}

        return {"type": "array", "items": item, "minItems": 1}

    def parse(self, data: object, *, gripper: bool) -> TaskPlans:
        plans: list[tuple[str, ActionPlan | str]] = []
        items = data if isinstance(data, list) else [data]

        for number, item in enumerate(items, start=1):
            if not isinstance(item, dict):
                raise DesignError(
                    "plans for several tasks must be a list of objects with 'task', 'action' and 'plan'"
                )

            task = item.get("task")
            if not isinstance(task, str):
                raise DesignError(
                    f"'task' of plan {number} is {kind(task)}; it must be the name of a task"
                )

            plan = _read_plan(item, gripper=gripper)
            plans.append((clean(task, MAX_NAME), plan))

        return TaskPlans(tuple(plans))


def _read_plan(item: Mapping[Any, Any], *, gripper: bool) -> ActionPlan | str:
    """Read the plan for one task; a text: there is none, and why.

    Args:
        item: with an ``action`` and a ``plan``, or with a ``problem``.
        gripper: whether waypoints have a value for the gripper.
    """
    problem = item.get("problem")
    if problem is None:
        try:
            return parse_plan(named_actions(dict(item)), item.get("plan"), gripper)
        except DesignError as error:
            problem = error

    return clean(str(problem), MAX_PROBLEM)
