"""Choose where a head is at the tool mount, so that the arm reaches the whole way."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.making import list_steps
from plugins.vlms.offline.options import Option
from plugins.vlms.offline.ways.way import Range, Values, Way

MOUNT_RANGES = {
    "mount_x": Range(-0.2, 0.9),
    "mount_y": Range(-0.3, 0.3),
    "mount_z": Range(-0.5, 0.5),
    "mount_yaw": Range(-np.pi, np.pi),
    "shaft": Range(0.0, 1.0),
}
"""Where a head is in the frame of the tool mount, and which kind of shaft carries it: parameters of all ways that are
not bolted to the mount.
"""

_PLACES = 100  # of the tool mount, of which the best is taken
_SECTOR_RAD = 1.4  # to both sides of home; long ways ahead begin beside the arm
_TURNS_RAD = np.array([0.0, 0.25, -0.25, 0.5, -0.5]) * np.pi
# How often each: of a head that points ahead most is seen, and it is stiff.
_TURNS = [0.6, 0.1, 0.1, 0.1, 0.1]
_DROP_M = 0.03  # the mount is above a head by more, for a shaft,
_LOW_M = 0.08  # above what is below it, the mount may be
_MOST_DROP_M = 0.45  # and by less, or the shaft is long
_PLAY_M = 0.02  # between the least drop and the most, at least
_CLEAR_M = 0.015  # above the scene, at home
_EXCESS = 20.0  # what a metre out of reach costs, in metres that a shaft is longer
_DOUBT_M = 0.15  # how much a longer shaft is taken by chance


def list_ranges(way: Way) -> dict[str, Range]:
    """List all parameters of a way, with those of the mount unless the head says where that is."""
    if way.bolted:
        return way.ranges
    return {**way.ranges, **MOUNT_RANGES}


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
    least, most = _find_drop(layout, attach, hang)
    reach = layout.reach
    x, y, _ = layout.home.position - reach.base
    ahead = float(np.arctan2(y, x))
    angles = ahead + rng.uniform(-_SECTOR_RAD, _SECTOR_RAD, _PLACES)
    radii = rng.uniform(reach.inner, reach.outer, _PLACES)
    heights = attach[2] + rng.uniform(least, most, _PLACES)
    return np.column_stack(
        [
            reach.base[0] + radii * np.cos(angles),
            reach.base[1] + radii * np.sin(angles),
            heights,
        ]
    )


def _find_drop(layout: Layout, attach: Array, hang: float) -> tuple[float, float]:
    """Find how far the mount may be above the end of a shaft, at least and at most, metres; see `_draw_places`."""
    home = float(layout.home.position[2])
    obstacles = layout.others(frozenset())
    tops = (obstacles.centers + obstacles.halves)[:, 2]
    ground = float(tops[tops < home].max(initial=-np.inf))

    room = home - ground - hang - _CLEAR_M
    most = float(np.clip(room, _DROP_M + _PLAY_M, _MOST_DROP_M))
    if attach[2] <= home:
        return _DROP_M, most

    # The head works above home: the mount may stay below it, over the ground.
    return float(np.clip(ground + _LOW_M - attach[2], -_MOST_DROP_M, 0.0)), most
