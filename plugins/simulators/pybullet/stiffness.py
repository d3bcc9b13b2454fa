"""Compute how light a joint is, by which springs and dampers stay stable."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from core.geometry import Array, Pose
from core.scene import Body, Inertia, Joint

_MILD = 0.5  # of a joint's speed: what a damper may take of it in a step


@dataclass(frozen=True, eq=False)
class Lightness:
    """What forces of 1 at the joints of a tree accelerate, as it starts.

    ``matrix`` (K, K) is the inverse of the inertia, 1/kg or 1/(kg m^2). ``axes`` has the rows of each joint by name:
    one, and a ball's three, about its body's axes.
    """

    matrix: Array
    axes: dict[str, list[int]]

    @classmethod
    def of(cls, bodies: Mapping[str, Body], joints: Sequence[Joint], inertias: Mapping[str, Inertia]) -> Lightness:
        """Compute it for ``bodies`` and their ``inertias``, with a parent's own joint before those on it."""
        twists, above = list[Array](), {name: list[int]() for name in bodies}
        for name in bodies.keys() - {joint.body for joint in joints}:  # a free root
            above[name] = list(range(6))
            twists += [*np.eye(6)]
        first, axes = len(twists), dict[str, list[int]]()
        for joint in joints:
            own = _twists(joint, bodies[joint.body].pose)
            rows = list(range(len(twists), len(twists) + len(own)))
            above[joint.body] = [*above.get(joint.parent or "", []), *rows]
            axes[joint.name] = [row - first for row in rows]
            twists += own
        masses = np.zeros((len(twists), len(twists)))
        for name, body in bodies.items():
            frame, moving = body.pose @ inertias[name].frame, np.array([twists[row] for row in above[name]])
            moved = moving[:, 3:] + np.cross(moving[:, :3], frame.position)
            turned = moving[:, :3] @ frame.rotation.as_matrix()
            own_mass = body.mass * moved @ moved.T + turned * inertias[name].moments @ turned.T
            masses[np.ix_(above[name], above[name])] += own_mass
        return cls(np.asarray(np.linalg.inv(masses), dtype=np.float64)[first:, first:], axes)

    def most(self, joint: Joint) -> float:
        """The most that a force of 1 at a joint accelerates."""
        rows = self.axes[joint.name]
        return float(np.linalg.eigvalsh(self.matrix[np.ix_(rows, rows)])[-1])

    def rate(self, joint: Joint) -> float:
        """The highest rate, 1/s, at which its spring and latches swing a joint, or its damper stops it."""
        stiffness = joint.stiffness + max((math.pi * a.force / a.width for a in joint.latches), default=0.0)
        most = self.most(joint)
        return max(math.sqrt(stiffness * most), joint.damping * most / _MILD)


def _twists(joint: Joint, pose: Pose) -> list[Array]:
    """The directions in which a joint moves its body: angular velocities, and velocities at the world's origin."""
    if joint.kind == "slider":
        return [np.concatenate([np.zeros(3), pose.rotation.apply(joint.axis)])]
    axes = [pose.rotation.apply(joint.axis)] if joint.kind == "hinge" else [*pose.rotation.apply(np.eye(3))]
    origin = pose.apply(joint.origin)
    return [np.concatenate([axis, np.cross(origin, axis)]) for axis in axes]
