"""Write a motion and a scene for ROS 2 and MoveIt: messages as YAML."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from core.geometry import Array, Box, Cylinder, Pose, Shape, Sphere
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
    """Write the scene, see `scene_message`.

    Raises:
        UserError: the file can't be written.
    """
    message = scene_message(robot, scene)
    text = yaml.safe_dump(message, sort_keys=False, default_flow_style=None, width=120)
    write_bytes(folder / "scene.yaml", text.encode())


def scene_message(robot: Robot, scene: Scene) -> dict[str, Any]:
    """Return the bodies of the scene, as they are at the start, as a ``moveit_msgs/msg/PlanningScene`` that adds them.

    Poses are in the frame of the arm's base.
    """
    header = {"frame_id": robot.description.root}
    objects = []
    for body in scene.bodies:
        pose = robot.base.inverse() @ body.pose
        entry: dict[str, Any] = {
            "id": body.name,
            "header": dict(header),
            "pose": _pose(pose),
        }
        for part in body.touched:
            kind, data = _shape(part.shape)
            poses = "mesh_poses" if kind == "meshes" else "primitive_poses"
            entry.setdefault(kind, []).append(data)
            entry.setdefault(poses, []).append(_pose(part.pose))

        objects.append(entry)

    return {
        "is_diff": True,
        "robot_state": {"is_diff": True},
        "world": {"collision_objects": objects},
    }


def _shape(shape: Shape) -> tuple[str, dict[str, Any]]:
    """Return a ``shape_msgs`` primitive or mesh, and the key of the message under which it stands."""
    if isinstance(shape, Box):
        return "primitives", {"type": 1, "dimensions": _rounded(np.array(shape.size))}
    if isinstance(shape, Sphere):
        return "primitives", {"type": 2, "dimensions": [shape.radius]}
    if isinstance(shape, Cylinder):
        return "primitives", {"type": 3, "dimensions": [shape.length, shape.radius]}

    mesh = shape.to_trimesh()
    triangles = [{"vertex_indices": face} for face in mesh.faces.tolist()]

    return "meshes", {
        "triangles": triangles,
        "vertices": [_point(vertex) for vertex in mesh.vertices],
    }


def _pose(pose: Pose) -> dict[str, Any]:
    w, x, y, z = _rounded(pose.quaternion)
    return {
        "position": _point(pose.position),
        "orientation": {"x": x, "y": y, "z": z, "w": w},
    }


def _point(position: Array) -> dict[str, float]:
    return dict(zip("xyz", _rounded(position), strict=True))


def _rounded(values: Array) -> list[float]:
    found: list[float] = np.round(values, 7).tolist()
    return found
