"""Provide what the checks of every kind share: small tools, requests, the first task and the first engine."""

from __future__ import annotations

import json
import math
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from core.design import RIGID_MOUNT, Component, DesignError, Tool
from core.errors import RAISED, UserError, in_line
from core.geometry import Box, Pose
from core.hooks import PROJECT
from core.interfaces import (
    Ability,
    Brief,
    Message,
    Request,
    Simulator,
    Task,
    Text,
    ToolRepresentation,
)
from core.plugins import ACTION, TASK, PluginPart, installed
from core.plugins.registry import settings_of
from core.support.text import shorten


class LeftOut(Exception):
    """The part says that it lacks what is checked; the message is its own."""


def expect(condition: object, message: str) -> None:
    """Check a condition, with ``python -O`` too.

    Raises:
        AssertionError: with the message.
    """
    if not condition:
        raise AssertionError(message)


def expect_a(kind: type, value: object, what: str) -> None:
    """Check that a value is of a kind; ``what`` says where it comes from, such as ``parse returned``.

    Raises:
        AssertionError: it is something else.
    """
    found = f"a {type(value).__name__}, not a {kind.__name__}"
    expect(isinstance(value, kind), f"{what} {found}")


def expect_reason(refusal: DesignError, data: object) -> None:
    """Check that what a model may write is refused with a reason.

    Raises:
        AssertionError: there is none.
    """
    what = f"{shorten(repr(data))} was refused without a reason"
    expect(str(refusal).strip(), what)


def near(what: str, found: ArrayLike, due: ArrayLike, within: ArrayLike) -> None:
    """Check that a figure, or an array of figures, is what a formula says.

    Args:
        what: the figure in words, with its unit.
        found: what was measured.
        due: what the formula says.
        within: the largest difference that is allowed.

    Raises:
        AssertionError: it differs by more, or is not a number; has the first three that do.
    """
    found, due, within = np.broadcast_arrays(found, due, within)
    wrong = ~(np.abs(found - due) <= within)
    allowed = f"at most {_digits(within[wrong][:3])} of difference is allowed"
    expect(
        not wrong.any(),
        f"{what}: {_digits(found[wrong][:3])} instead of {_digits(due[wrong][:3])}; {allowed}",
    )


def between(
    what: str, found: SupportsFloat, low: float = -math.inf, high: float = math.inf
) -> None:
    """Check that a figure lies between two bounds.

    Raises:
        AssertionError: it does not, or is not a number.
    """
    expect(
        low <= float(found) <= high,
        f"{what}: {_digits(float(found))}; it must be from {_digits(low)} to {_digits(high)}",
    )


def _digits(figures: ArrayLike) -> str:
    return ", ".join(f"{figure:.4g}" for figure in np.ravel(figures))


