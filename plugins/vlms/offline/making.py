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
from plugins.vlms.offline.hand import build_fingers
from plugins.vlms.offline.heads import Head, Step
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.options import Option
from plugins.vlms.offline.shafts import SHAFTS, build_tool
from plugins.vlms.offline.ways.way import Range, Values

MOUNT_RANGES = {
    "mount_x": Range(-0.2, 0.9),
    "mount_y": Range(-0.3, 0.3),
    "mount_z": Range(-0.5, 0.5),
    "mount_yaw": Range(-np.pi, np.pi),
    "shaft": Range(0.0, 1.0),
}
"""Where a head is in the frame of the tool mount, and which of `SHAFTS` carries it: parameters of ways that don't say
that themselves.
"""

START_RANGES = {"rise": Range(0.0, 1.0)}
"""How far out the arm rises to where it works, if that is above home: a parameter of every way."""

_HIGHER_M = 0.05  # a first pose that is higher above home is risen to
_SEGMENT_S = 0.5  # the shortest time of a segment
_MOST_SEGMENTS = 10  # of a step
_PLACES = 100  # of the tool mount, of which the best is taken
_SECTOR_RAD = 1.4  # to both sides of home; long ways ahead begin beside the arm
_TURNS_RAD = np.array([0.0, 0.25, -0.25, 0.5, -0.5]) * np.pi
_TURNS = [
    0.6,
    0.1,
    0.1,
    0.1,
    0.1,
]  # how often each: a head that points ahead is seen, and stiff
_DROP_M = 0.03  # the mount is above a head by more, for a shaft,
_LOW_M = 0.08  # above what is below it, the mount may be
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


def make(option: Option, values: Values, material: Material) -> Made:
    """Make a tool and a plan.

    Args:
        option: the way of using a tool, and its jobs; the head is made for the first.
        values: of all parameters, those of the mount too.
        material: of which the tool is made.
    """
    way = option.way
    head = way.head(option.jobs[0], values)
    mount = find_mount(head, values)
    if way.fingers:
        robot = option.jobs[0].layout.robot
        tool = build_fingers(head, mount, material, way.name, robot)
    elif way.bolted:
        tool = build_tool(head, mount, "", material, way.name)
    else:
        kind = SHAFTS[min(int(values["shaft"] * len(SHAFTS)), len(SHAFTS) - 1)]
        tool = build_tool(head, mount, kind, material, way.name)

    return _plan(option, values, head, mount, tool)


def find_mount(head: Head, values: Values) -> Pose:
    """Find the pose of a head in the frame of the tool mount: the values say it, or else the head itself."""
    if "mount_x" not in values:
        assert head.mount is not None  # its way is bolted
        return head.mount

    place = (values["mount_x"], values["mount_y"], values["mount_z"])
    return Pose.xyz_rpy(place, (0.0, 0.0, values["mount_yaw"]))


def use(option: Option, values: Values, tool: Tool) -> Made:
    """Plan the motion of a tool that is given, as if its head were the one that the values say."""
    head = option.way.head(option.jobs[0], values)
    return _plan(option, values, head, find_mount(head, values), tool)


def plan(made: Made, values: Values) -> Made:
    """Plan the motion of a tool anew, with these values."""
    return _plan(made.option, values, made.head, made.mount, made.tool)


def _plan(option: Option, values: Values, head: Head, mount: Pose, tool: Tool) -> Made:
    """Plan the motion of a tool whose head is at ``mount`` in the frame of the tool mount."""
    numbered = list_steps(option, values)
    back = mount.inverse()
    poses = [option.jobs[number].frame @ step.pose @ back for number, step in numbered]
    rise = _rise(option.jobs[0].layout, poses[0], values["rise"])
    numbered = [(0, Step(pose @ mount)) for pose in rise] + numbered
    rows = [[*pose.position, *pose.rpy] for pose in (*rise, *poses)]
    if tool.gripper:
        grips = [step.grip for _, step in numbered]
        rows = [[*row, grip] for row, grip in zip(rows, grips, strict=True)]

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

    base = layout.reach.base[:2]
    out = first.position[:2] - base
    far = float(np.linalg.norm(out))
    near = layout.reach.inner + share * (far - layout.reach.inner)
    x, y = base + out * near / far
    return [
        Pose(np.array([x, y, height]), first.quaternion)
        for height in (home[2], first.position[2])
    ]


