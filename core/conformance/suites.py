"""List the checks of each kind of part, and run them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from core.conformance import evolution, executor, fitness, listener, simulator, task, tool, vlm
from core.conformance.checking import Check, describe_error
from core.plugins import Part

SUITES: dict[str, tuple[Check, ...]] = {
    "sim": simulator.CHECKS,
    "task": task.CHECKS,
    "vlm": vlm.CHECKS,
    "tool": tool.CHECKS,
    "evolution": evolution.CHECKS,
    "fitness": fitness.CHECKS,
    "executor": executor.CHECKS,
    "listener": listener.CHECKS,
}
"""The checks of each kind. They take what `subject` returns."""


@dataclass(frozen=True)
class Verdict:
    """The result of one check: its duration, the problem (None: it passed), and a remark."""

    check: str
    seconds: float
    problem: str | None
    remark: str | None = None


def subject(part: Part) -> Any:
    """The argument of the checks of the part's kind: the part itself, or a function that makes one."""
    if part.kind == "evolution":
        return lambda designer, budget: part.create(designer=designer, budget=budget)
    if part.kind == "fitness":
        return lambda evaluator: part.create(evaluator=evaluator)
    return part.create if part.kind in ("executor", "listener") else part.create()


def verdicts(part: Part) -> Iterator[Verdict]:
    """Yield the verdict of each check of the part's kind, as they end.

    Raises:
        UserError: the part can't be made.
    """
    return examine(part.kind, subject(part))


def examine(kind: str, checked: Any) -> Iterator[Verdict]:
    """Yield the verdict of each check of a kind on an object, as `subject` makes it."""
    for check in SUITES[kind]:
        began, problem, remark = time.perf_counter(), None, None
        try:
            remark = check(checked)
        except Exception as error:  # anything that the part's code raises is a result
            problem = str(error) if isinstance(error, AssertionError) else describe_error(error)
        name = check.__name__.removeprefix("check_").replace("_", " ")
        yield Verdict(name, time.perf_counter() - began, problem, remark)
