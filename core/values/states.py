"""Define the state of a scene, which engines return and rewards read. Plugins import it from `core.scene`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from core.errors import unknown
from core.geometry import Array, Pose, step_lengths
from core.values.bonds import Bond
from core.values.joints import (
    JointState,
    PlacedJoint,
    Placement,
    multiply,
    rotate,
    rotate_back,
)
from core.values.tools import Fixture

Value = TypeVar("Value")


@dataclass(frozen=True)
class State:
    """Poses and velocities of the free bodies, in one world or in many of one layout.

    Leading axes (...), if any, are worlds or times. Methods that take a name raise a KeyError for one that isn't there.
    As in a reward: ``end.position("cube")[..., 2] - start.position("cube")[..., 2]``.

    Attributes:
        names: of the B free bodies.
        positions: (..., B, 3) of their frames in the world, metres.
        quaternions: (..., B, 4) of their frames.
        linear_velocities: (..., B, 3) in world axes, m/s.
        angular_velocities: (..., B, 3) in world axes, rad/s.
        places: the poses of fixed bodies and marks by name; empty in what engines return, and rewards have them.
        joints: the scene's joints by name; likewise.
        carried: of each mark that moves along with a body, that body, and the mark's pose in its frame; likewise.
        bonds: the scene's bonds by name; likewise.
        pinned: the soft bodies of which nodes are pinned; likewise.
        fixture: what the design adds to the scene, None: nothing; likewise.
        hindered: why the scene itself prevents goals, by the goal; likewise.
        soft: the nodes (..., N, 3) of each soft body by name. Its position is its centre of mass, and it never turns.
    """

    names: tuple[str, ...]
    positions: Array
    quaternions: Array
    linear_velocities: Array
    angular_velocities: Array
    _: KW_ONLY
    places: Mapping[str, Pose] = field(default_factory=dict)
    joints: Mapping[str, PlacedJoint] = field(default_factory=dict)
    carried: Mapping[str, tuple[str, Pose]] = field(default_factory=dict)
    bonds: Mapping[str, Bond] = field(default_factory=dict)
    pinned: tuple[str, ...] = ()
    fixture: Fixture | None = None
    hindered: Mapping[object, str] = field(default_factory=dict)
    soft: Mapping[str, Array] = field(default_factory=dict)

    def position(self, name: str, node: int | None = None) -> Array:
        """The position of one body or mark, or of one node of a soft body, (..., 3)."""
        if node is not None:
            return self.nodes(name)[..., node, :]
        if name in self.carried:
            body, pose = self.carried[name]
            return self.position(body) + rotate(self.quaternion(body), pose.position)
        return self._pick(self.positions, name, "position")

    def quaternion(self, name: str) -> Array:
        """The quaternion of one body or mark, (..., 4)."""
        if name in self.carried:
            body, pose = self.carried[name]
            return multiply(self.quaternion(body), pose.quaternion)
        return self._pick(self.quaternions, name, "quaternion")

    def linear_velocity(self, name: str) -> Array:
        """The linear velocity of one body that moves, (..., 3)."""
        return self.linear_velocities[..., self._number(name), :]

    def pose(self, name: str) -> Pose:
        """The pose of one body in one world."""
        return Pose(self.position(name), self.quaternion(name))

    def relative(self, name: str, to: str) -> Array:
        """The position of one body or mark in the frame of another, (..., 3)."""
        return rotate_back(self.quaternion(to), self.position(name) - self.position(to))

    def placement(self, name: str | None) -> Placement:
        """Where a body is and how it moves; None: the world, which is at rest."""
        if name is None:
            return Placement.at_rest(Pose())
        if name in self.carried:
            body, _ = self.carried[name]
            place = self.position(name)
            bearer = self.placement(body)
            way = place - bearer.position
            return Placement(
                place,
                self.quaternion(name),
                bearer.linear + np.cross(bearer.angular, way),
                bearer.angular,
            )
        if name in self.places:
            return Placement.at_rest(self.places[name])

        number = self._number(name)
        return Placement(*(array[..., number, :] for array in self.arrays))

    def joint(self, name: str) -> JointState:
        """The position and speed of a joint, each (...); states of engines have none, see `Scene.complete`."""
        placed = _find("joint", name, self.joints)
        joint = placed.joint

        return placed.read(self.placement(joint.body), self.placement(joint.parent))

    def nodes(self, name: str, to: str | None = None) -> Array:
        """The nodes of a soft body, a rope's in order.

        Args:
            name: of the soft body.
            to: the body in whose frame they are; None: the world.

        Returns:
            Places (..., N, 3), metres.
        """
        nodes = _find("soft body", name, self.soft)
        if to is None:
            return nodes

        origin = self.position(to)[..., None, :]
        return rotate_back(self.quaternion(to)[..., None, :], nodes - origin)

    def extent(self, name: str) -> Array:
        """The size of the box along the world's axes around a soft body's nodes, (..., 3)."""
        return np.ptp(self.nodes(name), axis=-2)

    def length(self, name: str) -> Array:
        """The length of the way through a soft body's nodes, m, (...)."""
        return step_lengths(self.nodes(name)).sum(axis=-1)

    def covered_area(self, name: str) -> Array:
        """The area of the convex hull of a soft body's nodes as seen from above, m^2, (...)."""
        from scipy.spatial import ConvexHull  # lists of parts import this file

        nodes = self.nodes(name)[..., :2]
        shape = nodes.shape[:-2]
        if nodes.shape[-2] < 3:
            return np.zeros(shape)

        worlds = nodes.reshape(-1, *nodes.shape[-2:])
        hulls = [ConvexHull(points, qhull_options="QJ") for points in worlds]
        return np.array([hull.volume for hull in hulls]).reshape(shape)

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """Positions, quaternions, linear and angular velocities."""
        return (
            self.positions,
            self.quaternions,
            self.linear_velocities,
            self.angular_velocities,
        )

    def __getitem__(self, index: int | npt.NDArray[np.intp] | None) -> State:
        """One world (or time) of many, or several of them; None: the same as one of one."""
        return self.each(lambda array: array[index])

    def each(self, change: Callable[[Array], Array]) -> State:
        """Change all arrays alike: those of bodies, and the nodes of soft ones."""
        return State.merged([self], lambda arrays: change(arrays[0]))

    @staticmethod
    def merged(
        states: Sequence[State], how: Callable[[Sequence[Array]], Array]
    ) -> State:
        """Merge states of one layout.

        Args:
            states: what is merged.
            how: makes one array of those of all states, as `numpy.stack` does.
        """
        first = states[0]
        arrays = zip(*(state.arrays for state in states), strict=True)

        return State(
            first.names,
            *map(how, arrays),
            places=first.places,
            joints=first.joints,
            carried=first.carried,
            bonds=first.bonds,
            pinned=first.pinned,
            fixture=first.fixture,
            hindered=first.hindered,
            soft={
                name: how([state.soft[name] for state in states]) for name in first.soft
            },
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

    def _pick(self, array: Array, name: str, field: str) -> Array:
        """Pick what ``array`` has of one body, or of a mark this field of its pose."""
        if name in self.places:
            value = getattr(self.places[name], field)
            return np.broadcast_to(value, (*array.shape[:-2], len(value)))

        return array[..., self._number(name), :]

    def _number(self, name: str) -> int:
        """Look a free body up."""
        if name not in self.names:
            known = (*self.names, *self.places, *self.carried)
            raise unknown("body", name, "that moves in the state", known)

        return self.names.index(name)


def _find(what: str, name: str, values: Mapping[str, Value]) -> Value:
    """Look ``what`` has a name up."""
    if name not in values:
        raise unknown(what, name, "in the state", values)
    return values[name]
