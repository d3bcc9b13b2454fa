"""Write a motion, a tool and a scene for ROS 2 and MoveIt: messages as YAML, and a small package."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from lxml import etree

from core.design import RIGID_MOUNT, Tool
from core.geometry import Array, Box, Cylinder, Pose, Shape, Sphere
from core.robot.description import tool_urdf
from core.scene import Scene, Soft
from core.support.cli import write_bytes
from core.values.robots import Robot
from plugins.results.artifacts import copied
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.texts import text_of

PACKAGE = "vlmgineer_tool"  # as in the templates, too
PREFIX = "prefix:=tool_"  # of its links and joints, so that no name meets one of the arm
_EVERY_S = 0.01  # between two points: a controller joins them by splines of fifth degree


def write_package(robot: Robot, tool: Tool, motion: Sampled, scene: Scene, folder: Path) -> None:
    """Write a package: the tool as a xacro macro, the motion and the scene as messages, a launch file.

    Raises:
        UserError: a file can't be written.
    """
    for name, text in {
        "package.xml": text_of("package.xml"),
        "CMakeLists.txt": text_of("CMakeLists.txt"),
        "launch/scene.launch.py": text_of("scene.launch.py.txt"),
        "config/trajectory.yaml": _yaml(trajectory_message(robot, motion)),
        "config/scene.yaml": _yaml(scene_message(robot, scene)),
        "urdf/tool.urdf.xacro": tool_macro(tool, folder / "urdf"),
    }.items():
        write_bytes(folder / name, text.encode())


def _yaml(message: dict[str, Any]) -> str:
    return str(yaml.safe_dump(message, sort_keys=False, default_flow_style=None, width=120))


def trajectory_message(robot: Robot, motion: Sampled) -> dict[str, Any]:
    """Return the motion as a ``trajectory_msgs/msg/JointTrajectory``, with a point every 10 ms and at its end."""
    points = []
    for k in motion.every(_EVERY_S):
        seconds = float(motion.times[k])
        points.append(
            {
                "positions": _rounded(motion.positions[k]),
                "velocities": _rounded(motion.velocities[k]),
                "accelerations": _rounded(motion.accelerations[k]),
                "effort": [],
                "time_from_start": {"sec": math.floor(seconds), "nanosec": round(seconds % 1 * 1e9)},
            }
        )
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {"header": header, "joint_names": list(robot.arm_joints), "points": points}


def scene_message(robot: Robot, scene: Scene) -> dict[str, Any]:
    """Return the bodies of the scene, as they are at the start, as a ``moveit_msgs/msg/PlanningScene`` that adds them.

    Poses are in the frame of the arm's base.
    """
    base, objects = robot.description.root, []
    for body in scene.bodies:
        at = robot.base.inverse() @ body.pose
        entry: dict[str, Any] = {"id": body.name, "header": {"frame_id": base}, "pose": _pose(at)}
        for part in body.visuals if isinstance(body, Soft) else body.collisions:
            kind, data = _shape(part.shape)
            entry.setdefault(kind, []).append(data)
            entry.setdefault("mesh_poses" if kind == "meshes" else "primitive_poses", []).append(_pose(part.pose))
        objects.append(entry)
    return {"is_diff": True, "robot_state": {"is_diff": True}, "world": {"collision_objects": objects}}


def _shape(shape: Shape) -> tuple[str, dict[str, Any]]:
    """Return a ``shape_msgs`` primitive or mesh."""
    match shape:
        case Box(size):
            return "primitives", {"type": 1, "dimensions": _rounded(np.array(size))}
        case Sphere(radius):
            return "primitives", {"type": 2, "dimensions": [radius]}
        case Cylinder(radius, length):
            return "primitives", {"type": 3, "dimensions": [length, radius]}
    mesh = shape.to_trimesh()
    triangles = [{"vertex_indices": face} for face in mesh.faces.tolist()]
    return "meshes", {"triangles": triangles, "vertices": [_point(vertex) for vertex in mesh.vertices]}


def _pose(pose: Pose) -> dict[str, Any]:
    w, x, y, z = _rounded(pose.quaternion)
    return {"position": _point(pose.position), "orientation": {"x": x, "y": y, "z": z, "w": w}}


def _point(position: Array) -> dict[str, float]:
    return dict(zip("xyz", _rounded(position), strict=True))


def _rounded(values: Array) -> list[float]:
    found: list[float] = np.round(values, 7).tolist()
    return found


def tool_macro(tool: Tool, folder: Path) -> str:
    """Return the tool as a xacro macro of the links that bear it and a prefix; its meshes go to ``folder``."""
    mesh_path = partial(copied, folder=folder)
    text = tool_urdf(tool, mesh_path=lambda mesh: f"package://{PACKAGE}/urdf/{mesh_path(mesh)}")
    root = etree.fromstring(f"<tool>{text}</tool>")
    parameters = {mount: "mount" if mount == RIGID_MOUNT else mount for mount in tool.mounts}
    for element in root.iter("link", "joint", "parent", "child", "mimic"):
        key = {"link": "name", "joint": "name", "mimic": "joint"}.get(str(element.tag), "link")
        name = str(element.get(key))
        element.set(key, f"${{{parameters[name]}}}" if name in parameters else f"${{prefix}}{name}")
    for element in root:
        element.tail = None
    space = "http://www.ros.org/wiki/xacro"
    macro = etree.Element("robot", nsmap={"xacro": space}, name=PACKAGE)
    inner = etree.SubElement(macro, f"{{{space}}}macro", name="tool", params=" ".join([*parameters.values(), PREFIX]))
    inner.extend(list(root))
    etree.indent(macro, "  ")
    return '<?xml version="1.0"?>\n' + str(etree.tostring(macro, encoding="unicode")) + "\n"
