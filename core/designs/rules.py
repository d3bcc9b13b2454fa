"""Rules for designs of every representation: limits of tools and plans, and a start that is clear of everything."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import numpy as np

from core.design import RIGID_MOUNT, Component, DesignError, Tool
from core.designs.statics import check_weight
from core.errors import Reason, UserError
from core.geometry import Array, Pose, Sphere
from core.interfaces import Robot, Task, ToolRepresentation
from core.plugins import describe_part, installed
from core.plugins.blame import judge_design
from core.robot.solids import (
    Solid,
    closest,
    robot_solids,
    solid_geometry,
    solids_of,
)
from core.support.text import short_numbers, shorten
from core.values.materials import PAPER, Material
from core.values.refusals import DesignReason

MAX_COMPONENTS = 100
"""The most components of a tool."""

_POINT_M = 1e-6  # the radius of a mount that nothing can touch
MIN_SIDE_M = 0.0005
"""The shortest side of a component's bounds."""

MAX_SIDE_M = 2.0
"""The longest side of a component's bounds."""

MAX_EXTENT_M = 2.0
"""The most from the mount to the farthest point, which bounds the speed of a tool's tip too."""

MIN_COMPONENT_KG = 1e-6
"""The least mass of a component: small boxes of a link have small shares of its mass."""

MAX_COMPONENT_KG = 1.0
"""The largest mass of a component."""

MIN_TOOL_KG = 0.001
"""The least mass of a tool."""

MIN_DENSITY = 1.0
"""About that of air, kg/m^3; the paper's 5 g must do for a box of a few litres."""

MAX_DENSITY = 20_000.0
"""More than that of gold and tungsten, which have 19,300 kg/m^3."""

MAX_BEND_M_N = 0.01
"""How far the farthest end may bend, per newton."""

MAX_LOAD_N = 10.0
"""The force at any end that a real material must bear."""

MAX_GAP_M = 0.001
"""The largest gap between a component and its parent."""

MAX_MOUNT_GAP_M = 0.002
"""The largest gap between a component and the mount that it hangs from."""

MAX_FAULTS = 10
"""The most faults of a tool that are named at once."""

NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")
"""What a component may be called: prompts, messages and robot descriptions hold a name as it is."""

ToolRule = Callable[[Tool, Robot, Material], None]
"""Refuses a tool for an arm, of a material, by a `DesignError` that says what is wrong, where, and how to mend it."""


def check_tool(tool: Tool, robot: Robot, material: Material = PAPER) -> None:
    """Check that an arm can bear a tool of ``material``, with the masses that it has.

    Checked are number, sizes, masses and extent of its components, contacts, and of a real material the moment about
    the mount. Then follow the rules that plugins offer (`ToolRule`).

    Raises:
        DesignError: all rules that are broken, as far as they can be checked together.
    """
    if tool.gripper:
        check_gripper(robot)
    if not tool.components:
        mounts = " or ".join(tool.mounts)
        raise DesignError.because(DesignReason.NO_COMPONENTS, mounts=mounts)

    _check_components(tool, material)
    faults = Faults()
    if tool.fixture is not None:
        with faults.collect("fixture: "):
            _check_components(tool.fixture.parts, material)
            check_contacts(tool.fixture.parts, None)
    with faults.collect():
        check_weight(tool, robot, material)
        _check_tool_mass(tool)
    with faults.collect():
        _check_extent(tool)
    with faults.collect():
        check_contacts(tool, robot)
    faults.refuse()

    plugins = installed()
    for name, rule in plugins.factories("tool_rule").items():
        with faults.collect():
            owner = plugins.offers["tool_rule", name].owner
            judge_design(owner, rule, tool, robot, material)
    faults.refuse()


def _check_components(tool: Tool, material: Material) -> None:
    """Check the number of components, and each by itself."""
    count = len(tool.components)
    if count > MAX_COMPONENTS:
        raise DesignError.because(DesignReason.COUNT, count=count, most=MAX_COMPONENTS)

    faults = Faults()
    for component in tool.components:
        with faults.collect():
            _check_component(component)
            if material.density_kg_m3 is None:
                _check_mass(component)
    faults.refuse()


class Faults(list[DesignError]):
    """The faults of one design, of which all are named at once."""

    @contextmanager
    def collect(self, where: str = "") -> Iterator[None]:
        """Go on after a fault, and keep it; ``where`` stands before it."""
        try:
            yield
        except DesignError as error:
            self.append(error.placed(where))

    def add(self, reason: Reason, **values: Any) -> None:
        """Keep a fault for a reason of the catalogue."""
        self.append(DesignError.because(reason, **values))

    def refuse(self) -> None:
        """Raise DesignError if there are faults."""
        if self:
            whole = DesignError("; ".join(map(str, self[:MAX_FAULTS])))
            raise whole.coded(*(found for fault in self for found in fault.refusals))


def _check_tool_mass(tool: Tool) -> None:
    if tool.mass < MIN_TOOL_KG:
        raise DesignError.because(
            DesignReason.TOO_LIGHT, mass_kg=tool.mass, least_kg=MIN_TOOL_KG
        )


def check_gripper(robot: Robot) -> None:
    """Check that an arm has a gripper, for a tool that hangs from its fingers.

    Raises:
        DesignError: it has none.
    """
    if robot.gripper is None:
        raise DesignError.because(DesignReason.NO_GRIPPER, robot=robot.title)


