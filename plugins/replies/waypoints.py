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
from plugins.replies.figures import read_figure
from plugins.replies.mending import ELLIPSIS

_POSE = WAYPOINT[:6]
_LISTS = {
    "position": WAYPOINT[:3],
    "pos": WAYPOINT[:3],
    "xyz": WAYPOINT[:3],
    "translation": WAYPOINT[:3],
    "orientation": WAYPOINT[3:6],
    "rotation": WAYPOINT[3:6],
    "rpy": WAYPOINT[3:6],
    "euler": WAYPOINT[3:6],
    "eulerangles": WAYPOINT[3:6],
    "pose": _POSE,
    "waypoint": _POSE,
}
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
    if isinstance(waypoint, dict):
        return _read_object(waypoint, where)
    if isinstance(waypoint, str):
        words = _BETWEEN.split(waypoint.strip().strip("[]()").strip())
        numbers = [_as_number(word) for word in words]
        return waypoint if any(isinstance(n, str) for n in numbers) else numbers
    if isinstance(waypoint, list):
        return [*map(_as_number, waypoint[:6]), *map(_as_grip, waypoint[6:])]
    return waypoint


def _read_object(waypoint: dict[Any, Any], where: str) -> list[Any]:
    """Read a waypoint of named numbers; texts that only describe it are left out.

    Raises:
        DesignError: a number is missing, unknown, or part of a quaternion.
    """
    numbers = _name_numbers(waypoint, where)
    if not set(_POSE) <= set(numbers):
        missing = ", ".join(name for name in _POSE if name not in numbers)
        raise DesignError(f"{where} has no {missing}; {_WANTED}")
    return [numbers[name] for name in WAYPOINT if name in numbers]


def _name_numbers(waypoint: dict[Any, Any], where: str) -> dict[str, Any]:
    """Return the numbers of a waypoint by their names in `WAYPOINT`, angles in radians.

    Raises:
        DesignError: a name is unknown, or a list has another length.
    """
    found: dict[str, Any] = {}
    for key, value in waypoint.items():
        name, *degrees = _DEGREES.split(plain_name(key))
        names = _LISTS.get(name, ())

        if isinstance(value, dict) and names:
            inner = _name_numbers(value, where)
        elif isinstance(value, list) and len(value) == len(names):
            inner = dict(zip(names, map(_as_number, value), strict=True))
        elif name in WAYPOINT:
            inner = {
                name: _as_grip(value) if name == WAYPOINT[6] else _as_number(value)
            }
        elif isinstance(value, str):
            continue
        else:
            raise DesignError(f"{where}: {shorten(str(key))} can't be read; {_WANTED}")

        if degrees:
            assume(f"{str(key)[:60]!r} is read in degrees")
            inner = {name: _to_radians(value) for name, value in inner.items()}
        found |= inner

    return found


def _to_radians(value: Any) -> Any:
    """Turn an angle in degrees into radians."""
    return math.radians(value) if isinstance(value, int | float) else value


def _as_number(value: object) -> object:
    """Return the number that a text means; anything else as it is."""
    if not isinstance(value, str):
        return value
    number = read_figure(value)
    return value if number is None else number


def _as_grip(value: object) -> object:
    """Return the gripper's number that a word or a truth value means; anything else as it is."""
    word = str(value).strip().lower()
    return _GRIPS[word] if word in _GRIPS else _as_number(value)


def _without_gripper(rows: list[object]) -> list[object]:
    """Leave out a seventh number that is 0 in all waypoints of a tool without the gripper.

    Raises:
        DesignError: the last four numbers may be a quaternion.
    """
    sevens = [row for row in rows if isinstance(row, list) and len(row) == 7]
    if len(sevens) != len(rows) or any(row[6] != 0 for row in sevens):
        return rows

    lengths = [math.hypot(*map(_number_or_nan, row[3:])) for row in sevens]
    if all(abs(length - 1.0) < _QUATERNION for length in lengths):
        raise DesignError(
            f"waypoint 1 has 7 numbers, which may end in a quaternion; {_WANTED}"
        )
    assume("a gripper's number of 0 is left out for a tool without the gripper")
    return [row[:6] for row in sevens]


def _number_or_nan(value: object) -> float:
    return value if isinstance(value, int | float) else math.nan
