"""Read a waypoint that a model wrote as an object, as a text, or with a number too many, where that has one meaning."""

from __future__ import annotations

import math
import re
from typing import Any

from core.design import DesignError
from core.designs.plan_rules import WAYPOINT
from core.support.text import shorten
from plugins.replies.assumptions import assume
from plugins.replies.envelopes import plain_name
from plugins.replies.figures import ANGLES, LENGTHS, read_figure
from plugins.replies.mending import ELLIPSIS

_POSE = WAYPOINT[:6]
_PLACE = WAYPOINT[:3]
_TURN = WAYPOINT[3:6]
_LISTS = {
    **dict.fromkeys(("position", "pos", "xyz", "translation"), _PLACE),
    **dict.fromkeys(("orientation", "rotation", "rot"), _TURN),
    **dict.fromkeys(("rpy", "euler", "eulerangles"), _TURN),
    **dict.fromkeys(("pose", "waypoint"), _POSE),
}
_COUNTS = ("step", "index", "id", "number", "waypoint")
_DEGREES = re.compile(r"(?:in)?deg(?:rees)?$")
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
        numbers = _name_row(words)
        return waypoint if any(isinstance(n, str) for n in numbers) else numbers
    if isinstance(waypoint, dict):
        return _read_object(waypoint, where)

    return _name_row(waypoint) if isinstance(waypoint, list) else waypoint


def _name_row(values: list[Any]) -> list[Any]:
    """Read the numbers of a waypoint in their order; more than there are names for stay as they are."""
    row = list(map(_read_number, WAYPOINT, values))
    return row + values[len(row) :]


def _read_object(waypoint: dict[Any, Any], where: str) -> list[Any]:
    """Read a waypoint of named numbers; texts that only describe it are left out.

    Raises:
        DesignError: a number is missing, unknown, given twice, or part of a quaternion.
    """
    numbers = _name_numbers(waypoint, where)
    if not set(_POSE) <= set(numbers):
        missing = ", ".join(name for name in _POSE if name not in numbers)
        raise DesignError(f"{where} has no {missing}; {_WANTED}")

    return [numbers[name] for name in WAYPOINT if name in numbers]


def _name_numbers(waypoint: dict[Any, Any], where: str) -> dict[str, Any]:
    """Return the numbers of a waypoint by their names in `WAYPOINT`, angles in radians.

    Raises:
        DesignError: a name is unknown, or stands for a number that is there already, or a list has another length.
    """
    found: dict[str, Any] = {}
    for key, value in waypoint.items():
        name, *degrees = _DEGREES.split(plain_name(key))
        names = _LISTS.get(name, ())

        inner: dict[str, Any] = {}
        if isinstance(value, dict) and names:
            inner = _name_numbers(value, where)
        elif isinstance(value, list) and len(value) == len(names):
            inner = dict(zip(names, map(_read_number, names, value), strict=True))
        elif name in WAYPOINT:
            inner = {name: _read_number(name, value)}
        elif not isinstance(value, str) and name not in _COUNTS:
            raise DesignError(f"{where}: {shorten(str(key))} can't be read; {_WANTED}")

        if degrees:
            inner = {
                name: _read_number(name, f"{angle} deg")
                for name, angle in inner.items()
            }

        again = [name for name in inner if name in found]
        if again:
            raise DesignError(f"{where}: {', '.join(again)} is given twice; {_WANTED}")

        found |= inner

    return found


def _read_number(name: str, value: object) -> object:
    """Return the number of a waypoint that a text means, or for the gripper a word; anything else as it is."""
    if name == WAYPOINT[6]:
        value = _GRIPS.get(str(value).strip().lower(), value)
    if not isinstance(value, str):
        return value

    units = ANGLES if name in _TURN else LENGTHS
    number = read_figure(value, units)
    return value if number is None else number


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
