"""Write a motion and a scene for ROS 2 and MoveIt: messages as YAML."""

from __future__ import annotations

from pathlib import Path

from core.geometry import Box, Cylinder, Shape, Sphere
from core.scene import Scene
from core.support.cli import write_bytes
from core.support.templates import build_environment
from core.values.robots import Robot
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.texts import text_of

_EVERY_S = 0.01
"""Between two points: a controller joins them by splines of fifth degree."""


def write_trajectory(robot: Robot, motion: Sampled, folder: Path) -> None:
    """Write a ``trajectory_msgs/msg/JointTrajectory``, with a point every 10 ms.

    Raises:
        UserError: a file can't be written.
    """
    template = build_environment().from_string(text_of("trajectory.yaml.j2"))
    samples = motion.every(_EVERY_S)
    trajectory = template.render(robot=robot, motion=motion, samples=samples)
    write_bytes(folder / "trajectory.yaml", trajectory.encode())


def write_scene(robot: Robot, scene: Scene, folder: Path) -> None:
    """Write the bodies of a scene, as they are at the start, as a ``moveit_msgs/msg/PlanningScene`` that adds them.

    Poses are in the frame of the arm's base.

    Raises:
        UserError: the file can't be written.
    """
    objects = []
    for body in scene.bodies:
        primitives = []
        meshes = []
        for part in body.touched:
            known = _find_primitive(part.shape)
            if known is None:
                meshes.append((part.shape.to_trimesh(), part.pose))
            else:
                primitives.append((*known, part.pose))

        place = robot.base.inverse() @ body.pose
        objects.append((body.name, place, primitives, meshes))

    template = build_environment().from_string(text_of("scene.yaml.j2"))
    text = template.render(root=robot.description.root, objects=objects)
    write_bytes(folder / "scene.yaml", text.encode())


def _find_primitive(shape: Shape) -> tuple[int, list[float]] | None:
    """Return the type and the dimensions of a ``shape_msgs`` primitive; None: it is none."""
    if isinstance(shape, Box):
        return 1, list(shape.size)
    if isinstance(shape, Sphere):
        return 2, [shape.radius]
    if isinstance(shape, Cylinder):
        return 3, [shape.length, shape.radius]

    return None
