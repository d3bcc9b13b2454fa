"""Rules for designs of every representation: limits of tools and plans, and a start that is clear of everything."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import RIGID_MOUNT, Component, DesignError, Tool
from core.designs.statics import MAX_GAP_M, Beams, check_joints, check_weight, corners
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import Robot, Task, ToolRepresentation, Waypoints
from core.plugins import describe_part
from core.robot.kinematics import arm_of, link_poses
from core.robot.solids import (
    Obstacles,
    Solid,
    body_solids,
    closest,
    robot_solids,
    signed_distance,
    solid_geometry,
    solids_of,
)
from core.robot.trajectory import KNOT_M, KNOT_RAD
from core.scene import Scene
from core.support.text import kind, shorten
from core.values.materials import PAPER, Material

MAX_COMPONENTS = 100
MIN_SIDE_M = 0.0005
MAX_SIDE_M = 2.0
MAX_EXTENT_M = 2.0  # from the mount to the farthest point, which bounds the speed of a tool's tip too
MIN_COMPONENT_KG = 1e-6  # small boxes of a link have small shares of its mass
MAX_COMPONENT_KG = 1.0
MIN_TOOL_KG = 0.001
MIN_DENSITY = 1.0  # kg/m^3, about that of air; the paper's 5 g must do for a box of a few litres
MAX_DENSITY = 20_000.0  # kg/m^3; gold and tungsten have 19,300
MAX_BEND_M_N = 0.01  # of the farthest end, per newton
MAX_LOAD_N = 10.0  # at any end, that a real material must bear
MAX_MOUNT_GAP_M = 0.002
MAX_ARM_OVERLAP_M = 0.001  # at the start; the scene may not even be touched

MAX_WAYPOINTS = 200
MAX_REACH_M = 3.0
MIN_TEMPO = 0.001  # m/s or s, where a plan asks for a speed or a time
MAX_POSES = 2_000_000  # that are computed for a candidate, at most: of its way, and of its tool in motion
KNOT_POSES = 1000  # what inverse kinematics at a knot of the way costs
MAX_KNOTS = MAX_POSES // KNOT_POSES
MAX_ANGLE_RAD = 100.0
WAYPOINT = ("x", "y", "z", "roll", "pitch", "yaw", "gripper")

NAME = re.compile(r"[A-Za-z0-9_.-]{1,64}")  # prompts, messages and robot descriptions hold it as it is
_TOUCH_M = 1e-5  # the accuracy of the home pose from inverse kinematics


def check_tool(tool: Tool, robot: Robot, material: Material = PAPER) -> None:
    """Check that an arm can bear a tool of ``material``, with the masses that it has.

    Checked are number, sizes, masses and extent of its components, contacts, stiffness, and of a real material the
    moment about the mount and strength.

    Raises:
        DesignError: the first rule that is broken.
    """
    if tool.gripper and robot.gripper is None:
        raise DesignError(f"{robot.title} has no gripper; design one rigid tool, with 'gripper' false")
    if not tool.components:
        raise DesignError(f"the tool has no components; hang at least one from {' or '.join(tool.mounts)}")
    if len(tool.components) > MAX_COMPONENTS:
        raise DesignError(f"the tool has {len(tool.components)} components; at most {MAX_COMPONENTS} are allowed")
    for component in tool.components:
        _check_component(component)
        if material.density_kg_m3 is None:
            _check_mass(component)
    check_weight(tool, robot, material)
    if tool.mass < MIN_TOOL_KG:
        raise DesignError(f"the tool weighs {tool.mass:.3g} kg; at least {MIN_TOOL_KG:g} kg is needed")
    _check_extent(tool)
    joints = check_contacts(tool, robot)
    check_joints(tool, material, mount_solids(tool, robot))
    _check_stiffness(tool, joints, material)


def _check_component(component: Component) -> None:
    if not NAME.fullmatch(component.name):
        raise DesignError(f"component name {shorten(component.name)} is not 1 to 64 letters, digits, '_', '.' or '-'")
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
        fault = "is lighter than air" if density < MIN_DENSITY else "is denser than gold"
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
        return {RIGID_MOUNT: [Solid(RIGID_MOUNT, solid_geometry(robot.flange.disc), Pose())]}
    return {mount: [solid for solid in robot_solids(robot, True) if solid.name == mount] for mount in tool.mounts}


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
        points[component.name] = point if on_mount else placed[component.parent][1].apply(point)
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


def check_plan(plan: object, *, gripper: bool) -> Array:
    """Check an action plan; return it as an array, (N, 6) or with the gripper (N, 7): see `core.design.Candidate`.

    ``plan`` is an array, or lists of numbers from JSON.

    Raises:
        DesignError: names the wrong waypoint (from 1) and its fault.
    """
    if isinstance(plan, np.ndarray):
        plan = plan.tolist()
    if not isinstance(plan, list | tuple):
        raise DesignError(f"an action plan must be a list of waypoints, not {kind(plan)}")
    if not 1 <= len(plan) <= MAX_WAYPOINTS:
        raise DesignError(f"the action plan has {len(plan)} waypoints; between 1 and {MAX_WAYPOINTS} are needed")
    names = WAYPOINT if gripper else WAYPOINT[:6]
    checked = np.array([_check_waypoint(waypoint, f"waypoint {i}", names) for i, waypoint in enumerate(plan, start=1)])
    turns = Rotation.from_euler("xyz", checked[:, 3:6])
    ways = np.linalg.norm(np.diff(checked[:, :3], axis=0), axis=1)
    angles = np.asarray((turns[:-1].inv() * turns[1:]).magnitude()) if len(checked) > 1 else ways
    if np.ceil(np.maximum(ways / KNOT_M, angles / KNOT_RAD)).sum() > MAX_KNOTS:
        raise DesignError(
            f"the way through the waypoints is {ways.sum():.0f} m and {angles.sum():.0f} rad long; at most "
            f"{MAX_KNOTS * KNOT_M:g} m or {MAX_KNOTS * KNOT_RAD:g} rad are allowed"
        )
    return checked


def check_tempo(plan: Waypoints, home: Pose, most_s: float) -> None:
    """Refuse a plan that asks for next to no speed or time, or for more than ``most_s`` seconds in all.

    Raises:
        DesignError: names the wrong waypoint (from 1), or the time in all.
    """
    tempo = plan.tempo
    if tempo is None:
        return
    for name, asked in (("speed", tempo.speeds), ("time", tempo.seconds)):
        for k in np.flatnonzero(asked < MIN_TEMPO)[:1]:
            raise DesignError(f"waypoint {k + 1}: a {name} of {asked[k]:g} is too small; give {MIN_TEMPO:g} or more")
    ways = np.linalg.norm(np.diff(np.vstack([home.position, plan.poses[:, :3]]), axis=0), axis=1)
    asked = np.where(np.isfinite(tempo.seconds), tempo.seconds, ways / tempo.speeds)
    if (seconds := float(np.nansum(asked) + tempo.waits.sum())) > most_s:
        raise DesignError(f"the plan asks for {seconds:.4g} s; at most {most_s:g} s are allowed")


def check_work(tool: Tool, seconds: float, hz: float) -> None:
    """Refuse a motion that would take too long to play and to look at, at ``hz`` instants a second.

    Raises:
        DesignError: with the figures.
    """
    if (poses := len(tool.parts) * seconds * hz) > MAX_POSES:
        raise DesignError(
            f"the tool's {len(tool.parts)} parts would be looked at {hz:.0f} times a second for {seconds:.0f} s, which "
            f"is {poses:.2g} poses; at most {MAX_POSES:.2g} are computed: move slower, or use fewer and thicker parts"
        )


def _check_waypoint(waypoint: object, where: str, names: tuple[str, ...]) -> list[float]:
    if not isinstance(waypoint, list | tuple):
        raise DesignError(f"{where} must be a list of {len(names)} numbers, not {kind(waypoint)}")
    if len(waypoint) != len(names):
        raise DesignError(f"{where} has {len(waypoint)} numbers, {len(names)} are needed: {', '.join(names)}")
    for name, number in zip(names, waypoint, strict=True):
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise DesignError(f"{where}: {name} must be a number, not {kind(number)}")
        if isinstance(number, float) and not math.isfinite(number):
            raise DesignError(f"{where}: {name} is {number}, a finite number is needed")
        # Also refuses integers that are too large for a float.
        limit, unit = (MAX_ANGLE_RAD, "radians") if name in WAYPOINT[3:6] else (MAX_REACH_M, "metres")
        if name != "gripper" and abs(number) > limit:
            raise DesignError(f"{where}: {name} is beyond {limit:g} {unit}")
        if name == "gripper" and not 0 <= number <= 1:
            raise DesignError(f"{where}: the gripper value must be between 0 (open) and 1 (closed)")
    numbers = [float(number) for number in waypoint]
    reach = math.hypot(*numbers[:3])
    if reach > MAX_REACH_M:
        raise DesignError(f"{where} is {reach:.2f} m from the world's origin; at most {MAX_REACH_M:g} m are allowed")
    return numbers


class SpawnRules:
    """Checks that a tool starts clear of the arm and of all bodies, in ``scene`` (None: the task's layout of ``seed``).

    The arm is at the task's home pose and the fingers are open. A component may overlap what carries it: the links at
    the flange for rigid tools, the component's own finger for gripper tools.

    Raises:
        UserError: the arm can't reach the task's home pose.
    """

    def __init__(self, task: Task, seed: int = 0, scene: Scene | None = None) -> None:
        self.task, self.robot = task, task.robot
        self._parts = [SpawnRules(part, seed) for part in task.parts if part is not task]
        if self._parts:
            return
        self._joints = arm_of(task.robot).home_for(task.home)
        bodies = (scene or task.scene(seed)).bodies
        self._scene = Obstacles(solid for body in bodies for solid in body_solids(body))
        self._robots: dict[bool, tuple[Obstacles, dict[str, Pose]]] = {}

    def check(self, tool: Tool) -> None:
        """Refuse a tool that starts inside the arm, in contact with the scene, or inside its other half.

        Raises:
            DesignError: names the component, what it overlaps, and the depth; of several tasks which.
        """
        for rules in self._parts:
            try:
                rules.check(tool)
            except DesignError as error:
                raise DesignError(f"in {rules.task.name}, {error}") from error
        if self._parts:
            return
        robot, frames = self._robot(tool.gripper)
        placed, solids, mounts = tool.placed(), list[Solid](), list[str]()
        for component in tool.components:
            mount, pose = placed[component.name]
            own = solids_of(component.name, component.shape, frames[mount] @ pose)
            solids, mounts = [*solids, *own], [*mounts, *[mount] * len(own)]
        _check_halves(solids, mounts)
        for solid, mount in zip(solids, mounts, strict=True):
            carriers = (mount,) if tool.gripper else self.robot.near_mount
            for link, gap in robot.gaps(solid, _TOUCH_M):
                if link not in carriers and -gap > MAX_ARM_OVERLAP_M:
                    raise DesignError(
                        f"component {solid.name!r} starts {-gap * 1000:.1f} mm inside the arm ({link}); "
                        "move it away from the arm, or bend the tool around it"
                    )
            for body, gap in self._scene.gaps(solid, _TOUCH_M):
                if gap < _TOUCH_M:
                    contact = f"{-gap * 1000:.1f} mm inside" if -gap > _TOUCH_M else "touching"
                    raise DesignError(
                        f"component {solid.name!r} starts {contact} {body!r} of the scene; "
                        "shorten or turn the tool so that it starts clear of everything"
                    )

    def _robot(self, gripper: bool) -> tuple[Obstacles, dict[str, Pose]]:
        """The robot's solids, and the world poses of its links."""
        if gripper not in self._robots:
            frames = link_poses(self.robot, gripper, self._joints)
            solids = (Solid(s.name, s.geometry, frames[s.name] @ s.pose) for s in robot_solids(self.robot, gripper))
            self._robots[gripper] = Obstacles(solids), frames
        return self._robots[gripper]


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
        raise UserError(f"{describe_part(representation)}: given returned {wrong}; expected a Tool or None")
    return tool


def _check_halves(solids: Sequence[Solid], mounts: Sequence[str]) -> None:
    """Refuse components on one finger that start inside components on the other."""
    for (one, mount), (other, others) in itertools.combinations(zip(solids, mounts, strict=True), 2):
        if mount != others:
            depth = -signed_distance(one, other)
            if depth > MAX_ARM_OVERLAP_M:
                raise DesignError(
                    f"components {one.name!r} and {other.name!r}, on different fingers, start {depth * 1000:.1f} mm "
                    "inside each other; move them apart"
                )
