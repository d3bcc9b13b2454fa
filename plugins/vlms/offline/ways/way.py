"""What a way of using a tool says of itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar, TypeVar

import numpy as np

from core.geometry import Pose
from plugins.vlms.offline.heads import Head, Step
from plugins.vlms.offline.job import Asked, Job
from plugins.vlms.offline.recipe import Values

T = TypeVar("T")

OVER_M = 0.03
"""How far above everything near a head comes and goes."""

BACK_M = 0.03
"""How far a head goes back from what it has moved."""

_LEAST_WALL_M = 0.02  # a wall, at least
_MOST_WALL_M = 0.15  # and at most


Ranges = Mapping[str, tuple[float, float]]
"""From what to what parameters are drawn, by name; each value is as likely."""

START_RANGES: Ranges = {"rise": (0.0, 1.0)}
"""How far out the arm rises to where it works, if that is above home: a parameter of every way."""


class Way(ABC):
    """A way of using a tool: for what it is, and which head does it by which motion.

    A way has no state: the same job and values give the same head and motion. Lengths are metres, angles radians,
    speeds m/s; the frame is the job's (`Job.frame`).

    Attributes:
        name: a word for it, which stands in documents.
        title: what it does, for tables: "pushes bodies from behind".
        does: what it does for bodies (`Job.asks`).
        approaches: whether the frame's x points away from the robot, even where bodies have to go another way.
        fingers: whether its head is on the fingers of a gripper; else on the flange.
        bolted: whether its head says itself where it is at the mount; else that is drawn, and a shaft carries it.
        bare: whether the head is the hand itself.
        sizes: the parameters of the head, which the motion may read, too.
        moves: those of the motion alone, which each plan of a tool has for itself.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    does: ClassVar[Asked] = "place"
    approaches: ClassVar[bool] = False
    fingers: ClassVar[bool] = False
    bolted: ClassVar[bool] = False
    bare: ClassVar[bool] = False
    sizes: ClassVar[Ranges]
    moves: ClassVar[Ranges]

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Its parameters: those of the head and of the motion, and those of the start, which all ways have."""
        return {**self.sizes, **self.moves, **START_RANGES}

    @property
    def kind(self) -> str:
        """The kind of its tools: ``gripper`` or ``rigid``."""
        return "gripper" if self.fingers else "rigid"

    @abstractmethod
    def suits(self, job: Job) -> float:
        """Say how well it suits a job: 0, not at all, to 1. It is chosen so often in relation to others."""

    @abstractmethod
    def head(self, job: Job, values: Values) -> Head:
        """Make the head."""

    @abstractmethod
    def motion(self, job: Job, values: Values) -> Iterator[Step]:
        """Yield the poses of the head, from above the bodies on."""


def wall_height(job: Job, values: Values) -> float:
    """Return how high a wall is that moves bodies: ``height`` of theirs, within what a tool carries."""
    return float(np.clip(values["height"] * job.size[2], _LEAST_WALL_M, _MOST_WALL_M))


def move_along(
    job: Job, values: Values, begin: Pose, end: Pose, back: float = BACK_M
) -> Iterator[Step]:
    """Yield the steps of a head that comes down behind bodies, moves them along, and leaves them if it does.

    Args:
        job: what is moved.
        values: ``speed``, and whether it ``leaves``.
        begin: where the head comes down.
        end: where it stops.
        back: how far it goes back before it rises.
    """
    yield above(job, begin)
    yield Step(begin)
    yield Step(end, speed=values["speed"], touch=True)

    if leaves(job, values):
        clear = end @ Pose(np.array([-back, 0.0, 0.0]))
        if back:
            yield Step(clear, touch=True)
        yield Step(above(job, clear).pose, touch=True)


def leaves(job: Job, values: Values) -> bool:
    """Report whether the head leaves the bodies at the end: it must, or ``leaves`` is above a half."""
    return job.want.released or values["leaves"] > 0.5


def pick(choices: Sequence[T], share: float) -> T:
    """Return the choice that is a share of the way through them, 0 to 1."""
    number = int(np.clip(share, 0.0, 1.0) * len(choices))
    return choices[min(number, len(choices) - 1)]


def above(job: Job, pose: Pose) -> Step:
    """Return the step over a pose, above everything near."""
    x, y, z = pose.position
    height = max(job.clear, z) + OVER_M
    return Step(Pose(np.array([x, y, height]), pose.quaternion))
