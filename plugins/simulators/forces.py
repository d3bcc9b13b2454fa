"""Sum up the contact forces of a world that is stepped."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import Pushes
from core.scene import Joint

Thing = tuple[int, str]
"""A rank, and a name; the robot's things have rank -1, bodies theirs in the scene."""

TOOL: Thing = (-1, "tool")


def thing_of(tool: Tool, link: str) -> Thing:
    """Say what a link of the robot with a tool is: the tool's are one thing."""
    return TOOL if link in tool.borne_on else (-1, link)


class Meeting(NamedTuple):
    """Two things that touch.

    Attributes:
        pair: their names; None: both are the robot's, or of one body, which does not count.
        body: what the tool touches, if one of the two is the tool.
        sign: -1 where the tool comes second, else 1.
    """

    pair: tuple[str, str] | None
    body: str | None
    sign: float


@cache
def meeting(thing: Thing, other: Thing) -> Meeting:
    """Say what a contact between two things counts for."""
    first, second = sorted((thing, other))
    sign = 1.0
    if first != thing:
        sign = -1.0
    if first[0] == second[0]:
        return Meeting(None, None, sign)

    body = None
    if first == TOOL:
        body = second[1]

    return Meeting((first[1], second[1]), body, sign)


class _Push(NamedTuple):
    """A contact of the tool.

    Attributes:
        body: what the tool touched.
        point: where, in the world (3,).
        impulse: on the tool, N s (3,).
    """

    body: str
    point: Sequence[float]
    impulse: Array


class Totals(NamedTuple):
    """What was summed up to an instant: impulses of pairs, N s, and the number of pushes on the tool."""

    sums: Mapping[tuple[str, str], float]
    pushes: int


class Impulses(ABC):
    """The normal impulses since a world began, of each two things that touched; those on the tool with their points.

    An engine's class adds those of each step with `add` and `push`. `totals` goes into each note of the world, and
    `mean_forces` makes forces of them.
    """

    def __init__(self) -> None:
        self._sums: dict[tuple[str, str], float] = {}
        self._pushes: list[_Push] = []

    @abstractmethod
    def add_step(self) -> None:
        """Add those of the last step."""

    def add(self, met: Meeting, impulse: float) -> None:
        """Add the impulse of a contact, N s."""
        if impulse > 0 and met.pair:
            self._sums[met.pair] = self._sums.get(met.pair, 0.0) + impulse

    def push(self, met: Meeting, point: Sequence[float], impulse: Array) -> None:
        """Add the impulse on the first thing (3,), N s, of a contact of the tool at a point in the world."""
        assert met.body is not None
        push = _Push(met.body, point, met.sign * impulse)
        self._pushes.append(push)

    def totals(self) -> Totals:
        """Return the sums up to now."""
        return Totals(dict(self._sums), len(self._pushes))

    def mean_forces(
        self, totals: Sequence[Totals], instants: Array
    ) -> tuple[dict[tuple[str, str], Array], Pushes]:
        """Compute the mean forces between instants (T,), seconds, see `core.interfaces.Recording`."""
        spans = np.diff(instants)
        forces = {}
        for pair in self._sums:
            sums = np.array([total.sums.get(pair, 0.0) for total in totals])
            forces[pair] = np.append(0.0, np.diff(sums) / spans)

        return forces, self._mean_pushes([total.pushes for total in totals], spans)

    def _mean_pushes(self, counts: Sequence[int], spans: Array) -> Pushes:
        """Compute the mean forces on the tool.

        Args:
            counts: how many pushes there were up to each instant (T,).
            spans: between the instants (T - 1,), seconds.
        """
        numbers = np.arange(len(self._pushes))
        samples = np.searchsorted(counts, numbers, side="right")
        bodies = np.array([push.body for push in self._pushes], dtype=np.str_)
        points = np.reshape([push.point for push in self._pushes], (-1, 3))
        impulses = np.reshape([push.impulse for push in self._pushes], (-1, 3))
        forces = impulses / np.append(np.inf, spans)[samples, None]
        return Pushes(samples, bodies, points, forces)


def latch_force(joint: Joint, position: float) -> float:
    """Compute what a joint's latches pull with at a position, N or N m, in its direction."""
    total = 0.0
    for latch in joint.latches:
        away = position - latch.at
        if abs(away) < latch.width:
            total -= latch.force * math.sin(math.pi * away / latch.width)

    return total
