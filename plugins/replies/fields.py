"""Read the fields of a design however they are spelled, where that has one meaning; else say which is near."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping
from typing import Any

from core.design import DesignError
from core.designs.replies import Fields
from plugins.replies.assumptions import assume
from plugins.replies.envelopes import PLANS, plain_name, says_degrees
from plugins.replies.mending import ELLIPSIS
from plugins.replies.saving import BLOCK
from plugins.replies.schema_fitting import ANSWERS, fit
from plugins.replies.written_numbers import figures_in

ACTION_SETS = "action_sets"

_USUAL = (
    "strategy_name",
    "strategy_description",
    "tool_name",
    "tool_description",
    "action_description",
    "action",
    "gripper",
    "fixture",
    "parents",
)
_LIST = {"type": "array"}
_PLAN = PLANS | {
    *("plan", "action", "waypoints", "trajectory", "poses", "steps", "path", "motion")
}
_PARTS = {"boxes", "parts", "shapes", "links", "bodies", "elements", "pieces"}
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+")
_EMPTY = {"string", "text", "xml", "code", "block", "content", "design"}
_NUMBERED = re.compile(r"\D*(\d+)")
_HOLDER = re.compile("tool|action|strategy|design")


def read_fields(design: Fields, wanted: Mapping[str, Any]) -> Fields:
    """Return the fields of a design by their proper names.

    A name may be spelled otherwise (``toolUrdf``), be a part of the proper one (``urdf``), or stand in an object. A
    text may be a list of lines, and a list may be JSON in a text. Other fields stay as they are.

    Args:
        design: what was written.
        wanted: the JSON schemas of the fields that a tool needs, by name.

    Raises:
        DesignError: a field is given twice, or is missing and another one has nearly its name; or angles are said to be
            in degrees.
    """
    needed = [*wanted, ACTION_SETS]
    names = {plain_name(name): name for name in (*_USUAL, *needed)}
    fields: Fields = {}
    others: Fields = {}

    for key, value in _flatten(design, names, needed):
        name = names.get(plain_name(key))
        if says_degrees(key, value):
            raise DesignError(
                f"{str(key)[:60]!r} says degrees; write all angles in radians, without it"
            )
        if name is None or (name == "action" and isinstance(value, list)):
            others[key] = value
        elif name in fields and fields[name] != value:
            raise DesignError(
                f"{name!r} is given twice, also as {key!r}; give it once, with that name"
            )
        else:
            _take(fields, name, key, value)

    for name in needed:
        is_list = wanted.get(name, {}).get("type") == "array"
        key = None if name in fields else _find_other(name, others, is_list)
        if key is not None:
            _take(fields, name, key, others.pop(key))

    for name, schema in wanted.items():
        is_text = schema.get("type") == "string"
        if is_text and BLOCK in others and "<" not in str(fields.get(name)):
            fields[name] = others[BLOCK]
        if name in fields:
            fields[name] = fit(fields[name], schema, name)

    if "gripper" in fields:
        gripper = fields["gripper"]
        fields["gripper"] = ANSWERS.get(str(gripper).strip().lower(), gripper)

    return {**others, **fields}


def list_plans(value: object, schema: Mapping[str, Any]) -> object:
    """Return ``action_sets`` as a list of plans, where it is one plan, or plans stand in objects; else as it is.

    Args:
        value: what was written.
        schema: the JSON schema of one plan.
    """
    value = _unwrap(fit(value, _LIST))
    if not isinstance(value, list):
        return value

    plans = [_unwrap(fit(plan, _LIST)) for plan in value if plan != ELLIPSIS]
    is_of_waypoints = schema.get("items", {}).get("type") in ("array", "object")
    if not (plans and is_of_waypoints):
        return plans
    if all(map(_is_waypoint, plans)):
        assume("'action_sets' that is one plan is read as a list of it")
        return [plans]

    return plans


def _take(fields: Fields, name: str, key: object, value: object) -> None:
    """Take a value as the field ``name``, whatever its key."""
    fields[name] = value
    if key != name:
        assume(f"{str(key)[:60]!r} is read as {name!r}")


def _flatten(
    design: Fields, names: Mapping[str, str], needed: list[str]
) -> Iterator[tuple[Any, Any]]:
    """Yield keys and values; those in an object by their own name, or with the object's before it.

    An object counts that is named as a tool or the like, or that has what a tool needs and nothing else has.
    """
    lacking = {*needed} - {names.get(plain_name(key)) for key in design}
    for key, value in design.items():
        is_field = names.get(plain_name(key)) in (*needed, "gripper", "fixture")
        if not isinstance(value, dict) or is_field:
            yield key, value
            continue

        fields: Fields = {}
        for inner, held in value.items():
            joined = f"{key}_{inner}"
            fields[joined if plain_name(joined) in names else inner] = held

        found = {names.get(plain_name(inner)) for inner in fields}
        if found & lacking or _HOLDER.search(plain_name(key)):
            yield from fields.items()
        else:
            yield key, value


def _find_other(name: str, others: Fields, is_list: bool) -> Any:
    """Return the key of another field that can only mean ``name``; None: there is none.

    Args:
        name: of the field.
        others: those that mean nothing else.
        is_list: the field is a list of a tool's components.

    Raises:
        DesignError: a name is near, and may mean something else.
    """
    same = [key for key in others if _is_part(key, name)]
    if name == ACTION_SETS:
        same = [key for key in others if plain_name(key) in _PLAN]
    elif is_list and not same:
        same = [key for key in others if plain_name(key) in _PARTS]
    if len(same) == 1:
        return same[0]

    keys = {plain_name(key): key for key in others}
    near = difflib.get_close_matches(plain_name(name), keys, n=1, cutoff=0.7)
    if len(same) > 1 or near:
        found = keys[near[0]] if near else same[0]
        raise DesignError(
            f"{name!r} is missing; did you mean it by {str(found)[:60]!r}? Write {name!r}"
        )

    return None


def _is_part(key: object, name: str) -> bool:
    """Report whether a key has some of a name's words, and no others that say anything: ``urdf`` of ``tool_urdf``."""
    words = {word.lower().rstrip("s") for word in _WORD.findall(str(key))} - _EMPTY
    return bool(words) and words <= {word.rstrip("s") for word in name.split("_")}


