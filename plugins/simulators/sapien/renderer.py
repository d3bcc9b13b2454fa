"""Draw with SAPIEN's own renderer, which needs Vulkan, in a scene that holds visual shapes and no physics."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.errors import NoPicture
from core.geometry import Array, Box, Pose, Shape, Sphere
from core.interfaces import Image, Task
from core.scene import Camera, Color, Geom, State
from core.simulation.rendering import Renderer, joint_positions
from plugins.simulators.sapien.description import PlacedShape, place, robot_links
from plugins.simulators.sapien.engine import sapien
from plugins.simulators.sapien.shapes import to_sapien

_GAMMA = 2.2
_NEAR_M, _FAR_M = 0.02, 10.0


class SapienRenderer(Renderer):
    """Draw with Vulkan.

    Raises:
        NoPicture: there is none here.
    """

    def __init__(self) -> None:
        try:
            device = sapien.render.RenderSystem().device.name
        except RuntimeError as error:
            raise NoPicture(f"SAPIEN's own renderer needs Vulkan ({error})") from error
        self.name = f"SAPIEN's renderer on {device}"

    def load(self, task: Task, seed: int, tool: Tool | None) -> None:
        self._scene = sapien.Scene([sapien.render.RenderSystem()])
        self._scene.set_ambient_light([0.35] * 3)
        self._scene.add_directional_light([-1.0, 1.0, -2.0], [1.8] * 3, shadow=True, shadow_scale=2.0)
        self._cameras: dict[tuple[int, int, bool], Any] = {}
        robot = task.robot
        self._robot, self._tool = robot, tool if tool is not None else Tool(gripper=robot.gripper is not None)
        self._links = robot_links(robot, self._tool)
        self._entities = [self._add(link.visuals, Pose()) for link in self._links]
        self._bodies = {body.name: self._add(body.visuals, body.pose) for body in task.scene(seed).bodies}

    def _add(self, visuals: Iterable[PlacedShape | Geom], pose: Pose) -> Any:
        component = sapien.render.RenderBodyComponent()
        for part in visuals:
            drawn = _drawn(part.shape, part.color)
            drawn.local_pose = to_sapien(part.pose)
            component.attach(drawn)
        entity = sapien.Entity()
        entity.add_component(component)
        entity.pose = to_sapien(pose)
        self._scene.add_entity(entity)
        return entity

    def pose(self, arm: Array, fingers: Array, state: State) -> None:
        joints = joint_positions(self._robot, self._tool, arm, fingers)
        for entity, pose in zip(self._entities, place(self._links, joints), strict=True):
            entity.pose = to_sapien(pose)
        for name in state.names:
            self._bodies[name].pose = to_sapien(state.pose(name))

    def shoot(self, camera: Camera, width: int, height: int) -> Image:
        kind = width, height, camera.height_m is None  # a camera can't change its projection
        if kind not in self._cameras:
            self._cameras[kind] = self._scene.add_camera("camera", width, height, 1.0, _NEAR_M, _FAR_M)
        shot = self._cameras[kind]
        if camera.height_m is None:
            shot.set_fovy(np.radians(camera.fov_deg), compute_x=True)
        else:
            top, right = camera.height_m / 2, camera.height_m / 2 * width / height
            shot.set_orthographic_parameters(_NEAR_M, _FAR_M, -right, right, -top, top)
        shot.entity.pose = to_sapien(_look(camera))
        self._scene.update_render()
        shot.take_picture()
        shown = np.asarray(shot.get_picture("Color"))
        shown = np.where(shown[..., 3:] > 0, shown[..., :3], 1.0)  # white where nothing is
        picture: Image = np.clip(255 * shown, 0, 255).astype(np.uint8)
        return picture


def _look(camera: Camera) -> Pose:
    """Compute a camera's pose: it looks along its x axis, z up."""
    right, up, forward = camera.axes
    axes = np.stack([forward, -right, up], axis=1)
    return Pose.from_rotation(camera.position, Rotation.from_matrix(axes))


def _drawn(shape: Shape | Path, color: Color) -> Any:
    if isinstance(shape, Path):
        return sapien.render.RenderShapeTriangleMesh(str(shape))
    red, green, blue, opacity = color
    linear = [red**_GAMMA, green**_GAMMA, blue**_GAMMA, opacity]  # the renderer converts to sRGB at the end
    material = sapien.render.RenderMaterial(base_color=linear, roughness=0.6, specular=0.3)
    if isinstance(shape, Box):
        return sapien.render.RenderShapeBox(np.array(shape.size) / 2, material)
    if isinstance(shape, Sphere):
        return sapien.render.RenderShapeSphere(shape.radius, material)
    smooth = trimesh.graph.smooth_shade(shape.to_trimesh(), angle=np.radians(30.0))
    flat = np.zeros((len(smooth.vertices), 2))
    return sapien.render.RenderShapeTriangleMesh(smooth.vertices, smooth.faces, smooth.vertex_normals, flat, material)
