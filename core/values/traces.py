"""Define the trace of a rollout: states over time, and what touched and pressed. It is in `core.scene` too."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from core.errors import unknown
from core.geometry import Array
from core.values.states import State
from core.values.tools import GRIPPER_MOUNTS

TRACE_HZ = 25.0
NO_FORCES = "the trace has no forces; this engine or environment measures none"

Flags = npt.NDArray[np.bool_]
Link = tuple[str, str, npt.NDArray[Any]]  # two bodies, and how much passes between them


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
    """

    times: Array
    states: State
    touching: Mapping[tuple[str, str, str], Flags] = field(default_factory=dict)
    forces: Mapping[tuple[str, str], Array] | None = None
    clearances: Mapping[str, Array] = field(default_factory=dict)
    peaks: Mapping[tuple[str, str], Array] | None = None
    strains: Mapping[str, Array] = field(default_factory=dict)

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

        found = self._never()
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

        With ``robot`` and ``tool``, what these pass on through free bodies is added, see `passed_on`.

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
            found = found + self.passed_on(body, by)

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

    def passed_on(self, body: str, by: str) -> Array:
        """Bound what ``robot`` or ``tool`` presses a body with through free bodies, N, (..., T).

        A chain of bodies passes on as much as its weakest contact bears. What a body lies on another with at the start
        is its weight, and is not passed on.

        Args:
            body: that is pressed.
            by: ``robot`` or ``tool``.
        """
        forces = self.forces or {}
        between = [pair for pair in forces if self._kind(pair[0]) == "body"]
        pressed = {
            name: np.zeros(self.shape) for name in self.states.names if name != body
        }

        for (presser, other), force in forces.items():
            kind = self._kind(presser)
            free = other in pressed and presser not in pressed
            if free and _is_between(kind, presser, other, other, by):
                pressed[other] = pressed[other] + force

        _spread(pressed, [(*pair, forces[pair]) for pair in between])

        total = np.zeros(self.shape)
        for pair in between:
            through = pair[1] if pair[0] == body else pair[0]
            if body in pair and through in pressed:
                force = forces[pair]
                borne = np.maximum(force - force[..., :1], 0.0)
                total = total + np.minimum(pressed[through], borne)

        return total

    def held(self, body: str) -> Flags:
        """Report at which instants (..., T) the robot carries a body.

        It and the free bodies that touch it, directly or through others, touch the robot, and nothing that is fixed.
        """
        fixed = self._never()
        for name, within in self._group(body).items():
            for place in self.states.places:
                fixed |= within & self.contact(name, place)

        return self.linked(body) & ~fixed

    def linked(self, body: str) -> Flags:
        """Report at which instants (..., T) a body touches the robot, directly or through other free bodies."""
        robot = self._never()
        for name, within in self._group(body).items():
            robot |= within & self.contact(name, "robot")

        return robot

    def _group(self, body: str) -> dict[str, Flags]:
        """Report when (..., T) each free body touches one, directly or through others; the one itself always does."""
        self._check(body)
        group = dict.fromkeys(self.states.names, self._never())
        group[body] = ~self._never()
        between = [
            (toucher, other, flags)
            for (kind, toucher, other), flags in self.touching.items()
            if kind == "body"
        ]
        _spread(group, between)
        return group

    def __getitem__(self, index: int) -> Trace:
        """One world of many."""

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
        )

    def _never(self) -> Flags:
        """Flags (..., T) of which none is set."""
        return np.zeros(self.shape, dtype=bool)

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


def _spread(values: dict[str, npt.NDArray[Any]], links: Iterable[Link]) -> None:
    """Pass each body's value on to others, as much as the weakest link of a chain lets through.

    Args:
        values: of each body, numbers or flags (..., T). They are changed.
        links: between bodies, either way.
    """
    ways = [(giver, taker, link) for giver, taker, link in links]
    ways += [(taker, giver, link) for giver, taker, link in links]
    known = [way for way in ways if way[0] in values and way[1] in values]
    changed = True

    while changed:
        changed = False
        for giver, taker, link in known:
            more = np.maximum(values[taker], np.minimum(values[giver], link))
            changed |= bool((more != values[taker]).any())
            values[taker] = more


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