def _unwrap(plan: object) -> object:
    """Return the list in an object that is a plan, beside what only describes it, or that numbers or names some."""
    if not isinstance(plan, dict):
        return plan

    numbers = [_NUMBERED.fullmatch(str(key)) for key in plan]
    order = [int(number[1]) for number in numbers if number]
    if plan and len(order) == len(plan) and order == sorted({*order}):
        return list(plan.values())

    lists = [
        inner
        for key, inner in plan.items()
        if plain_name(key) in _PLAN and isinstance(inner, list)
    ]
    if len(lists) == 1 and _holds_more(lists[0]):
        return lists[0]

    is_by_name = bool(plan) and all(map(_holds_more, plan.values()))
    if is_by_name and not order:
        assume("plans under their names are read in their order")
        return list(plan.values())

    return plan


def _is_waypoint(value: object) -> bool:
    """Report whether a value can only be one waypoint: at least three single values, an object of them, or a text."""
    if isinstance(value, str):
        return len(figures_in(value)) >= 3
    if isinstance(value, dict):
        return bool(value) and not any(map(_holds_more, value.values()))

    return isinstance(value, list) and len(value) >= 3 and not _holds_more(value)


def _holds_more(value: object) -> bool:
    """Report whether a list holds lists, objects, or texts of several numbers."""
    if not isinstance(value, list):
        return False

    return any(
        isinstance(item, list | dict)
        or (isinstance(item, str) and len(figures_in(item)) >= 3)
        for item in value
    )
