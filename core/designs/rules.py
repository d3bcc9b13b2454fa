"""Rules for designs of every representation: limits of tools and plans, and a start that is clear of everything."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from core.design import RIGID_MOUNT, Component, DesignError, Tool
from core.designs.statics import MAX_GAP_M, Beams, check_joints, check_weight, corners
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import Robot, Task, ToolRepresentation
from core.plugins import describe_part
from core.robot.solids import (
    Solid,
    closest,
    robot_solids,
    solid_geometry,
    solids_of,
)
from core.support.text import shorten
from core.values.materials import PAPER, Material

MAX_COMPONENTS = 100
MIN_SIDE_M = 0.0005
MAX_SIDE_M = 2.0
MAX_EXTENT_M = 2.0  # from the mount to the farthest point, which bounds the speed of a tool's tip too
MIN_COMPONENT_KG = 1e-6  # small boxes of a link have small shares of its mass
MAX_COMPONENT_KG = 1.0
MIN_TOOL_KG = 0.001
MIN_DENSITY = (
    1.0  # kg/m^3, about that of air; the paper's 5 g must do for a box of a few litres
)
MAX_DENSITY = 20_000.0  # kg/m^3; gold and tungsten have 19,300
MAX_BEND_M_N = 0.01  # of the farthest end, per newton
MAX_LOAD_N = 10.0  # at any end, that a real material must bear
MAX_MOUNT_GAP_M = 0.002


NAME = re.compile(
    r"[A-Za-z0-9_.-]{1,64}"
)  # prompts, messages and robot descriptions hold it as it is


def check_tool(tool: Tool, robot: Robot, material: Material = PAPER) -> None:
    """Check that an arm can bear a tool of ``material``, with the masses that it has.

    Checked are number, sizes, masses and extent of its components, contacts, stiffness, and of a real material the
    moment about the mount and strength.

    Raises:
        DesignError: the first rule that is broken.
    """
    if tool.gripper and robot.gripper is None:
        raise DesignError(
            f"{robot.title} has no gripper; design one rigid tool, with 'gripper' false"
        )
    if not tool.components:
        raise DesignError(
            f"the tool has no components; hang at least one from {' or '.join(tool.mounts)}"
        )
    if len(tool.components) > MAX_COMPONENTS:
        raise DesignError(
            f"the tool has {len(tool.components)} components; at most {MAX_COMPONENTS} are allowed"
        )
    for component in tool.components:
        _check_component(component)
        if material.density_kg_m3 is None:
            _check_mass(component)
    check_weight(tool, robot, material)
    if tool.mass < MIN_TOOL_KG:
        raise DesignError(
            f"the tool weighs {tool.mass:.3g} kg; at least {MIN_TOOL_KG:g} kg is needed"
        )
    _check_extent(tool)
    joints = check_contacts(tool, robot)
    check_joints(tool, material, mount_solids(tool, robot))
    _check_stiffness(tool, joints, material)


def _check_component(component: Component) -> None:
    if not NAME.fullmatch(component.name):
        raise DesignError(
            f"component name {shorten(component.name)} is not 1 to 64 letters, digits, '_', '.' or '-'"
        )
    for axis, side in zip("xyz", component.shape.bounds[1].tolist(), strict=True):
        if not MIN_SIDE_M <= side <= MAX_SIDE_M:
            raise DesignError(
                f"component {component.name!r} is {side:.6g} m long in {axis}; each side must be between "
                f"{MIN_SIDE_M:g} and {MAX_SIDE_M:g} m"
            )


def _check_mass(component: Component) -> None:
    if not MIN_COMPONENT_KG <= component.mass <= MAX_COMPONENT_KG:
        raise DesignError(
            f"component {component.name!r} weighs {component.mass:.6g} kg; it must be between {MIN_COMPONENT_KG:g} "
            f"and {MAX_COMPONENT_KG:g} kg (a few grams are enough)"
        )
    density = component.mass / component.shape.volume
    if not MIN_DENSITY <= density <= MAX_DENSITY:
        fault = (
            "is lighter than air" if density < MIN_DENSITY else "is denser than gold"
        )
        raise DesignError(
            f"component {component.name!r} {fault}: {component.mass:.3g} kg in {component.shape.volume:.3g} m^3 is a "
            f"density of {density:.3g} kg/m^3; it must be between {MIN_DENSITY:g} and {MAX_DENSITY:g}"
        )


def _check_extent(tool: Tool) -> None:
    placed = tool.placed()
    for component in tool.components:
        mount, pose = placed[component.name]
        reach = float(np.linalg.norm(corners(component.shape, pose), axis=1).max())
        if reach > MAX_EXTENT_M:
            raise DesignError(
                f"component {component.name!r} reaches {reach:.3g} m from {mount}; a tool must end within "
                f"{MAX_EXTENT_M:g} m of its mount"
            )


def mount_solids(tool: Tool, robot: Robot) -> dict[str, list[Solid]]:
    """Build the solids of what a tool hangs from, the flange or the fingers, each in its own frame."""
    if not tool.gripper:
        return {
            RIGID_MOUNT: [Solid(RIGID_MOUNT, solid_geometry(robot.flange.disc), Pose())]
        }
    return {
        mount: [solid for solid in robot_solids(robot, True) if solid.name == mount]
        for mount in tool.mounts
    }


def check_contacts(tool: Tool, robot: Robot) -> dict[str, Array]:
    """Check that each component touches its parent; return the points where they do, in the mount's frame."""
    solids = mount_solids(tool, robot)
    for c in tool.components:
        solids[c.name] = solids_of(c.name, c.shape, Pose())
    placed, points = tool.placed(), {}
    for component in tool.components:
        on_mount = component.parent in tool.mounts
        own = [replace(solid, pose=component.pose) for solid in solids[component.name]]
        gap, point = closest(own, solids[component.parent])
        if gap > (MAX_MOUNT_GAP_M if on_mount else MAX_GAP_M):
            relation = "mount" if on_mount else "parent"
            raise DesignError(
                f"component {component.name!r} is {gap * 1000:.1f} mm away from its {relation} {component.parent!r}; "
                "move or lengthen it until they touch"
            )
        points[component.name] = (
            point if on_mount else placed[component.parent][1].apply(point)
        )
    return points


