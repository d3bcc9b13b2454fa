"""Make round and hinged tools of boxes, for measurements: bars become rods, and the head hangs on a joint."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from core.design import Candidate, Component, Tool, ToolJoint
from core.designs.rules import SpawnRules, check_tool
from core.designs.tool_joints import moved
from core.errors import UserError
from core.geometry import Box, Cylinder, Pose

_HEAVY_KG = 0.02  # each component: what a joint moves needs some weight
_HZ = 4.0  # of a sprung head, on its own
_ALONG = ((0.0, np.pi / 2, 0.0), (np.pi / 2, 0.0, 0.0), (0.0, 0.0, 0.0))  # turns z to the x, y or z axis


def loosened(candidates: tuple[Candidate, ...], spawn: SpawnRules, seed: int) -> tuple[Candidate, ...]:
    """Return those candidates whose tool may be made round and loose; a third each on a spring, on a hinge that yields
    to one side only, and on a slider.

    Raises:
        UserError: there is none.
    """
    rng, changed, found = np.random.default_rng(seed), dict[str, Tool | None](), []
    for candidate in candidates:
        tool = candidate.tool
        if tool is None or tool.gripper:
            continue
        if tool.content not in changed:
            changed[tool.content] = _allowed(_hung(_heavy(rods(tool)), int(rng.integers(3))), spawn)
        if (other := changed[tool.content]) is not None:
            found.append(replace(candidate, tool=other))
    if not found:
        raise UserError("no design may be made loose")
    return tuple(found)


def rods(tool: Tool) -> Tool:
    """Replace the square bars of a tool by round ones that fill them."""
    components, turns = [], {mount: Pose() for mount in tool.mounts}
    for component in tool.components:
        pose, shape, turn = turns[component.parent].inverse() @ component.pose, component.shape, Pose()
        if isinstance(shape, Box):
            axis = int(np.argmax(shape.size))
            one, other = np.delete(shape.size, axis)
            if abs(one - other) <= 1e-6 and shape.size[axis] > 2 * one:
                turn = Pose.xyz_rpy((0.0, 0.0, 0.0), _ALONG[axis])
                shape = Cylinder(float(one) / 2, float(shape.size[axis]))
        turns[component.name] = turn
        components.append(replace(component, pose=pose @ turn, shape=shape))
    return replace(tool, components=tuple(components))


def _allowed(tool: Tool | None, spawn: SpawnRules) -> Tool | None:
    try:
        if tool is not None:
            check_tool(tool, spawn.robot)
            spawn.check(tool)
    except ValueError:
        return None
    return tool


def _heavy(tool: Tool) -> Tool:
    return replace(tool, components=tuple(replace(c, mass=_HEAVY_KG) for c in tool.components))


def _hung(tool: Tool, kind: int) -> Tool | None:
    """Hang the first component that is no rod, and bears no rod, on a joint at its upper end."""
    rods = {c.name for c in tool.components if isinstance(c.shape, Cylinder)}
    bearing = {c.parent for c in tool.components if c.name in rods}
    heads = [c for c in tool.components if c.name not in rods | bearing and c.parent not in tool.mounts]
    if not heads:
        return None
    head, pose = heads[0], tool.placed()[heads[0].name][1]
    up = pose.rotation.as_matrix().T @ np.array([0.0, 0.0, 1.0])
    along = int(np.argmax(np.abs(up)))
    across = np.eye(3)[int(np.argmin(head.shape.bounds[1] + 10.0 * np.eye(3)[along]))]  # thin: it turns about the other
    axis, origin = np.cross(np.eye(3)[along], across), np.sign(up[along]) * np.eye(3)[along] * head.shape.bounds[1] / 2
    joint = _joint(kind, tuple(axis), tuple(across), tuple(origin))
    hung = _with(tool, replace(head, joint=joint))
    if kind != 1:
        _, inertia = moved(hung, hung.bearers[0])
        stiffness = inertia * (2 * math.pi * _HZ) ** 2
        damping = 0.5 * math.sqrt(stiffness * inertia)
        hung = _with(tool, replace(head, joint=replace(joint, stiffness=stiffness, damping=damping)))
    return hung


def _joint(kind: int, axis: tuple[float, ...], across: tuple[float, ...], origin: tuple[float, ...]) -> ToolJoint:
    (ax, ay, az), (bx, by, bz), (x, y, z) = axis, across, origin
    if kind == 2:
        return ToolJoint("slider", (bx, by, bz), -0.02, 0.02)
    lower, upper = (-0.6, 0.6) if kind == 0 else (0.0, 1.2)
    return ToolJoint("hinge", (ax, ay, az), lower, upper, (x, y, z), friction=0.0 if kind == 0 else 0.005)


def _with(tool: Tool, component: Component) -> Tool:
    return replace(tool, components=tuple(component if c.name == component.name else c for c in tool.components))
