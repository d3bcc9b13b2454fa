"""Given tools: the bare gripper, that of a file, and four designed by hand for RLBench's tasks, as boxes.

Sizes and positions of the four approximate those of the paper's ablation. Handles extend to the mount's origin, so that
they touch the flange.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import OmegaConf
from scipy.spatial.transform import Rotation

from core.config.compose import part
from core.design import RIGID_MOUNT, Component, Tool
from core.designs.reading import load_tool
from core.errors import choices
from core.geometry import Box, Pose
from core.interfaces import GivenTools, Task
from core.plugins import TOOL

# Colours.
HANDLE = (0.72, 0.53, 0.34, 1.0)
HEAD = (0.85, 0.30, 0.20, 1.0)


class BareGripper(GivenTools):
    """The arm with its own gripper, or with nothing."""

    def given(self, task: Task) -> Tool:
        title = task.robot.title
        if task.robot.gripper is None:
            return Tool(
                name="bare flange",
                description=f"the flange of {title}, which has no gripper",
            )
        return Tool(
            gripper=True,
            name="bare gripper",
            description=f"the gripper of {title}, with its fingers",
        )


def _bar(
    name: str, far: tuple[float, float, float], thickness: tuple[float, float]
) -> Component:
    """Make a bar from the mount's origin, so that it touches the flange; its long axis is x.

    Args:
        name: of the bar.
        far: (3,) its other end, metres.
        thickness: its other two sides, metres.
    """
    end = np.array(far)
    slope = Rotation.from_euler("y", -np.arctan2(end[2], end[0]))
    size = (float(np.linalg.norm(end)), *thickness)
    return Component(
        name, RIGID_MOUNT, Pose.from_rotation(end / 2, slope), Box(size), color=HANDLE
    )


def _on(
    bar: Component,
    name: str,
    center: tuple[float, float, float],
    size: tuple[float, float, float],
) -> Component:
    """Make a child of a bar: a box along the mount's axes.

    Args:
        bar: what the box hangs from.
        name: of the box.
        center: (3,) in the mount's frame, metres.
        size: (3,) full side lengths, metres.
    """
    pose = bar.pose.inverse() @ Pose(np.array(center))
    return Component(name, bar.name, pose, Box(size), color=HEAD)


def stick() -> Tool:
    """Make a straight bar."""
    bar = _bar("stick", (0.379, 0.0, -0.189), (0.0128, 0.0128))
    return Tool(
        (bar,),
        name="stick",
        description="a bar 0.42 m long that slopes forward and down",
    )


def broom() -> Tool:
    """Make a handle with a wide head."""
    handle = _bar("handle", (0.2, 0.0, -0.38), (0.011, 0.011))
    head = _on(handle, "head", (0.2, 0.0, -0.38), (0.0375, 0.2625, 0.0375))
    return Tool(
        (handle, head), name="broom", description="a handle down to a head 0.26 m wide"
    )


def hockey_stick() -> Tool:
    """Make a handle with a blade in front of its end."""
    scale = 0.9  # so that it starts clear of the floor
    heel = (0.238 * scale, 0.0, -0.51 * scale)
    center = (0.313 * scale, 0.0, -0.51 * scale)
    handle = _bar("handle", heel, (0.021 * scale, 0.011 * scale))
    blade = _on(handle, "blade", center, (0.15 * scale, 0.011 * scale, 0.04 * scale))
    return Tool(
        (handle, blade),
        name="hockey stick",
        description="a handle down to a blade 0.135 m long",
    )


def spatula() -> Tool:
    """Make a flat head lower than its handle."""
    handle_pose = Pose(np.array([0.05, 0.0, -0.0025]))
    handle = Component(
        "handle", RIGID_MOUNT, handle_pose, Box((0.10, 0.02, 0.005)), color=HANDLE
    )
    neck_pose = Pose.xyz_rpy((0.095, 0.0, -0.03), (0.0, 1.2, 0.0))
    neck = Component(
        "neck",
        "handle",
        handle.pose.inverse() @ neck_pose,
        Box((0.062, 0.02, 0.005)),
        color=HANDLE,
    )
    head_pose = neck_pose.inverse() @ Pose(np.array([0.2, 0.0, -0.0575]))
    head = Component("head", "neck", head_pose, Box((0.22, 0.22, 0.005)), color=HEAD)
    return Tool(
        (handle, neck, head),
        name="spatula",
        description="a flat head 0.22 m square, lower than its handle",
    )


TOOLS: dict[str, Callable[[], Tool]] = {
    "BringCube": stick,
    "CleanTable": broom,
    "ScoreGoal": hockey_stick,
    "GatherSpheres": spatula,
}


class RLBenchTools(GivenTools):
    """One tool for each of four tasks."""

    def given(self, task: Task) -> Tool:
        if task.name not in TOOLS:
            raise choices("given tool for task", task.name, TOOLS, "tool=rlbench")
        return TOOLS[task.name]()


class KnownTools(GivenTools):
    """The tool of a designs file, for which plans alone are designed.

    Args:
        file: the designs file, of which the first design counts.
        of: the representation in which the tool is written: a name, or a mapping of a ``name`` and settings.
    """

    def __init__(self, file: str, of: str | dict[str, Any] = "urdf") -> None:
        self._file = Path(file)
        self._of = of
        self._tool: Tool | None = None

    def given(self, task: Task) -> Tool:
        if self._tool is None:
            settings = self._of
            if isinstance(settings, str):
                settings = {"name": settings}
            tool = part(TOOL, OmegaConf.create(settings))
            form = replace(tool, material=self.material).create(robot=self.robot)
            self._tool = load_tool(self._file, 0, form, task)
        return self._tool
