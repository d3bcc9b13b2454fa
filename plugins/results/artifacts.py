"""Write a design as files to use elsewhere: the tool to print, the motion to run, the robot with the tool."""

from __future__ import annotations

import csv
import filecmp
import json
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import trimesh

from core.design import GRIPPER_MOUNTS, Candidate, Tool
from core.designs.reading import dump_design
from core.interfaces import Motion, ToolRepresentation
from core.robot.description import assemble, tool_urdf
from core.support.templates import fill
from core.values.robots import Robot
from plugins.results.workshop.body import bodies
from plugins.results.workshop.solid import to_mesh

POSE_COLUMNS = ("x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad", "gripper")


def save_files(tool: Tool, robot: Robot, motion: Motion, folder: Path) -> None:
    """Write ``tool.urdf``, ``tool.stl``, ``robot.urdf`` with their meshes, to a folder that is there.

    Of a fixture there is ``fixture.stl``, in its own frame.
    ``waypoints.csv`` has the waypoints of ``motion`` and when each is reached.
    """
    poses = motion.plan

    with (folder / "waypoints.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*POSE_COLUMNS[: poses.shape[1]], "arrival_s"])
        writer.writerows(np.column_stack([poses, motion.arrivals.round(4)]).tolist())

    local = partial(copied, folder=folder)
    parts = tool_urdf(tool, mesh_path=local)
    urdf = fill("plugins.results", "tool", mounts=tool.mounts, parts=parts) + "\n"
    (folder / "tool.urdf").write_text(urdf, encoding="utf-8")
    with_tool = assemble(robot, tool, mesh_path=local)
    (folder / "robot.urdf").write_text(with_tool, encoding="utf-8")
    tool_mesh(tool, robot.opening_m).export(folder / "tool.stl")
    if tool.fixture is not None:
        tool_mesh(tool.fixture.parts, 0.0).export(folder / "fixture.stl")


def save_design(
    candidate: Candidate, representation: ToolRepresentation, folder: Path
) -> None:
    """Write ``design.json``, a designs file with one candidate, which `core.designs.reading.load_designs` reads.

    Args:
        candidate: has a tool.
        representation: writes the tool.
        folder: where the file is written; made if it is not there.

    Raises:
        ValueError: the candidate has no tool.
    """
    folder.mkdir(parents=True, exist_ok=True)
    designs = [dump_design(candidate, representation)]
    text = json.dumps({"strategies": designs}, indent=2) + "\n"
    (folder / "design.json").write_text(text, encoding="utf-8")


def copied(mesh: Path, folder: Path) -> str:
    """Copy a mesh to ``meshes/`` in ``folder``, and return its relative path.

    Where beside a folder ``visual`` there is the small collision mesh of the same link, that is copied instead. Of two
    different meshes of one name the second gets a number.
    """
    small = mesh.parents[1] / "collision" / f"{mesh.stem}.stl"
    if not small.exists():
        small = mesh

    copy = folder / "meshes" / small.name
    copy.parent.mkdir(parents=True, exist_ok=True)
    number = 1
    while copy.exists() and not filecmp.cmp(small, copy, shallow=False):
        number += 1
        copy = copy.with_name(f"{small.stem}_{number}{small.suffix}")

    if not copy.exists():
        shutil.copy(small, copy)

    return f"meshes/{copy.name}"


def tool_mesh(tool: Tool, opening_m: float) -> trimesh.Trimesh:
    """Make each rigid link one closed body, in millimetres, as slicers expect, in the frame of the mount.

    With two mounts, the attachments lie apart as on a gripper with each finger open by ``opening_m`` metres.
    """
    left, right = GRIPPER_MOUNTS
    apart_mm = {left: 1000 * opening_m, right: -1000 * opening_m}
    meshes = []
    for body in bodies(tool):
        mesh = to_mesh(body.mount.solid)
        shift = (0.0, apart_mm.get(body.link.mount, 0.0), 0.0)
        meshes.append(mesh.apply_translation(shift))

    if not meshes:
        return trimesh.Trimesh()

    return trimesh.util.concatenate(meshes)
