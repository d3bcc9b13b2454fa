"""Make a tool and a plan of a way of using a tool, a job and values for its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation, Slerp

from core.design import Tool
from core.geometry import Array, Pose
from plugins.vlms.offline.hand import build_fingers
from plugins.vlms.offline.heads import Head, Step
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.options import Option
from plugins.vlms.offline.recipe import Recipe, Shaft, Values
from plugins.vlms.offline.shafts import build_tool
from plugins.vlms.offline.ways.way import Ranges

_HIGHER_M = 0.05  # a first pose that is higher above home is risen to
_NEAR_M = 1e-6  # to the base's axis, there is no way out from it
_SEGMENT_S = 0.5  # the shortest time of a segment
_MOST_SEGMENTS = 10  # of a step


class Waypoint(NamedTuple):
    """A step of the head to a waypoint of a plan, and the number of the job that it is for."""

    number: int
    step: Step


@dataclass(frozen=True, eq=False)
class Made:
    """A tool and a plan, and what they were made of.

    Attributes:
        option: the way of using a tool, and its jobs.
        recipe: of tool and plan.
        head: the working end.
        mount: its pose in the frame of the tool mount.
        tool: that has it.
        waypoints: N of them, after home.
        positions: of the tool mount at these, in the world, (N, 3).
        rotations: of the tool mount at these, N.
    """

    option: Option
    recipe: Recipe
    head: Head
    mount: Pose
    tool: Tool
    waypoints: Sequence[Waypoint]
    positions: Array
    rotations: Rotation

    @cached_property
    def rows(self) -> Array:
        """The waypoints as plans have them: (N, 6), or (N, 7) with a gripper."""
        angles = self.rotations.as_euler("xyz", suppress_warnings=True)
        rows = np.column_stack([self.positions, angles])
        if self.tool.gripper:
            grips = [waypoint.step.grip for waypoint in self.waypoints]
            rows = np.column_stack([rows, grips])
        return rows


def list_steps(option: Option, values: Values) -> list[Waypoint]:
    """List the steps for all jobs, cut so that speeds are kept."""
    listed = []
    for number, job in enumerate(option.jobs):
        before: Step | None = None
        for step in option.way.motion(job, values):
            listed += [Waypoint(number, part) for part in _cut(before, step)]
            before = step

    return listed


def _cut(before: Step | None, step: Step) -> list[Step]:
    """Cut a step into so many that the head has its speed, as each lasts half a second at least."""
    if before is None or step.speed is None:
        return [step]

    start = before.pose.position
    way = step.pose.position - start
    count = np.ceil(np.linalg.norm(way) / (step.speed * _SEGMENT_S))
    count = int(np.clip(count, 1, _MOST_SEGMENTS))
    if count == 1:
        return [step]

    shares = np.linspace(0.0, 1.0, count + 1)[1:]
    both = Rotation.concatenate([before.pose.rotation, step.pose.rotation])
    turns = Slerp([0.0, 1.0], both)(shares)

    return [
        Step(
            Pose.from_rotation(start + share * way, turn),
            touch=step.touch,
            grip=step.grip,
        )
        for share, turn in zip(shares, turns, strict=True)
    ]


def make(option: Option, recipe: Recipe) -> Made:
    """Make a tool and a plan; the head is made for the first job."""
    head = option.way.head(option.jobs[0], recipe.values)
    mount = head.mount
    shaft = None
    if recipe.mount is not None:
        mount = recipe.mount.pose
        shaft = recipe.mount.shaft

    assert mount is not None  # a head without one is not bolted
    tool = _build(option, head, mount, shaft)
    return _plan(option, recipe, head, mount, tool)


def _build(option: Option, head: Head, mount: Pose, shaft: Shaft | None) -> Tool:
    """Build a tool whose head is at ``mount`` in the frame of the tool mount; None: it needs no shaft there."""
    way = option.way
    layout = option.layout
    if way.fingers:
        return build_fingers(head, mount, option.load, layout, way.name)

    return build_tool(head, mount, shaft, option.load, layout.material, way.name)


def change_shaft(made: Made, shaft: Shaft) -> Made:
    """Give a tool another kind of shaft; its plan stays."""
    assert made.recipe.mount is not None  # it has one
    tool = _build(made.option, made.head, made.mount, shaft)
    mount = replace(made.recipe.mount, shaft=shaft)
    return replace(made, recipe=replace(made.recipe, mount=mount), tool=tool)


def plan_given(option: Option, recipe: Recipe, tool: Tool, mount: Pose | None) -> Made:
    """Plan the motion of a tool that is given.

    Args:
        option: the way of using it, and its jobs.
        recipe: says the motion, and a head like the tool's.
        tool: of any origin.
        mount: the pose of its head in the frame of the tool mount; None: the head says it itself.
    """
    head = option.way.head(option.jobs[0], recipe.values)
    pose = head.mount if mount is None else mount
    assert pose is not None  # its way is bolted
    return _plan(option, recipe, head, pose, tool)


def plan(made: Made, values: Values) -> Made:
    """Plan the motion of a tool anew, with these values."""
    recipe = replace(made.recipe, values=values)
    return _plan(made.option, recipe, made.head, made.mount, made.tool)


def _plan(option: Option, recipe: Recipe, head: Head, mount: Pose, tool: Tool) -> Made:
    """Plan the motion of a tool whose head is at ``mount`` in the frame of the tool mount."""
    waypoints = list_steps(option, recipe.values)
    frames = [option.jobs[waypoint.number].frame for waypoint in waypoints]
    steps = [waypoint.step.pose for waypoint in waypoints]

    # All at once, as poses one by one take most of the time: frame @ step @ mount.inverse().
    back = mount.inverse()
    turns = Rotation.concatenate([frame.rotation for frame in frames])
    heads = turns * Rotation.concatenate([step.rotation for step in steps])
    starts = np.array([frame.position for frame in frames])
    positions = starts + turns.apply([step.position for step in steps])
    positions += heads.as_matrix() @ back.position
    rotations = heads * back.rotation

    first = Pose.from_rotation(positions[0], rotations[0])
    rise = _rise(option.layout, first, recipe.values["rise"])
    if rise:
        waypoints = [*(Waypoint(0, Step(pose @ mount)) for pose in rise), *waypoints]
        positions = np.vstack([*(pose.position for pose in rise), positions])
        risen = [pose.rotation for pose in rise]
        rotations = Rotation.concatenate([*risen, rotations])

    return Made(option, recipe, head, mount, tool, waypoints, positions, rotations)


def _rise(layout: Layout, first: Pose, share: float) -> list[Pose]:
    """Return what the tool mount passes on its way to a first pose that is far above home: it rises before.

    Args:
        layout: where home is.
        first: pose of the tool mount on its way.
        share: of the way from the least distance from the base to that of the first pose, where it rises.
    """
    home = layout.home.position
    if first.position[2] < home[2] + _HIGHER_M:
        return []

    base = layout.reach.base.position[:2]
    out = first.position[:2] - base
    far = max(float(np.linalg.norm(out)), _NEAR_M)
    near = layout.reach.inner + share * (far - layout.reach.inner)
    x, y = base + out * near / far
    return [
        Pose(np.array([x, y, height]), first.quaternion)
        for height in (home[2], first.position[2])
    ]


def draw_values(ranges: Ranges, rng: Generator) -> dict[str, float]:
    """Draw a value for each parameter."""
    return {name: float(rng.uniform(*span)) for name, span in ranges.items()}
