"""Read a waypoint that a model wrote as an object, as a text, or with a number too many, where that has one meaning."""

from __future__ import annotations

import math
import re
from typing import Any

from core.design import DesignError
from core.designs.plan_rules import WAYPOINT
from core.support.text import shorten
from plugins.replies.assumptions import assume
from plugins.replies.mending import ELLIPSIS
from plugins.replies.schema_fitting import fit, read_number
from plugins.replies.written_numbers import ANGLES, LENGTHS

_POSE = WAYPOINT[:6]
_VECTOR = {
    "type": "array",
    "items": {"type": "number"},
    "minItems": 3,
    "maxItems": 3,
}
_FIELDS = {"xyz": _VECTOR, "rpy": _VECTOR, "grip": {}}
_SCHEMA = {"type": "object", "properties": _FIELDS}  # of a waypoint as an object
_NAMES = {"xyz": ", ".join(_POSE[:3]), "rpy": ", ".join(_POSE[3:])}
_WANTED = f"write a list of {', '.join(_POSE)}, angles in radians"
_GRIPS = {"open": 0.0, "closed": 1.0, "close": 1.0, "false": 0.0, "true": 1.0}
_BETWEEN = re.compile(r"[\s,;]+")
_QUATERNION = 1e-3  # how far its length is from 1, at most


def read_waypoints(plan: object, *, gripper: bool) -> object:
    """Return a plan as lists of numbers, as far as it can be read so; the rest stays for the rules to refuse.

    Args:
        plan: what a model wrote.
        gripper: whether waypoints have the gripper's number.

    Raises:
        DesignError: a waypoint has two meanings, or is left out.
    """
    if not isinstance(plan, list):
        return plan

    rows = [
        _read_waypoint(waypoint, f"waypoint {number}")
        for number, waypoint in enumerate(plan, start=1)
    ]
    return rows if gripper else _without_gripper(rows)


def _read_waypoint(waypoint: object, where: str) -> object:
    """Read one waypoint; anything that is none stays as it is."""
    if waypoint == ELLIPSIS:
        raise DesignError(f"{where} is '...'; write out every waypoint")
    if isinstance(waypoint, str):
        words = _BETWEEN.split(waypoint.strip(" \t\n[](),;"))
        numbers = _read_row(words)
        return waypoint if any(isinstance(n, str) for n in numbers) else numbers
    if isinstance(waypoint, dict):
        return _read_object(waypoint, where)

    return _read_row(waypoint) if isinstance(waypoint, list) else waypoint


def _read_row(values: list[Any]) -> list[Any]:
    """Read the numbers of a waypoint in their order."""
    units = (*[LENGTHS] * 3, *[ANGLES] * 3)
    row = [read_number(value, unit) for value, unit in zip(values, units, strict=False)]
    return row + [_read_grip(value) for value in values[6:]]


def _read_object(waypoint: dict[Any, Any], where: str) -> list[Any]:
    """Read a waypoint of named numbers; texts that only describe it are left out.

    Raises:
        DesignError: a number is missing, unknown, given twice, or part of a quaternion.
    """
    try:
        fields = fit(waypoint, _SCHEMA)
    except DesignError as error:
        raise DesignError(f"{where}: {error}; {_WANTED}") from error

    for key, value in fields.items():
        if key not in _FIELDS and not isinstance(value, str):
            raise DesignError(f"{where}: {shorten(str(key))} can't be read; {_WANTED}")

    row = []
    for name, parts in _NAMES.items():
        if name not in fields:
            raise DesignError(f"{where} has no {parts}; {_WANTED}")

        numbers = fields[name]
        if not isinstance(numbers, list) or len(numbers) != 3:
            raise DesignError(
                f"{where}: its {parts} can't be read from {shorten(str(numbers))}; {_WANTED}"
            )

        row += numbers

    return [*row, _read_grip(fields["grip"])] if "grip" in fields else row


def _read_grip(value: object) -> object:
    """Return the number of the gripper that a word means; anything else as it is."""
    value = _GRIPS.get(str(value).strip().lower(), value)
    return read_number(value, {})


def _without_gripper(rows: list[object]) -> list[object]:
    """Leave out a seventh number that is 0 or null in all waypoints of a tool without the gripper.

    Raises:
        DesignError: the last four numbers may be a quaternion.
    """
    sevens = [row for row in rows if isinstance(row, list) and len(row) == 7]
    if len(sevens) != len(rows) or any(row[6] not in (0, None) for row in sevens):
        return rows

    lengths = [
        math.hypot(*(n for n in row[3:] if isinstance(n, int | float)))
        for row in sevens
    ]
    if all(abs(length - 1.0) < _QUATERNION for length in lengths):
        raise DesignError(
            f"waypoint 1 has 7 numbers, which may end in a quaternion; {_WANTED}"
        )

    assume("a gripper's number of 0 is left out for a tool without the gripper")
    return [row[:6] for row in sevens]
