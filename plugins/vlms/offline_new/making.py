"""Make a tool and a plan of a way of using a tool, a job and values for its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation, Slerp

from core.design import Tool
from core.geometry import Array, Pose
from core.interfaces import Material
from plugins.vlms.offline_new.heads import Head, Step
from plugins.vlms.offline_new.layout import Layout
from plugins.vlms.offline_new.options import Option
from plugins.vlms.offline_new.shafts import SHAFTS, build_tool
from plugins.vlms.offline_new.ways.way import Range, Values

MOUNT_RANGES = {
    "mount_x": Range(-0.2, 0.9),
    "mount_y": Range(-0.3, 0.3),
    "mount_z": Range(-0.5, 0.5),
    "mount_yaw": Range(-np.pi, np.pi),
    "shaft": Range(0.0, 1.0),
}
"""Where a head is in the frame of the tool mount, and which of `SHAFTS` carries it: parameters that every way has."""

_SEGMENT_S = 0.5  # the shortest time of a segment
_MOST_SEGMENTS = 10  # of a step
_PLACES = 40  # of the tool mount, of which the best is taken
_SECTOR_RAD = 0.9  # to both sides of home, where arms work with ease
_TURNS_RAD = np.array([0.0, 0.25, -0.25, 0.5, -0.5]) * np.pi
_TURNS = [0.6, 0.1, 0.1, 0.1, 0.1]  # how often each: a head that points ahead is seen, and stiff
_DROP_M = 0.03  # the mount is above a head by more, for a shaft,
_MOST_DROP_M = 0.45  # and by less, or the shaft is long
_CLEAR_M = 0.015  # above the scene, at home
_EXCESS = 20.0  # what a metre out of reach costs, in metres that a shaft is longer
_DOUBT_M = 0.15  # how much a longer shaft is taken by chance


@dataclass(frozen=True, eq=False)
class Made:
    """A tool and a plan, and what they were made of.

    Attributes:
        option: the way of using a tool, and its jobs.
        values: of the parameters.
        head: the working end.
        mount: its pose in the frame of the tool mount.
        tool: that has it.
        rows: the waypoints, (N, 6), or (N, 7) with a gripper.
        steps: those of the way that the waypoints are on.
        owners: the number of the job that each waypoint is for.
    """

    option: Option
    values: Values
    head: Head
    mount: Pose
    tool: Tool
    rows: Array
    steps: Sequence[Step]
    owners: Sequence[int]

    @cached_property
    def touching(self) -> list[bool]:
        """Whether the head may touch the bodies on the way to each waypoint."""
        return [step.touch for step in self.steps]


def list_steps(option: Option, values: Values) -> list[tuple[int, Step]]:
    """List the steps for all jobs, each with the number of its job, cut so that speeds are kept."""
    listed = []
    for number, job in enumerate(option.jobs):
        before: Step | None = None
        for step in option.way.motion(job, values):
            listed += [(number, part) for part in _cut(before, step)]
            before = step

    return listed


def _cut(before: Step | None, step: Step) -> list[Step]:
    """Cut a step into so many that the head has its speed, as each lasts half a second at least."""
    if before is None or step.speed is None:
        return [step]

    start = before.pose.position
    way = step.pose.position - start
    count = np.ceil(np.linalg.norm(way) / (step.speed * _SEGMENT_S))
    shares = np.linspace(0.0, 1.0, int(np.clip(count, 1, _MOST_SEGMENTS)) + 1)[1:]
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


def make(option: Option, values: Values, material: Material) -> Made:
    """Make a tool and a plan.

    Args:
        option: the way of using a tool, and its jobs; the head is made for the first.
        values: of all parameters, those of the mount too.
        material: of which the tool is made.
    """
    head = option.way.head(option.jobs[0], values)
    mount = head.mount or Pose.xyz_rpy(
        (values["mount_x"], values["mount_y"], values["mount_z"]),
        (0.0, 0.0, values["mount_yaw"]),
    )
    kind = SHAFTS[min(int(values["shaft"] * len(SHAFTS)), len(SHAFTS) - 1)]
    tool = build_tool(head, mount, kind, material, option.way.name)
    return plan(option, values, head, mount, tool)


def plan(option: Option, values: Values, head: Head, mount: Pose, tool: Tool) -> Made:
    """Plan the motion of a tool whose head is at ``mount`` in the frame of the tool mount."""
    numbered = list_steps(option, values)
    back = mount.inverse()
    rows = []

    for number, step in numbered:
        pose = option.jobs[number].frame @ step.pose @ back
        row = [*pose.position, *pose.rpy]
        rows.append([*row, step.grip] if tool.gripper else row)

    return Made(
        option,
        values,
        head,
        mount,
        tool,
        np.array(rows),
        [step for _, step in numbered],
        [number for number, _ in numbered],
    )


def draw_values(ranges: Mapping[str, Range], rng: Generator) -> dict[str, float]:
    """Draw a value for each parameter."""
    return {name: float(rng.uniform(*span)) for name, span in ranges.items()}


def draw_mount(option: Option, values: Values, rng: Generator) -> dict[str, float]:
    """Draw where the head is at the tool mount: the place from which the arm reaches the whole way, and the nearest.

    Places of the tool mount are drawn where the arm works with ease, for the first pose at which the head works.

    Args:
        option: the way of using a tool, and its jobs.
        values: of the way's own parameters.
        rng: random numbers.
    """
    jobs = option.jobs
    layout = jobs[0].layout
    head = option.way.head(jobs[0], values)
    poses = [jobs[n].frame @ step.pose for n, step in list_steps(option, values)]
    start = poses[min(1, len(poses) - 1)]
    attach = start.apply(head.attach)

    places = _draw_places(layout, attach, min(p.position[2] for p in poses), rng)
    offsets = (places - start.position) @ start.rotation_matrix
    points = np.array([pose.apply(offsets) for pose in poses]).swapaxes(0, 1)
    apart = np.linalg.norm((places - attach)[:, :2], axis=1)
    doubts = rng.uniform(0.0, _DOUBT_M, len(places))
    costs = _EXCESS * layout.reach.excess(points) + apart + doubts
    place = places[costs.argmin()]

    yaw = float(layout.home.rpy[2] + rng.choice(_TURNS_RAD, p=_TURNS))
    mount = Pose.xyz_rpy(place, (0.0, 0.0, yaw)).inverse() @ start
    x, y, z = mount.position.tolist()
    return {
        "mount_x": x,
        "mount_y": y,
        "mount_z": z,
        "mount_yaw": float(mount.rpy[2]),
        "shaft": float(rng.uniform()),
    }


def _draw_places(layout: Layout, attach: Array, lowest: float, rng: Generator) -> Array:
    """Draw places (P, 3) of the tool mount in the world, for a head whose shaft ends at a point (3,).

    Where the head works below home, the shaft is short enough that it does not meet anything at home.

    Args:
        layout: has the arm.
        attach: where the shaft ends, in the world.
        lowest: the height of the head on its way, at least.
        rng: random numbers.
    """
    reach = layout.reach
    home = layout.home.position
    below = layout.top_at(home[:2] - 0.1, home[:2] + 0.6)
    if below > home[2]:
        below = -np.inf
    room = min(home[2] - below, home[2] - lowest) - _CLEAR_M
    least = _DROP_M
    most = max(least + 0.02, min(room - (attach[2] - lowest), _MOST_DROP_M))
    if attach[2] > home[2]:
        least = -_MOST_DROP_M
        most = 0.0

    ahead = float(np.arctan2(*(home - reach.base)[[1, 0]]))
    angles = ahead + rng.uniform(-_SECTOR_RAD, _SECTOR_RAD, _PLACES)
    radii = rng.uniform(reach.inner, reach.outer, _PLACES)
    heights = attach[2] + rng.uniform(least, most, _PLACES)
    x = reach.base[0] + radii * np.cos(angles)
    y = reach.base[1] + radii * np.sin(angles)
    return np.column_stack([x, y, heights])
