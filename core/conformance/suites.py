"""The checks of each kind, and how they are run."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from core.conformance import evolution, executor, simulator, task, tool, vlm
from core.plugins import Part

SUITES: dict[str, tuple[Callable[[Any], None], ...]] = {
    "sim": simulator.CHECKS,
    "task": task.CHECKS,
    "vlm": vlm.CHECKS,
    "tool": tool.CHECKS,
    "evolution": evolution.CHECKS,
    "executor": executor.CHECKS,
}
"""By kind. Their argument is what `subject` gives."""


@dataclass(frozen=True)
class Verdict:
    """Of one check: how long it took, and what is wrong; None: nothing."""

    check: str
    seconds: float
    problem: str | None


def subject(part: Part) -> Any:
    """What the checks of its kind take: the part, or what makes it."""
    if part.kind == "evolution":
        return lambda designer, budget: part.create(designer=designer, budget=budget)
    return part.create if part.kind == "executor" else part.create()


def verdicts(part: Part) -> Iterator[Verdict]:
    """Of each check of its kind, as they end.

    Raises:
        UserError: the part can't be made.
    """
    checked = subject(part)
    for check in SUITES[part.kind]:
        begun, problem = time.perf_counter(), None
        try:
            check(checked)
        except Exception as error:  # whatever a stranger's code raises is its result
            problem = str(error) if isinstance(error, AssertionError) else _told(error)
        name = check.__name__.removeprefix("check_").replace("_", " ")
        yield Verdict(name, time.perf_counter() - begun, problem)


def _told(error: Exception) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({last.filename}, line {last.lineno})"
