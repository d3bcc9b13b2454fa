"""Draw with PyBullet's software renderer, in a world that holds visual shapes and no physics."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from core.design import Tool
from core.geometry import Box, Pose
from core.interfaces import Image, Task
from core.scene import Camera, Geom, State
from plugins.simulators.pybullet.engine import Client, pybullet
from plugins.simulators.pybullet.robot import joint_numbers, load_robot, robot_file
from plugins.simulators.pybullet.urdf_links import facets_file
from plugins.simulators.rendering import Renderer

_NEAR_M = 0.02
_FAR_M = 10.0
_AWAY_M = 400.0  # so far, a metre in depth changes sizes by a quarter of a percent
_OUT_OF_SIGHT = [0.0, 0.0, -100.0]


class PyBulletRenderer(Renderer):
    """Draw with PyBullet's software renderer; files of meshes are written to ``folder``.

    Each visual shape is a body without mass, so that nothing moves by itself.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._client = Client()

    def load(self, task: Task, seed: int, tool: Tool) -> None:
        """See `Renderer.load`."""
        client = self._client
        client.resetSimulation()
        file = robot_file(self._folder, task.robot, tool, visuals=True)
        self._robot = load_robot(client, file)
        self._numbers, _ = joint_numbers(client, self._robot)
        self._parts: list[tuple[str, Pose, int]] = []
        self._clear: dict[int, float] = {}  # opacity of transparent parts
        scene = task.scene(seed).furnished(tool)
        self._softs = {soft.name: (soft, 0) for soft in scene.softs}

        for body in scene.bodies:
            if body.name in self._softs:
                continue

            for part in body.visuals:
                number = self._add(part)
                self._parts.append((body.name, part.pose, number))
                self._place(number, body.pose @ part.pose)
                if part.color[3] < 1:
                    self._clear[number] = part.color[3]

    def _add(self, part: Geom) -> int:
        """Add a shape, and return the number of its body."""
        look = {"rgbaColor": part.color, "specularColor": [0.1, 0.1, 0.1]}

        if isinstance(part.shape, Box):
            shape = self._client.createVisualShape(
                self._client.GEOM_BOX,
                halfExtents=[side / 2 for side in part.shape.size],
                **look,
            )
        else:  # PyBullet's own spheres have corners, and its cylinders no edges
            file = str(facets_file(part.shape, self._folder))
            shape = self._client.createVisualShape(
                self._client.GEOM_MESH, fileName=file, **look
            )

        return int(self._client.createMultiBody(0, -1, shape))

    def _place(self, number: int, pose: Pose) -> None:
        """Put the body of this number somewhere."""
        w, x, y, z = pose.quaternion
        self._client.resetBasePositionAndOrientation(
            number, pose.position.tolist(), [x, y, z, w]
        )

    def pose(self, joints: Mapping[str, float], state: State) -> None:
        """See `Renderer.pose`; soft bodies get the shapes of their nodes."""
        for name, value in joints.items():
            self._client.resetJointState(self._robot, self._numbers[name], value)

        for name, offset, number in self._parts:
            if name in state.names:
                self._place(number, state.pose(name) @ offset)

        for name, (soft, number) in self._softs.items():
            if number:
                self._client.removeBody(number)

            surface = soft.form.surface(state.nodes(name))
            part = Geom(surface, color=soft.visuals[0].color)
            self._softs[name] = (soft, self._add(part))

    def shoot(self, camera: Camera, width: int, height: int) -> Image:
        """See `Renderer.shoot`.

        The software renderer has no transparency. So the scene is drawn again without transparent parts, and blended in
        where they are nearest.
        """
        picture, numbers = self._draw(camera, width, height)
        if self._clear:
            client = self._client
            poses = {n: client.getBasePositionAndOrientation(n) for n in self._clear}
            for number in poses:
                self._client.resetBasePositionAndOrientation(
                    number, _OUT_OF_SIGHT, [0, 0, 0, 1]
                )

            behind, _ = self._draw(camera, width, height)
            for number, pose in poses.items():
                self._client.resetBasePositionAndOrientation(number, *pose)

            # By number; the last is the background's, -1.
            opacity = np.ones(max(numbers.max(), *self._clear) + 2)
            opacity[list(self._clear)] = list(self._clear.values())
            weight = opacity[numbers][..., None]
            picture = (weight * picture + (1 - weight) * behind).astype(np.uint8)

        return picture

    def _draw(
        self, camera: Camera, width: int, height: int
    ) -> tuple[Image, npt.NDArray[np.int64]]:
        """Draw a picture without transparency.

        Returns:
            the picture (height, width, 3), and for each pixel (height, width) the number of its body, or -1.
        """
        _, _, pixels, _, numbers = self._client.getCameraImage(
            width,
            height,
            *_matrices(camera, width / height),
            lightDirection=[1.0, -1.0, 2.0],
            lightDistance=4.0,  # nearer, the shadow map ends within the picture
            lightAmbientCoeff=0.55,
            lightDiffuseCoeff=0.5,
            lightSpecularCoeff=0.05,
            shadow=1,
            renderer=self._client.ER_TINY_RENDERER,
        )
        colors = np.asarray(pixels, dtype=np.uint8).reshape(height, width, 4)
        bodies = np.asarray(numbers, dtype=np.int64).reshape(height, width)
        return colors[..., :3], bodies


def _matrices(camera: Camera, aspect: float) -> tuple[list[float], list[float]]:
    """Compute the view matrix and the projection matrix, column by column.

    Args:
        camera: where it is, and what it looks at.
        aspect: the picture's width by its height.
    """
    _, up, forward = camera.axes
    target = np.asarray(camera.target)
    position = np.asarray(camera.position)

    fov_deg = camera.fov_deg
    near = _NEAR_M
    far = _FAR_M

    # The software renderer draws nothing in parallel projection: from far away instead.
    if camera.height_m is not None:
        position = position - _AWAY_M * forward
        distance = float(np.linalg.norm(target - position))
        fov_deg = 2 * float(np.degrees(np.arctan(camera.height_m / 2 / distance)))
        near = near + _AWAY_M
        far = far + _AWAY_M

    view: list[float] = pybullet.computeViewMatrix(
        position.tolist(), target.tolist(), up.tolist()
    )
    return view, pybullet.computeProjectionMatrixFOV(
        fov_deg,
        aspect,
        near,
        far,
    )
