"""Define the state of a scene, which engines return and rewards read, and the trace of a rollout.

Plugins import both from `core.scene`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from core.geometry import Array, Pose
from core.values.joints import JointState, PlacedJoint, Placement, rotate
from core.values.tools import GRIPPER_MOUNTS


@dataclass(frozen=True)
class State:
    """Poses and velocities of the free bodies, in one world or in many of one layout.

    Positions (..., B, 3) and quaternions (..., B, 4) of the bodies' frames in the world, velocities (..., B, 3) in m/s
    and rad/s, world axes. Leading axes, if any, are worlds or times. ``places`` has the poses of fixed bodies and marks
    by name, and ``joints`` the scene's joints; they are empty in what engines return, and rewards have them. ``soft``
    has the nodes (..., N, 3) of each soft body by name; its position is its centre of mass, and it is never turned.
    """

    names: tuple[str, ...]
    positions: Array
    quaternions: Array
    linear_velocities: Array
    angular_velocities: Array
    places: Mapping[str, Pose] = field(default_factory=dict, kw_only=True)
    joints: Mapping[str, PlacedJoint] = field(default_factory=dict, kw_only=True)
    soft: Mapping[str, Array] = field(default_factory=dict, kw_only=True)

    def _number(self, name: str) -> int:
        if name not in self.names:
            known = ", ".join((*self.names, *self.places))
            raise KeyError(
                f"no body {name!r} that moves in the state; there are: {known}"
            )
        return self.names.index(name)

    def position(self, name: str, node: int | None = None) -> Array:
        """The position of one body or mark, or of one node of a soft body, (..., 3)."""
        if node is not None:
            return self.nodes(name)[..., node, :]
        if name in self.places:
            return np.broadcast_to(
                self.places[name].position, (*self.positions.shape[:-2], 3)
            )
        return self.positions[..., self._number(name), :]

    def quaternion(self, name: str) -> Array:
        """The quaternion of one body or mark, (..., 4)."""
        if name in self.places:
            return np.broadcast_to(
                self.places[name].quaternion, (*self.quaternions.shape[:-2], 4)
            )
        return self.quaternions[..., self._number(name), :]

    def relative(self, name: str, to: str) -> Array:
        """The position of one body or mark in the frame of another, (..., 3)."""
        return rotate(
            self.quaternion(to) * [1.0, -1.0, -1.0, -1.0],
            self.position(name) - self.position(to),
        )

    def joint(self, name: str) -> JointState:
        """The position and speed of a joint, each (...).

        Raises:
            KeyError: there is no such joint, or the state is an engine's, without joints (`Scene.complete`).
        """
        if name not in self.joints:
            raise KeyError(
                f"no joint {name!r} in the state; there are: {', '.join(self.joints) or 'none'}"
            )
        placed = self.joints[name]
        return placed.read(
            self.placement(placed.joint.body), self.placement(placed.joint.parent)
        )

    def placement(self, name: str | None) -> Placement:
        """The pose and the velocities of a body, (..., 3) and (..., 4); None: of the world."""
        if name is None or name in self.places:
            return Placement.at_rest(Pose() if name is None else self.places[name])
        number = self._number(name)
        return Placement(*(array[..., number, :] for array in self.arrays))

    def linear_velocity(self, name: str) -> Array:
        """The linear velocity of one body, (..., 3)."""
        return self.linear_velocities[..., self._number(name), :]

    def pose(self, name: str) -> Pose:
        """The pose of one body in one world."""
        return Pose(self.position(name), self.quaternion(name))

    def nodes(self, name: str, to: str | None = None) -> Array:
        """The nodes of a soft body, (..., N, 3), in the world or in the frame of another body; a rope's in order."""
        if name not in self.soft:
            raise KeyError(
                f"no soft body {name!r} in the state; there are: {', '.join(self.soft) or 'none'}"
            )
        if to is None:
            return self.soft[name]
        turn, place = (
            array[..., None, :] for array in (self.quaternion(to), self.position(to))
        )
        return rotate(turn * [1.0, -1.0, -1.0, -1.0], self.soft[name] - place)

    def extent(self, name: str) -> Array:
        """The size of the box along the world's axes around a soft body's nodes, (..., 3)."""
        extent: Array = np.ptp(self.nodes(name), axis=-2)
        return extent

    def length(self, name: str, first: int = 0, last: int = -1) -> Array:
        """The length of the way through a soft body's nodes from one number to another, (...)."""
        count = self.nodes(name).shape[-2]
        way = self.nodes(name)[..., first % count : last % count + 1, :]
        length: Array = np.linalg.norm(np.diff(way, axis=-2), axis=-1).sum(axis=-1)
        return length

    def covered_area(self, name: str) -> Array:
        """The area of the convex hull of a soft body's nodes as seen from above, m^2, (...)."""
        from scipy.spatial import (
            ConvexHull,
        )  # only here: the lists of parts import this file

        nodes = self.nodes(name)[..., :2]
        if nodes.shape[-2] < 3:
            return np.zeros(nodes.shape[:-2])
        areas = [
            ConvexHull(one, qhull_options="QJ").volume
            for one in nodes.reshape(-1, *nodes.shape[-2:])
        ]
        return np.reshape(np.array(areas), nodes.shape[:-2])

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """Positions, quaternions, linear and angular velocities."""
        return (
            self.positions,
            self.quaternions,
            self.linear_velocities,
            self.angular_velocities,
        )

    def __getitem__(self, index: int) -> State:
        """One world (or time) of many."""
        return self.each(lambda array: array[index])

    def each(self, change: Callable[[Array], Array]) -> State:
        """Change all arrays alike: those of bodies, and the nodes of soft ones."""
        soft = {name: change(nodes) for name, nodes in self.soft.items()}
        return State(
            self.names,
            *map(change, self.arrays),
            places=self.places,
            joints=self.joints,
            soft=soft,
        )

    @staticmethod
    def merged(
        states: Sequence[State], how: Callable[[Sequence[Array]], Array]
    ) -> State:
        """Merge the arrays of states of one layout with a function such as `numpy.stack`."""
        first = states[0]
        soft = {
            name: how([state.soft[name] for state in states]) for name in first.soft
        }
        arrays = map(how, zip(*(state.arrays for state in states), strict=True))
        return State(
            first.names, *arrays, places=first.places, joints=first.joints, soft=soft
        )

    @staticmethod
    def stack(states: Sequence[State]) -> State:
        """Combine states of one layout into one with a new leading axis.

        Raises:
            ValueError: there are no states, or their bodies differ.
        """
        if not states or any(state.names != states[0].names for state in states):
            raise ValueError(
                "only states of the same bodies can be stacked, and at least one is needed"
            )
        return State.merged(states, np.stack)


