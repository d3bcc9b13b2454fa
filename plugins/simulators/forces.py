"""Sum up the contact forces of a world that is stepped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from core.geometry import Array
from core.interfaces import Pushes, Recording

Thing = tuple[int, str]  # a rank, and a name; the robot's things have rank -1, bodies theirs in the scene
TOOL: Thing = (-1, "tool")


class Impulses:
    """The normal impulses since a world began, of each two things that touched; an engine adds those of each step.

    Those on the tool are also kept with their points.
    """

    def __init__(self) -> None:
        self._sums: dict[tuple[str, str], float] = {}
        self._noted: list[dict[tuple[str, str], float]] = []
        self._pushes: list[tuple[int, str, Sequence[float], Array]] = []

    def add(self, one: Thing, other: Thing, impulse: float) -> None:
        """Add the impulse of a contact, N s; contacts within the robot or a body don't count."""
        (rank, first), (others_rank, second) = sorted((one, other))
        if impulse > 0 and others_rank > rank:
            self._sums[first, second] = self._sums.get((first, second), 0.0) + impulse

    def push(self, one: Thing, other: Thing, point: Sequence[float], impulse: Array) -> None:
        """Add the impulse on ``one`` (3,), N s, of a contact at a point in the world, if one of the two is the tool."""
        for (rank, name), (others_rank, body), sign in ((one, other, 1.0), (other, one, -1.0)):
            if (rank, name) == TOOL and others_rank > rank:
                self._pushes.append((len(self._noted), body, point, sign * impulse))

    def note(self) -> None:
        """Note the sums at an instant of the recording."""
        self._noted.append(dict(self._sums))

    def measured(self, recording: Recording) -> Recording:
        """Add the mean forces between instants to a recording, see `core.interfaces.Recording`."""
        spans, forces = np.diff(recording.times), {}
        for pair in self._sums:
            sums = np.array([noted.get(pair, 0.0) for noted in self._noted])
            forces[pair] = np.append(0.0, np.diff(sums) / spans)
        samples, bodies, points, impulses = zip(*self._pushes, strict=True) if self._pushes else ((),) * 4
        at = np.array(samples, dtype=np.int64)
        pushes = np.reshape(impulses, (-1, 3)) / np.append(np.inf, spans)[at, None]
        made = Pushes(at, np.array(bodies, dtype=np.str_), np.reshape(points, (-1, 3)), pushes)
        return replace(recording, forces=forces, pushes=made)