def draw_values(ranges: Mapping[str, Range], rng: Generator) -> dict[str, float]:
    """Draw a value for each parameter."""
    return {name: float(rng.uniform(*span)) for name, span in ranges.items()}


def draw_mount(option: Option, values: Values, rng: Generator) -> dict[str, float]:
    """Draw where the head is at the tool mount: of some places the one from which the arm reaches the whole way.

    Places of the tool mount are drawn where the arm works with ease, for the first pose at which the head works. A
    short shaft is better than a long one, and one with which the head meets nothing at home.

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
    places = _draw_places(layout, attach, head.attach[2] - head.bottom, rng)
    yaws = layout.home.rpy[2] + rng.choice(_TURNS_RAD, len(places), p=_TURNS)

    offsets = (places - start.position) @ start.rotation_matrix
    points = np.array([pose.apply(offsets) for pose in poses]).swapaxes(0, 1)
    apart = np.linalg.norm((places - attach)[:, :2], axis=1)
    costs = _EXCESS * layout.reach.excess(points) + apart
    costs += _count_at_home(layout, start.apply(head.corners), places, yaws)
    costs += rng.uniform(0.0, _DOUBT_M, len(places))

    best = int(costs.argmin())
    mount = Pose.xyz_rpy(places[best], (0.0, 0.0, yaws[best])).inverse() @ start
    x, y, z = mount.position.tolist()
    return {
        "mount_x": x,
        "mount_y": y,
        "mount_z": z,
        "mount_yaw": float(mount.rpy[2]),
        "shaft": float(rng.uniform()),
    }


def _count_at_home(layout: Layout, corners: Array, places: Array, yaws: Array) -> Array:
    """Count by boxes what a head meets when the tool mount is at home, (P,).

    Args:
        layout: where home is.
        corners: of the head (Q, 3), in the world, when the tool mount is at a place.
        places: (P, 3) of the tool mount then.
        yaws: (P,) of the tool mount then.
    """
    turns = Rotation.from_rotvec(
        np.outer(layout.home.rpy[2] - yaws, [0.0, 0.0, 1.0])
    ).as_matrix()
    there = np.einsum("pij,pqj->pqi", turns, corners - places[:, None])
    there += layout.home.position
    middle = (there.min(axis=1) + there.max(axis=1)) / 2
    half = np.ptp(there, axis=1) / 2

    obstacles = layout.all_solids
    gaps = np.abs(middle[:, None] - obstacles.centers) - half[:, None]
    return np.asarray((gaps < obstacles.halves).all(axis=-1).sum(axis=1))


def _draw_places(layout: Layout, attach: Array, hang: float, rng: Generator) -> Array:
    """Draw places (P, 3) of the tool mount in the world, for a head whose shaft ends at a point (3,).

    Where the head works below home, the shaft is short enough that the tool meets nothing at home.

    Args:
        layout: has the arm.
        attach: where the shaft ends, in the world.
        hang: how far the head goes below that point.
        rng: random numbers.
    """
    reach = layout.reach
    home = layout.home.position
    obstacles = layout.others(frozenset())
    tops = (obstacles.centers + obstacles.halves)[:, 2]
    ground = float(tops[tops < home[2]].max(initial=-np.inf))
    room = home[2] - ground - hang - _CLEAR_M
    least = _DROP_M
    most = float(np.clip(room, least + 0.02, _MOST_DROP_M))
    if attach[2] > home[2]:
        least = float(np.clip(ground + _LOW_M - attach[2], -_MOST_DROP_M, 0.0))

    ahead = float(np.arctan2(*(home - reach.base)[[1, 0]]))
    angles = ahead + rng.uniform(-_SECTOR_RAD, _SECTOR_RAD, _PLACES)
    radii = rng.uniform(reach.inner, reach.outer, _PLACES)
    heights = attach[2] + rng.uniform(least, most, _PLACES)
    x = reach.base[0] + radii * np.cos(angles)
    y = reach.base[1] + radii * np.sin(angles)
    return np.column_stack([x, y, heights])
