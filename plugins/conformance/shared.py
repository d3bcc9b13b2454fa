"""Provide what the checks of every kind share: comparisons, requests, the first task and the first engine."""

from __future__ import annotations

import json
import math
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from core.design import DesignError
from core.errors import RAISED, UserError, in_line
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


# --- comparisons ------------------------------------------------------------------------------------------------


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
    figures = [_digits(values[wrong][:3]) for values in (found, due, within)]
    message = "{}: {} instead of {}; at most {} of difference is allowed"
    assert not wrong.any(), message.format(what, *figures)


def between(
    what: str, found: SupportsFloat, low: float = -math.inf, high: float = math.inf
) -> None:
    """Check that a figure lies between two bounds.

    Raises:
        AssertionError: it does not, or is not a number.
    """
    figure, least, most = map(_digits, (float(found), low, high))
    bounds = f"{what}: {figure}; it must be from {least} to {most}"
    assert low <= float(found) <= high, bounds


def _digits(figures: ArrayLike) -> str:
    return ", ".join(f"{figure:.4g}" for figure in np.ravel(figures))


def expect_a(kind: type, value: object, what: str) -> None:
    """Check that a value is of a kind; ``what`` says where it comes from, such as ``parse returned``.

    Raises:
        AssertionError: it is something else.
    """
    found = f"a {type(value).__name__}, not a {kind.__name__}"
    assert isinstance(value, kind), f"{what} {found}"


def as_json(value: object, what: str) -> str:
    """Write a value as JSON.

    Raises:
        AssertionError: it can't be written.
    """
    try:
        return json.dumps(value, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise AssertionError(f"{what} can't be written as JSON: {error}") from error


def describe_error(error: BaseException) -> str:
    """Describe an exception in one line, with the place in the code that raised it."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{in_line(error)} ({last.filename}, line {last.lineno})"


# --- what a model may write -------------------------------------------------------------------------------------

WILD: tuple[object, ...] = (
    *(None, True, 1, -1e400, "", "x" * 1000, "<a>"),
    *([], [[]], [None], {}, {"a": {}}, [1] * 50),
)


def expect_reason(refusal: DesignError, data: object) -> None:
    """Check that what a model may write is refused with a reason.

    Raises:
        AssertionError: there is none.
    """
    assert str(refusal).strip(), f"{shorten(repr(data))} was refused without a reason"


def read_or_refused(
    parse: Callable[..., object], kind: type, documents: Iterable[object]
) -> None:
    """Check that whatever a model may write is read as a ``kind``, or refused with a DesignError that says why."""
    for data in documents:
        written = shorten(repr(data))
        try:
            found = parse(data, gripper=False)
        except DesignError as error:
            expect_reason(error, data)
        except RAISED as error:
            what = f"parse raised {type(error).__name__} on {written}"
            raise AssertionError(f"{what}, not a DesignError") from error
        else:
            expect_a(kind, found, f"for {written} parse returned")


def brief(
    task: Task,
    representation: ToolRepresentation,
    *,
    agent: int = 0,
    gripper: bool = False,
) -> Brief:
    """The brief of a first generation: two tools with two plans each."""
    given = representation.given(task)
    n_tool = 2
    if given is not None:
        n_tool = 1
        gripper = given.gripper

    actions = installed().create(ACTION, "waypoints")
    return Brief(
        task, 0, representation, gripper, n_tool, 2, 0, agent, agent, actions=actions
    )


def request(brief: Brief) -> Request:
    """A short request for a brief."""
    fields = ", ".join([*brief.representation.schema(), "gripper", "action_sets"])
    text = f"{brief.task.description} Answer with JSON: strategies, a list of {brief.n_tool} objects with {fields}."
    name = f"g{brief.generation}-a{brief.agent}"
    message = Message("user", (Text(text),))
    return Request(name, brief, (message,), {"type": "object"}, 1.0)


# --- other parts ------------------------------------------------------------------------------------------------


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
    offers = [offer for offer in installed().offers.values() if offer.kind == "sim"]
    offers.sort(key=lambda offer: (offer.distribution != PROJECT, offer.name))
    any_made = False
    for offer in offers:
        # For example an engine whose library is not installed.
        with suppress(UserError):
            yield offer.name, PluginPart("sim", offer.name).create()
            any_made = True

    if not any_made:
        raise UserError(
            "no simulator can be made; a check needs one. `python -m core.plugins` lists what is installed"
        )
