"""Define the trace of a rollout: states over time, and what touched and pressed. It is in `core.scene` too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from core.errors import unknown
from core.geometry import Array
from core.values.bearing import Flags, Support, Touching
from core.values.jobs import Forces
from core.values.states import State
from core.values.tools import GRIPPER_MOUNTS

TRACE_HZ = 25.0
NO_FORCES = "the trace has no forces; this engine or environment measures none"


@dataclass(frozen=True, eq=False)
class Trace:
    """The states of one world or of many at a fixed rate, and the contacts in them.

    Two things are in contact while the gap between their shapes is at most what engines leave between things that rest
    on each other. It is computed from the poses, so it is the same notion in every engine.

    In queries ``by`` says what else touches the body: ``robot`` is its links and the tool, ``tool`` all components of
    the tool, ``arm`` all links with hand and fingers, another name that body, or else that component or link, and None
    anything.

    Attributes:
        times: (T,) instants, s, `TRACE_HZ` apart from 0, when the robot's motion begins.
        states: of the free bodies, with the axes of worlds, if any, and then T: positions are (..., T, B, 3). A world
            that ends earlier repeats its last state.
        touching: for two things that ever touched, at which instants (..., T). The first of three names is the kind of
            the second, ``tool``, ``arm`` or ``body``; the third is a body.
        clearances: the least gap between the robot and a body, m, (...), 0 where it touched it; what is not among them
            was not measured.
        forces: the mean of two things' normal force since the instant before, N, (..., T), see `Recording.forces`;
            None: nothing measured forces.
        peaks: the largest of these forces since the instant before, over the recording's own steps, N, (..., T); None:
            as ``forces``. Where a goal limits a force, the recording has each step of the engine.
        strains: for each thing that can break, the largest force on it since the instant before, as a share of the
            force that it bears, (..., T): above 1 it breaks.
        gripped: for each component that ever gripped a body, and the body, at which instants it did, (..., T).
    """

    times: Array
    states: State
    touching: Touching = field(default_factory=dict)
    forces: Forces | None = None
    clearances: Mapping[str, Array] = field(default_factory=dict)
    peaks: Forces | None = None
    strains: Mapping[str, Array] = field(default_factory=dict)
    gripped: Mapping[tuple[str, str], Flags] = field(default_factory=dict)

    @classmethod
    def of(cls, *states: State, **given: Any) -> Trace:
        """Make a trace of states, each (..., B, 3), at successive instants; ``given`` are further attributes."""
        stacked = State.merged(states, lambda arrays: np.stack(arrays, axis=-3))
        return cls(np.arange(len(states)) / TRACE_HZ, stacked, **given)

    @property
    def shape(self) -> tuple[int, ...]:
        """The axes of worlds, if any, and T."""
        return self.states.positions.shape[:-2]

    def contact(self, body: str, by: str | None = None) -> Flags:
        """Report at which instants (..., T) a body is touched.

        Raises:
            ValueError: what touches a soft body is known by its force, and nothing measured forces.
        """
        self._check(body)

        if self.forces is None and {body, by} & self.states.soft.keys():
            raise ValueError(
                "the trace has no forces, by which contacts of soft bodies are known"
            )

        found = np.zeros(self.shape, dtype=bool)
        for (kind, toucher, other), flags in self.touching.items():
            namesake = kind != "body" and toucher in self._bodies
            if namesake and by == toucher:  # the body is meant
                continue
            if _is_between(kind, toucher, other, body, by):
                found = found | flags

        return found

    def touched(self, body: str, by: str | None = None) -> Flags:
        """Report whether a body was ever touched, (...), as in ``~film.touched("vase", by="robot")``."""
        return np.asarray(self.contact(body, by).any(axis=-1))

    def touching_at_end(self, body: str, by: str | None = None) -> Flags:
        """Report whether a body is touched at the last instant, (...)."""
        return self.contact(body, by)[..., -1]

    def first_s(self, body: str, by: str | None = None) -> Array:
        """Find when a body was first touched, s, (...); inf: never."""
        return np.where(self.contact(body, by), self.times, np.inf).min(axis=-1)

    def force_n(self, body: str, by: str | None = None) -> Array:
        """Find the largest normal force over time, N, (...); see `forces_n`.

        Raises:
            ValueError: nothing measured forces.
        """
        return self.forces_n(body, by).max(axis=-1)

    def forces_n(self, body: str, by: str | None = None) -> Array:
        """Find the largest mean normal force between a body and one other thing, N, (..., T); the tool is one thing.

        With ``robot`` and ``tool``, what these pass on through other bodies is added, see `Support.passed_on`.

        Raises:
            ValueError: nothing measured forces.
        """
        self._check(body)

        if self.forces is None:
            raise ValueError(NO_FORCES)

        found = np.zeros(self.shape)
        for (presser, other), force in self.forces.items():
            # A component of the tool presses with the tool's force while it touches.
            named = by not in (None, "robot", "tool", "arm", *self._bodies)
            touches = self.touching.get(("tool", by or "", body)) if named else None
            if (presser, other) == ("tool", body) and touches is not None:
                found = np.maximum(found, force * touches)
            elif _is_between(self._kind(presser), presser, other, body, by):
                found = np.maximum(found, force)

        if by in ("robot", "tool"):
            found = found + self.support.passed_on(body, self._press(by))

        return found

    def peaks_n(self, body: str, by: str | None = None) -> Array:
        """Find the largest normal force between a body and one other thing since the instant before, N, (..., T).

        A blow lasts a few milliseconds: its mean over an instant of the trace is a tenth of its peak.

        Raises:
            ValueError: nothing measured forces.
        """
        if self.peaks is None:
            return self.forces_n(body, by)

        return replace(self, forces=self.peaks).forces_n(body, by)

    def strain(self, name: str) -> Array:
        """Find the largest force so far on what can break, as a share of what it bears, (..., T); above 1 it is broken.

        Raises:
            KeyError: it is not among what can break.
            ValueError: nothing measured forces.
        """
        if not self.strains:
            raise ValueError(NO_FORCES)
        if name not in self.strains:
            raise unknown("thing that breaks", name, "in the trace", self.strains)

        largest: Array = np.maximum.accumulate(self.strains[name], axis=-1)
        return largest

    @cached_property
    def support(self) -> Support:
        """Who bears whom."""
        return Support(
            self.states, self.touching, self.forces, self.strains, self.gripped
        )

    def _press(self, by: str) -> dict[str, Array]:
        """Sum how hard ``robot`` or ``tool`` presses each body that can move, N, (..., T)."""
        pressed = {name: np.zeros(self.shape) for name in self.states.names}
        for (presser, other), force in (self.forces or {}).items():
            free = other in pressed and presser not in pressed
            if free and _is_between(self._kind(presser), presser, other, other, by):
                pressed[other] = pressed[other] + force

        return pressed

    def __getitem__(self, index: int | None) -> Trace:
        """One world of many; None: the same as one of one."""

        def world(values: Mapping[Any, Any]) -> dict[Any, Any]:
            return {key: array[index] for key, array in values.items()}

        return replace(
            self,
            states=self.states[index],
            touching=world(self.touching),
            forces=None if self.forces is None else world(self.forces),
            peaks=None if self.peaks is None else world(self.peaks),
            clearances=world(self.clearances),
            strains=world(self.strains),
            gripped=world(self.gripped),
        )

    def _kind(self, presser: str) -> str:
        """The kind of a pair of forces by its first name, see `touching`."""
        if presser == "tool":
            return "tool"
        return "body" if presser in self._bodies else "arm"

    def _check(self, body: str) -> None:
        """Refuse the name of a body that is not there."""
        if body not in self._bodies:
            raise unknown("body", body, "in the trace", self._bodies)

    @property
    def _bodies(self) -> tuple[str, ...]:
        """The names of all bodies and marks."""
        return (*self.states.names, *self.states.places, *self.states.carried)


def _is_between(
    kind: str,
    toucher: str,
    other: str,
    body: str,
    by: str | None,
) -> bool:
    """Report whether a contact is one that is asked for, see `Trace`.

    Args:
        kind: of the contact.
        toucher: the first of the two.
        other: the second, a body.
        body: that is asked for.
        by: what else touches it, as queries have it.
    """
    if kind == "body" and body == toucher:
        return by in (None, other)
    if body != other:
        return False
    if by == "arm":  # a component of this name is none of its links
        return kind == "arm" or (kind == "tool" and toucher in GRIPPER_MOUNTS)
    if by in (None, toucher):
        return True

    return (by == "robot" and kind != "body") or (by == "tool" and kind == "tool")
