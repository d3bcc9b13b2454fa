"""Checks that every action representation must pass. Each takes one and raises an AssertionError."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from core.design import DesignError
from core.designs.plan_rules import check_plan
from core.designs.planning import look
from core.interfaces import ActionPlan, ActionRepresentation, Perception, Waypoints
from plugins.conformance.sample_tools import LengthOnly
from plugins.conformance.shared import (
    WILD,
    as_json,
    brief,
    expect_a,
    expect_reason,
    read_or_refused,
    some_task,
)

_DRAWS = 200


def check_the_schema_is_of_json(representation: ActionRepresentation) -> None:
    for gripper in (False, True):
        schema = representation.schema(gripper=gripper)
        expect_a(dict, schema, "schema returned")
        assert schema, "the schema is empty"
        as_json(schema, "the schema")


def check_there_are_instructions(representation: ActionRepresentation) -> None:
    for gripper in (False, True):
        asked = brief(some_task(), LengthOnly(), gripper=gripper)
        text = representation.instructions(asked).strip()
        assert text, "the instructions are empty, so a model can't write a plan"


def check_plans_that_fit_the_schema_are_read(
    representation: ActionRepresentation,
) -> None:
    """Of documents of the schema's form some are read; those keep their meaning through dump, parse and pickle."""
    seen = look(some_task(), 0, Perception())
    sound = 0

    for gripper in (False, True):
        for data in _drawn(representation.schema(gripper=gripper)):
            try:
                plan = representation.parse(data, gripper=gripper)
                played = _plan_for(plan, some_task().name)
                waypoints = played.resolve(seen)
            except DesignError as error:
                expect_reason(error, data)
                continue

            sound += 1
            expect_a(ActionPlan, plan, "parse returned")
            expect_a(Waypoints, waypoints, "resolve returned")
            check_plan(waypoints.poses, gripper=gripper)
            dumped = plan.dump()
            as_json(dumped, "what dump returned")
            again = representation.parse(dumped, gripper=gripper)
            assert again.content == plan.content, (
                "a plan that is written and read again is another plan"
            )
            same = pickle.loads(pickle.dumps(played)).resolve(seen)  # noqa: S301  # our own
            assert np.array_equal(same.poses, waypoints.poses), (
                "a plan that was pickled means other waypoints"
            )

    assert sound, f"of {2 * _DRAWS} plans of the schema's form none was read"


def _plan_for(plan: ActionPlan, task: str) -> ActionPlan:
    """Return what is played of a plan in a task.

    Raises:
        DesignError: the plan has nothing for this task.
    """
    played = plan.of(task)
    if isinstance(played, str):
        raise DesignError(played)

    return played


def check_nonsense_is_refused_with_a_reason(
    representation: ActionRepresentation,
) -> None:
    deep: object = 0
    for _ in range(500):
        deep = [deep]

    anchored = ({"anchor": item, "offset": item} for item in WILD)
    documents = (*WILD, *([item] for item in (*WILD, *anchored)), deep)
    read_or_refused(representation.parse, ActionPlan, documents)


def _drawn(schema: dict[str, Any]) -> Iterator[object]:
    """Draw documents of a schema's form: numbers are small, texts are names of the task and its bodies."""
    rng = np.random.default_rng(0)
    task = some_task()
    names = [task.name, *(body.name for body in task.scene(0).bodies)]
    for _ in range(_DRAWS):
        yield _draw(schema, rng, names)


def _draw(schema: dict[str, Any], rng: np.random.Generator, names: list[str]) -> object:
    if "enum" in schema:
        return _pick(schema["enum"], rng)
    if "anyOf" in schema:
        return _draw(_pick(schema["anyOf"], rng), rng, names)

    match schema.get("type"):
        case "array":
            least = int(schema.get("minItems", 0))
            most = min(schema.get("maxItems", least + 3), least + 3)
            count = rng.integers(least, most + 1)
            return [_draw(schema["items"], rng, names) for _ in range(count)]
        case "object":
            document = {}
            for key, inner in schema["properties"].items():
                if key in schema.get("required", ()) or rng.random() < 0.3:
                    document[key] = _draw(inner, rng, names)
            return document
        case "number" | "integer":
            low = schema.get("minimum", -0.6)
            high = schema.get("maximum", 0.6)
            return round(float(rng.uniform(low, high)), 4)
        case "boolean":
            return bool(rng.random() < 0.5)
        case _:
            return _pick(names, rng)


def _pick(values: Sequence[Any], rng: np.random.Generator) -> Any:
    return values[int(rng.integers(len(values)))]