def describe_error(error: BaseException) -> str:
    """Describe an exception in one line, with the place in the code that raised it."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{in_line(error)} ({last.filename}, line {last.lineno})"


def rigid() -> Tool:
    """An L of two boxes under the flange."""
    down = Component(
        "down", RIGID_MOUNT, Pose.xyz_rpy((0.0, 0.0, -0.1)), Box((0.02, 0.02, 0.2))
    )
    ahead = Component(
        "ahead",
        "down",
        Pose.xyz_rpy((0.05, 0.0, -0.1), (0.0, 0.0, 0.2)),
        Box((0.1, 0.02, 0.02)),
    )
    return Tool((down, ahead), name="L")


def fingers() -> Tool:
    """A box on each finger."""
    left, right = (
        Component(
            f"tip_{side}",
            f"{side}_finger",
            Pose.xyz_rpy((0.0, y, 0.06)),
            Box((0.01, 0.01, 0.05)),
        )
        for side, y in (("left", 0.008), ("right", -0.008))
    )
    return Tool((left, right), gripper=True, name="tips")


class LengthOnly(ToolRepresentation):
    """Writes any tool as one number, so that a model can be checked without a tool plugin."""

    def instructions(self, brief: Brief) -> str:
        return "`length`: of the stick, metres."

    def schema(self) -> dict[str, Any]:
        return {"length": {"type": "number"}}

    def parse(self, data: Any, *, gripper: bool) -> Tool:
        return fingers() if gripper else rigid()

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {"length": 0.2}


WILD: tuple[object, ...] = (
    None,
    True,
    1,
    -1e400,
    "",
    "x" * 1000,
    "<a>",
    [],
    [[]],
    [None],
    {},
    {"a": {}},
    [1] * 50,
)


def read_or_refused(
    parse: Callable[..., object], kind: type, documents: Iterable[object]
) -> None:
    """Check that whatever a model may write is read as a ``kind``, or refused with a DesignError that says why."""
    for data in documents:
        try:
            found = parse(data, gripper=False)
        except DesignError as error:
            expect_reason(error, data)
        except RAISED as error:
            what = f"parse raised {type(error).__name__} on {shorten(repr(data))}, not a DesignError"
            raise AssertionError(what) from error
        else:
            expect_a(kind, found, f"for {shorten(repr(data))} parse returned")


def brief(
    task: Task,
    representation: ToolRepresentation,
    *,
    agent: int = 0,
    gripper: bool = False,
) -> Brief:
    """The brief of a first generation: two tools with two plans each."""
    given = representation.given(task)
    n_tool = 2 if given is None else 1
    gripper = gripper if given is None else given.gripper
    actions = installed().create(ACTION, "waypoints")
    return Brief(
        task, 0, representation, gripper, n_tool, 2, 0, agent, agent, actions=actions
    )


def request(brief: Brief) -> Request:
    """A short request for a brief."""
    fields = ", ".join([*brief.representation.schema(), "gripper", "action_sets"])
    text = f"{brief.task.description} Answer with JSON: strategies, a list of {brief.n_tool} objects with {fields}."
    return Request(
        f"g{brief.generation}-a{brief.agent}",
        brief,
        (Message("user", (Text(text),)),),
        {"type": "object"},
        1.0,
    )


def ready(kind: str) -> list[str]:
    """Return the names of the parts of a kind that can be made without settings, sorted."""
    names = []
    for name, factory in installed().factories(kind).items():
        settings = settings_of(factory).values()
        if all(setting.default is not setting.empty for setting in settings):
            names.append(name)
    return names


def some_task() -> Task:
    """The first task that is installed.

    Raises:
        UserError: there is none.
    """
    for name in ready("task"):
        return installed().create(TASK, name)
    raise UserError("no task is installed; a check needs one")


@lru_cache(maxsize=2)
def some_simulator(*, soft: bool = False) -> tuple[str, Simulator]:
    """The first engine that can be made, and its name; the built-in ones come first. ``soft``: it has soft bodies.

    Raises:
        UserError: there is none.
        LeftOut: none of them has soft bodies.
    """
    for name, simulator in simulators():
        if not soft or Ability.SOFT_BODIES in simulator.supports:
            return name, simulator
    raise LeftOut("no engine that can be made here has soft bodies")


def simulators() -> Iterator[tuple[str, Simulator]]:
    """Yield the engines that can be made, with their names; the built-in ones come first.

    Raises:
        UserError: there is none.
    """
    any_made = False
    offers = [offer for offer in installed().offers.values() if offer.kind == "sim"]
    for offer in sorted(
        offers, key=lambda offer: (offer.distribution != PROJECT, offer.name)
    ):
        # For example an engine whose library is not installed.
        with suppress(UserError):
            yield offer.name, PluginPart("sim", offer.name).create()
            any_made = True

    if not any_made:
        raise UserError(
            "no simulator can be made; a check needs one. `python -m core.plugins` lists what is installed"
        )


def as_json(value: object, what: str) -> str:
    """Write a value as JSON.

    Raises:
        AssertionError: it can't be written.
    """
    try:
        return json.dumps(value, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise AssertionError(f"{what} can't be written as JSON: {error}") from error