def _check_stiffness(tool: Tool, joints: dict[str, Array], material: Material) -> None:
    of = "even of steel" if material.density_kg_m3 is None else f"of {material.name}"
    most = material.strength_pa
    for name, (bend, stress) in Beams(tool, joints, material).bending().items():
        if bend > MAX_BEND_M_N:
            raise DesignError(
                f"component {name!r} is not rigid: {of}, 1 N would bend it by {1000 * bend:.3g} mm, from the "
                f"mount to its end; at most {1000 * MAX_BEND_M_N:g} mm are allowed: shorten or thicken what carries it"
            )
        if most is not None and MAX_LOAD_N * stress > most:
            raise DesignError(
                f"component {name!r} would break: {of}, {MAX_LOAD_N:g} N at its end mean a stress of "
                f"{MAX_LOAD_N * stress / 1e6:.3g} MPa in it or in what carries it; at most {most / 1e6:g} MPa are "
                "allowed: shorten or thicken both"
            )


def given_tool(representation: ToolRepresentation, task: Task) -> Tool | None:
    """The tool that a representation gives for a task; None: it gives none.

    Raises:
        UserError: it gives something else, or a tool that breaks a rule; the message names the plugin.
    """
    try:
        tool = representation.given(task)
        if isinstance(tool, Tool):
            tool = representation.material.made(tool)
            if tool.components:
                check_tool(tool, task.robot, representation.material)
    except DesignError as error:
        what = f"the tool that it gives for {task.name} breaks a rule"
        raise UserError(f"{describe_part(representation)}: {what}: {error}") from error
    if tool is not None and not isinstance(tool, Tool):
        wrong = shorten(repr(tool))
        raise UserError(
            f"{describe_part(representation)}: given returned {wrong}; expected a Tool or None"
        )
    return tool