TRACE_HZ = 25.0

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Trace:
    """The states of one world or of many at a fixed rate, and the contacts in them.

    Two things are in contact while the gap between their shapes is at most what engines leave between things that rest
    on each other. It is computed from the poses, so it is the same notion in every engine.

    In queries ``by`` says what else touches the body: ``robot`` is its links and the tool, ``tool`` all components of
    the tool, ``arm`` all links with hand and fingers, another name that component, link or body, and None anything.

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
    """

    times: Array
    states: State
    touching: Mapping[tuple[str, str, str], Flags] = field(default_factory=dict)
    forces: Mapping[tuple[str, str], Array] | None = None
    clearances: Mapping[str, Array] = field(default_factory=dict)

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
        for (kind, one, other), flags in self.touching.items():
            if _about(kind, one, other, body, by):
                found = found | flags
        return found

    def touched(self, body: str, by: str | None = None) -> Flags:
        """Report whether a body was ever touched, (...)."""
        return np.asarray(self.contact(body, by).any(axis=-1))

    def touching_at_end(self, body: str, by: str | None = None) -> Flags:
        """Report whether a body is touched at the last instant, (...)."""
        return self.contact(body, by)[..., -1]

    def first_s(self, body: str, by: str | None = None) -> Array:
        """Find when a body was first touched, s, (...); inf: never."""
        found: Array = np.where(self.contact(body, by), self.times, np.inf).min(axis=-1)
        return found

    def force_n(self, body: str, by: str | None = None) -> Array:
        """Find the largest of `forces_n`, N, (...).

        Raises:
            ValueError: nothing measured forces.
        """
        largest: Array = self.forces_n(body, by).max(axis=-1)
        return largest

    def forces_n(self, body: str, by: str | None = None) -> Array:
        """Find the largest mean normal force between a body and one other thing, N, (..., T); the tool is one thing.

        With ``robot`` and ``tool``, what these pass on through free bodies is added, see `passed_on`.

        Raises:
            ValueError: nothing measured forces.
        """
        self._check(body)
        if self.forces is None:
            raise ValueError(
                "the trace has no forces; this engine or environment measures none"
            )
        found = np.zeros(self.shape)
        for (one, other), forces in self.forces.items():
            part = (
                self.touching.get(("tool", by or "", body))
                if (one, other) == ("tool", body)
                else None
            )
            if part is not None or _about(
                self._kind(one), one, other, body, by
            ):  # of a component: while it touches
                found = np.maximum(found, forces if part is None else forces * part)
        if by in ("robot", "tool"):
            found = found + self.passed_on(body, by)
        return found

    def passed_on(self, body: str, by: str) -> Array:
        """Bound what ``robot`` or ``tool`` presses a body with through free bodies, N, (..., T).

        A chain of bodies passes on as much as its weakest contact bears. What a body lies on another with at the start
        is its weight, and is not passed on.
        """
        forces = self.forces or {}
        pairs = [pair for pair in forces if self._kind(pair[0]) == "body"]
        pressed = {
            name: np.zeros(self.shape) for name in self.states.names if name != body
        }
        for (one, other), force in forces.items():
            if (
                other in pressed
                and one not in pressed
                and _about(self._kind(one), one, other, other, by)
            ):
                pressed[other] = pressed[other] + force
        _spread(pressed, [(*pair, forces[pair]) for pair in pairs])
        total = np.zeros(self.shape)
        for one, other in pairs:
            if (
                body in (one, other)
                and (through := other if one == body else one) in pressed
            ):
                borne = np.maximum(
                    forces[one, other] - forces[one, other][..., :1], 0.0
                )
                total = total + np.minimum(pressed[through], borne)
        return total

    def _kind(self, one: str) -> str:
        """The kind of a pair of forces by its first name, see `touching`."""
        return (
            "tool"
            if one == "tool"
            else "body"
            if one in (*self.states.names, *self.states.places)
            else "arm"
        )

    def held(self, body: str) -> Flags:
        """Report at which instants (..., T) the robot carries a body.

        It and the free bodies that touch it, directly or through others, touch the robot, and nothing that is fixed.
        """
        self._check(body)
        group = dict.fromkeys(self.states.names, np.zeros(self.shape, dtype=bool))
        group[body] = np.ones(self.shape, dtype=bool)
        _spread(
            group,
            [
                (one, other, flags)
                for (kind, one, other), flags in self.touching.items()
                if kind == "body"
            ],
        )
        robot, fixed = (
            np.zeros(self.shape, dtype=bool),
            np.zeros(self.shape, dtype=bool),
        )
        for name, within in group.items():
            robot |= within & self.contact(name, "robot")
            for place in self.states.places:
                fixed |= within & self.contact(name, place)
        return robot & ~fixed

    def __getitem__(self, index: int) -> Trace:
        """One world of many."""
        forces = (
            None
            if self.forces is None
            else {key: of[index] for key, of in self.forces.items()}
        )
        touching = {key: of[index] for key, of in self.touching.items()}
        clearances = {body: of[index] for body, of in self.clearances.items()}
        return replace(
            self,
            states=self.states[index],
            touching=touching,
            forces=forces,
            clearances=clearances,
        )

    @classmethod
    def of(cls, *states: State, **given: Any) -> Trace:
        """Make a trace of states, each (..., B, 3), at successive instants; ``given`` are further attributes."""
        stacked = State.merged(states, lambda arrays: np.stack(arrays, axis=-3))
        return cls(np.arange(len(states)) / TRACE_HZ, stacked, **given)

    def _check(self, body: str) -> None:
        known = (*self.states.names, *self.states.places)
        if body not in known:
            raise KeyError(
                f"no body {body!r} in the trace; there are: {', '.join(known)}"
            )


def _spread(
    values: dict[str, npt.NDArray[Any]],
    links: Sequence[tuple[str, str, npt.NDArray[Any]]],
) -> None:
    """Pass each body's value on through links to others, as much as the weakest link of a chain lets through."""
    changed = True
    while changed:
        changed = False
        for one, other, link in links:
            for giver, taker in ((one, other), (other, one)):
                if giver not in values or taker not in values:
                    continue
                more = np.maximum(values[taker], np.minimum(values[giver], link))
                changed |= bool((more != values[taker]).any())
                values[taker] = more


def _about(kind: str, one: str, other: str, body: str, by: str | None) -> bool:
    """Report whether a contact is one of ``body`` with ``by``, see `Trace`."""
    if kind == "body" and body == one:
        return by in (None, other)
    if body != other:
        return False
    if by == "arm":
        return kind == "arm" or (kind == "tool" and one in GRIPPER_MOUNTS)
    return (
        by is None
        or by == one
        or (kind != "body" and by == "robot")
        or (kind == "tool" and by == "tool")
    )
