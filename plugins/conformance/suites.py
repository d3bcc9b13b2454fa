"""List the checks of each kind of part, and run them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from types import ModuleType
from typing import Any

from core.errors import RAISED, UserError
from core.plugins import KINDS, PluginPart
from plugins.conformance import (
    action,
    bonds,
    commands,
    evolution,
    executor,
    fitness,
    free_bodies,
    impacts,
    joints,
    listener,
    output,
    playing,
    robot,
    robots,
    softs,
    task,
    tool,
    vlm,
)
from plugins.conformance.shared import LeftOut, describe_error

Check = Callable[[Any], str | None]
"""Raises an AssertionError that says what is wrong; may return a remark."""


def _checks(*modules: ModuleType) -> tuple[Check, ...]:
    """The checks that the modules define, in order."""
    checks: list[Check] = []
    for module in modules:
        for name, value in vars(module).items():
            if name.startswith("check_") and value.__module__ == module.__name__:
                checks.append(value)
    return tuple(checks)


SUITES = {
    "sim": _checks(output, playing, robot, free_bodies, joints, bonds, impacts, softs),
    "task": _checks(task),
    "robot": _checks(robots),
    "vlm": _checks(vlm),
    "tool": _checks(tool),
    "action": _checks(action),
    "evolution": _checks(evolution),
    "fitness": _checks(fitness),
    "executor": _checks(executor),
    "listener": _checks(listener),
    "command": _checks(commands),
}
"""The checks of each kind. They take what `subject` returns. With pytest::

    @pytest.mark.parametrize("check", SUITES["sim"], ids=lambda check: check.__name__)
    def test_conforms(check):
        check(subject(PluginPart("sim", "mine")))
"""


MADE_BY_CHECKS = ("evolution", "fitness", "executor", "listener")


@dataclass(frozen=True)
class Verdict:
    """The result of one check: its duration, the problem (None: it passed), and a remark."""

    check: str
    seconds: float
    problem: str | None
    remark: str | None = None


def subject(part: PluginPart) -> Any:
    """The argument of the checks of the part's kind: the part itself, or a function that makes one.

    Raises:
        UserError: the part can't be made.
    """
    if part.kind == "command":
        return part
    return partial(_make, part) if part.kind in MADE_BY_CHECKS else part.create()


def _make(part: PluginPart, *given: object) -> Any:
    """Make a part, with what the program provides for its kind."""
    return part.create(**dict(zip(KINDS[part.kind].provided, given, strict=True)))


def examine(kind: str, checked: Any) -> Iterator[Verdict]:
    """Yield the verdict of each check of a kind on an object, as `subject` makes it, when the check ends.

    Raises:
        UserError: Python leaves assertions out.
    """
    if not __debug__:
        raise UserError("checks are assertions, which python -O leaves out")

    for check in SUITES[kind]:
        began = time.perf_counter()
        problem = None
        remark = None
        try:
            remark = check(checked)
        except LeftOut as reason:
            remark = f"left out: {reason}"
        except RAISED as error:  # anything that the part's code raises is a result
            failed = isinstance(error, AssertionError)
            problem = str(error) if failed else describe_error(error)

        name = check.__name__.removeprefix("check_").replace("_", " ")
        yield Verdict(name, time.perf_counter() - began, problem, remark)