def _check_component(component: Component) -> None:
    """Check a component's name and sizes."""
    if not NAME.fullmatch(component.name):
        raise DesignError.because(DesignReason.NAME, name=shorten(component.name))

    for axis, side in zip("xyz", component.shape.bounds[1].tolist(), strict=True):
        if not MIN_SIDE_M <= side <= MAX_SIDE_M:
            raise DesignError.because(
                DesignReason.SIDE,
                component=component.name,
                axis=axis,
                side_m=side,
                least_m=MIN_SIDE_M,
                most_m=MAX_SIDE_M,
            )


def _check_mass(component: Component) -> None:
    """Check a mass that a model wrote, and the density that follows from it."""
    mass = component.mass
    if not MIN_COMPONENT_KG <= mass <= MAX_COMPONENT_KG:
        raise DesignError.because(
            DesignReason.MASS,
            component=component.name,
            mass_kg=mass,
            least_kg=MIN_COMPONENT_KG,
            most_kg=MAX_COMPONENT_KG,
        )

    density = mass / component.shape.volume
    if not MIN_DENSITY <= density <= MAX_DENSITY:
        raise DesignError.because(
            DesignReason.DENSITY,
            component=component.name,
            mass_kg=mass,
            volume_m3=component.shape.volume,
            density_kg_m3=density,
            least_kg_m3=MIN_DENSITY,
            most_kg_m3=MAX_DENSITY,
        )


def _check_extent(tool: Tool) -> None:
    """Check how far each component reaches from its mount."""
    placed = tool.placed()
    for component in tool.components:
        mount, pose = placed[component.name]
        reach = float(np.linalg.norm(pose.apply(component.shape.corners), axis=1).max())
        if reach > MAX_EXTENT_M:
            raise DesignError.because(
                DesignReason.EXTENT,
                component=component.name,
                reach_m=reach,
                mount=mount,
                most_m=MAX_EXTENT_M,
            )


def mount_solids(tool: Tool, robot: Robot) -> dict[str, list[Solid]]:
    """Build the solids of what a tool hangs from, the flange or the fingers, each in its own frame."""
    if not tool.gripper:
        flange = Solid(RIGID_MOUNT, solid_geometry(robot.flange.disc), Pose())
        return {RIGID_MOUNT: [flange]}
    solids: dict[str, list[Solid]] = {}
    for solid in robot_solids(robot, True):
        solids.setdefault(solid.name, []).append(solid)
    return {mount: solids[mount] for mount in tool.mounts}


@lru_cache(maxsize=16)
def check_contacts(tool: Tool, robot: Robot | None) -> Mapping[str, Array]:
    """Check that each component touches its parent; return the points (3,) where they do, in the mount's frame.

    Without a robot the mount is a point: a fixture is held where its components are nearest to it.

    Raises:
        DesignError: names all components that are too far from their parents, the gaps, and how to close them.
    """
    faults = Faults()
    placed = tool.placed()
    if robot is None:
        mount_point = solids_of("mount", Sphere(_POINT_M), Pose())
        solids = dict.fromkeys(tool.mounts, mount_point)
    else:
        solids = mount_solids(tool, robot)

    points: dict[str, Array] = {}

    for component in tool.components:
        name = component.name
        parent = component.parent
        solids[name] = solids_of(name, component.shape, Pose())
        if parent not in solids:
            continue

        there = solids_of(name, component.shape, component.pose)
        gap, point, direction = closest(there, solids[parent])
        mount, _ = placed[name]
        _, frame = placed.get(parent, (parent, Pose()))
        most = MAX_GAP_M
        neighbour = f"parent {parent!r}"
        if parent in tool.mounts:
            most = MAX_MOUNT_GAP_M if robot else math.inf
            neighbour = f"mount {parent!r}"

        if gap > most:
            way = describe_way(frame.rotation.apply(gap * direction), mount)
            faults.add(
                DesignReason.GAP,
                component=name,
                gap_mm=1000 * gap,
                neighbour=neighbour,
                way=way,
            )
        points[name] = frame.apply(point)

    faults.refuse()
    return points


def describe_way(way: Array, mount: str) -> str:
    """Write a way (3,) in the frame of a mount."""
    return f"({short_numbers(way, 4, ', ')}) m in the frame of {mount!r}"


def check_goals(tool: Tool, task: Task) -> None:
    """Check that a task's goals can be reached with what a tool brings to the scene: its fixture, or none.

    Raises:
        DesignError: they name a fixture that it lacks, or ask more of it than it is.
    """
    Faults(map(DesignError, task.find_goal_faults(tool.fixture))).refuse()


def given_tool(representation: ToolRepresentation, task: Task) -> Tool | None:
    """Return the tool that a representation gives for a task; None: it gives none.

    Raises:
        UserError: it gives something else, or a tool that breaks a rule; the message names the plugin.
    """
    try:
        tool = representation.given(task)
        if isinstance(tool, Tool):
            tool = representation.material.made(tool)
            if tool.components:
                check_tool(tool, task.robot, representation.material)
            check_goals(tool, task)
    except DesignError as error:
        what = f"the tool that it gives for {task.name} breaks a rule"
        raise UserError(f"{describe_part(representation)}: {what}: {error}") from error

    if tool is not None and not isinstance(tool, Tool):
        wrong = shorten(repr(tool))
        raise UserError(
            f"{describe_part(representation)}: given returned {wrong}; expected a Tool or None"
        )
    return tool
