"""Define the state of a scene, which engines return and rewards read.

Plugins import it from `core.scene`. Covered by `tests/core/test_scene.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from core.geometry import Array, Pose
from core.values.joints import JointState, PlacedJoint, Placement, rotate


@dataclass(frozen=True)
class State:
    """Poses and velocities of the free bodies, in one world or in many of one layout.

    Positions (..., B, 3) and quaternions (..., B, 4) of the bodies' frames in the world, velocities (..., B, 3) in m/s
    and rad/s, world axes. Leading axes, if any, are worlds or times. ``places`` has the poses of fixed bodies and marks
    by name, and ``joints`` the scene's joints; they are empty in what engines return, and rewards have them.
    """

    names: tuple[str, ...]
    positions: Array
    quaternions: Array
    linear_velocities: Array
    angular_velocities: Array
    places: Mapping[str, Pose] = field(default_factory=dict, kw_only=True)
    joints: Mapping[str, PlacedJoint] = field(default_factory=dict, kw_only=True)

    def _number(self, name: str) -> int:
        if name not in self.names:
            known = ", ".join((*self.names, *self.places))
            raise KeyError(f"no body {name!r} that moves in the state; there are: {known}")
        return self.names.index(name)

    def position(self, name: str) -> Array:
        """The position of one body or mark, (..., 3)."""
        if name in self.places:
            return np.broadcast_to(self.places[name].position, (*self.positions.shape[:-2], 3))
        return self.positions[..., self._number(name), :]

    def quaternion(self, name: str) -> Array:
        """The quaternion of one body or mark, (..., 4)."""
        if name in self.places:
            return np.broadcast_to(self.places[name].quaternion, (*self.quaternions.shape[:-2], 4))
        return self.quaternions[..., self._number(name), :]

    def relative(self, name: str, to: str) -> Array:
        """The position of one body or mark in the frame of another, (..., 3)."""
        return rotate(self.quaternion(to) * [1.0, -1.0, -1.0, -1.0], self.position(name) - self.position(to))

    def joint(self, name: str) -> JointState:
        """The position and speed of a joint, each (...).

        Raises:
            KeyError: there is no such joint, or the state is an engine's, without joints (`Scene.complete`).
        """
        if name not in self.joints:
            raise KeyError(f"no joint {name!r} in the state; there are: {', '.join(self.joints) or 'none'}")
        placed = self.joints[name]
        return placed.read(self.placement(placed.joint.body), self.placement(placed.joint.parent))

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

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """Positions, quaternions, linear and angular velocities."""
        return self.positions, self.quaternions, self.linear_velocities, self.angular_velocities

    def __getitem__(self, index: int) -> State:
        """One world (or time) of many."""
        return State(self.names, *(array[index] for array in self.arrays), places=self.places, joints=self.joints)

    @staticmethod
    def stack(states: Sequence[State]) -> State:
        """Combine states of one layout into one with a new leading axis.

        Raises:
            ValueError: there are no states, or their bodies differ.
        """
        if not states or any(state.names != states[0].names for state in states):
            raise ValueError("only states of the same bodies can be stacked, and at least one is needed")
        arrays = map(np.stack, zip(*(state.arrays for state in states), strict=True))
        return State(states[0].names, *arrays, places=states[0].places, joints=states[0].joints)
