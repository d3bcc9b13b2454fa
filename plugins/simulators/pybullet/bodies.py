"""Prepare a scene for PyBullet, and read the states of its bodies."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from core.errors import UsageError
from core.geometry import Array, Pose
from core.scene import Scene, State
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.pybullet.mechanisms import Place
from plugins.simulators.pybullet.trees import prepare_trees

MAX_STEPS = 16  # that are taken in place of one in scenes with stiff joints


class PreparedScene:
    """A scene ready to be placed in one world after another; files go to ``folder``.

    PyBullet's frame of a body is that of its centre of mass, so states are converted.

    Attributes:
        scene: the scene.
        trees: all bodies, in the order in which they are placed.
        jointed: those of them that have joints.
        ranks: of the bodies in the scene, by name.
        launched: the bodies that get a velocity when the motion begins.
        gravity: m/s^2, along the world's axes.
        names: of the free bodies.
        offsets: of the free bodies, as `PreparedTree.offsets`.
    """

    def __init__(self, scene: Scene, folder: Path) -> None:
        self.scene = scene
        self.trees = prepare_trees(scene, folder)
        self.jointed = [tree for tree in self.trees if tree.joints]
        self.ranks = {body.name: rank for rank, body in enumerate(scene.bodies)}
        self.launched = [body for body in scene.free if body.launched]
        self.gravity = scene.gravity
        self.names = tuple(body.name for body in scene.free)
        self.offsets: dict[str, Pose] = {}
        for tree in self.trees:
            self.offsets |= tree.offsets

        # Of the free bodies whose frame is not at their centre of mass.
        offsets = [self.offsets[name] for name in self.names]
        self._shifted = [k for k, offset in enumerate(offsets) if offset != Pose()]
        shifted = [offsets[k] for k in self._shifted]
        self._positions = np.array([offset.position for offset in shifted])
        turns = [offset.rotation.as_quat() for offset in shifted]
        self._turns = np.reshape(turns, (-1, 4))  # x, y, z, w

    def count_steps(self, time_step: float) -> int:
        """Count the steps to take in place of one, for joints in a row and stiff ones.

        Raises:
            UsageError: a joint is far too stiff.
        """
        count = 1
        for tree in self.jointed:
            in_a_row = 2 if len(tree.dynamics) > 1 else 1
            count = max(count, in_a_row, ceil(tree.rate * time_step))

        if count > MAX_STEPS:
            most = MAX_STEPS / count * time_step
            raise UsageError(
                f"sim=pybullet needs {count} steps in place of one for the scene's stiffest joint, and takes at most "
                f"{MAX_STEPS}; lower its stiffness, damping or latch force, or set sim.time_step to {most:.2g} s"
            )

        return count

    def place(self, client: Client) -> dict[str, Place]:
        """Place the bodies in a world; return where they are, by name."""
        places: dict[str, Place] = {}
        for tree in self.trees:
            places |= tree.place(client, places)

        return places

    def read(self, snapshots: Sequence[tuple[float, ...]]) -> State:
        """Decode T snapshots of the free bodies.

        Each has 13 numbers a body: position, quaternion (x, y, z, w) and velocities of its centre of mass. A body whose
        frame is elsewhere gets the pose and the speed of that.
        """
        rows = np.reshape(snapshots, (len(snapshots), len(self.names), 13))
        positions = rows[..., :3].copy()
        quaternions = rows[..., [6, 3, 4, 5]]
        linear = rows[..., 7:10].copy()
        angular = rows[..., 10:].copy()

        shifted = self._shifted
        if shifted and np.isfinite(quaternions).all():
            centers = positions[:, shifted]
            frames, turns = self._find_frames(centers, quaternions[:, shifted])
            positions[:, shifted] = frames
            quaternions[:, shifted] = turns
            linear[:, shifted] += np.cross(angular[:, shifted], frames - centers)

        return State(
            self.names,
            positions,
            quaternions,
            linear,
            angular,
        )

    def _find_frames(self, centers: Array, quaternions: Array) -> tuple[Array, Array]:
        """Convert centres of mass to the frames of the bodies that are shifted against them.

        The result equals that of `Pose` to the last bit, in a tenth of the time.

        Args:
            centers: positions (T, K, 3), metres.
            quaternions: (T, K, 4).
        """
        units = _unit(quaternions.reshape(-1, 4))
        turns = Rotation.from_quat(units[:, [1, 2, 3, 0]])
        matrices = turns.as_matrix().reshape(*centers.shape, 3)
        positions = (matrices @ self._positions[:, :, None])[..., 0] + centers

        offsets = Rotation.from_quat(np.tile(self._turns, (len(centers), 1)))
        turned = (turns * offsets).as_quat()
        turned = _unit(turned[:, [3, 0, 1, 2]])
        return positions, turned.reshape(quaternions.shape)


def _unit(quaternions: Array) -> Array:
    """Normalise quaternions (K, 4)."""
    rows = np.ascontiguousarray(quaternions)
    squares = rows[:, None, :] @ rows[:, :, None]
    return rows / np.sqrt(squares)[:, 0]
