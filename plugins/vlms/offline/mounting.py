"""Choose where a head is at the tool mount, so that the arm reaches the whole way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from plugins.vlms.offline.heads import Step
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.making import list_steps
from plugins.vlms.offline.options import Option
from plugins.vlms.offline.recipe import SHAFTS, Mount, Values

_PLACES = 100  # of the tool mount, of which the best is taken
_SECTOR_RAD = 1.4  # to both sides of home; long ways ahead begin beside the arm
_TURNS_RAD = np.array([0.0, 0.25, -0.25, 0.5, -0.5]) * np.pi
# How often each: of a head that points ahead most is seen, and it is stiff.
_TURN_SHARES = [0.6, 0.1, 0.1, 0.1, 0.1]
_LEAST_DROP_M = 0.03  # the mount is above a head by more, for a shaft,
_MOST_DROP_M = 0.45  # and by less, or the shaft is long
_DROP_PLAY_M = 0.02  # between the least drop and the most, at least
_BESIDE_HOME_M = 0.05  # to all sides of home, what is below the mount is its ground
_OVER_GROUND_M = 0.015  # a head is at home
_EXCESS = 20.0  # what a metre out of reach costs, in metres that a shaft is longer
_DOUBT_M = 0.15  # how much a longer shaft is taken by chance


def draw_mount(option: Option, values: Values, rng: Generator) -> Mount:
    """Draw where the head is at the tool mount: of some places the one from which the arm reaches the whole way.

    Places of the tool mount are drawn where the arm works with ease, for the pose from which the head first touches
    bodies. Those are preferred with which the head meets nothing at home, where a design that does is refused; of these
    one that is within reach, and has a short shaft.

    Args:
        option: the way of using a tool, and its jobs.
        values: of the way's own parameters.
        rng: random numbers.
    """
    jobs = option.jobs
    layout = option.layout
    head = option.way.head(jobs[0], values)
    listed = list_steps(option, values)
    poses = [jobs[number].frame @ step.pose for number, step in listed]
    start = poses[_find_start([step for _, step in listed])]
    attach = start.apply(head.attach)

    places = _draw_places(layout, attach, head.attach[2] - head.bottom, rng)
    yaws = layout.home.rpy[2] + rng.choice(_TURNS_RAD, len(places), p=_TURN_SHARES)
    hits = _count_at_home(layout, start.apply(head.corners), places, yaws)

    offsets = (places - start.position) @ start.rotation_matrix
    points = np.array([pose.apply(offsets) for pose in poses]).swapaxes(0, 1)
    metres = np.linalg.norm((places - attach)[:, :2], axis=1)
    metres += _EXCESS * layout.reach.excess(points)
    metres += rng.uniform(0.0, _DOUBT_M, len(places))

    best = np.lexsort((metres, hits))[0]
    mount = Pose.xyz_rpy(places[best], (0.0, 0.0, yaws[best])).inverse() @ start
    x, y, z = mount.position.tolist()
    shaft = SHAFTS[int(rng.integers(len(SHAFTS)))]
    return Mount(x, y, z, float(mount.rpy[2]), shaft)


def _find_start(steps: Sequence[Step]) -> int:
    """Find the number of the step from which a head goes on to touch bodies; 0: it touches none, or at once."""
    for number, step in enumerate(steps[1:]):
        if step.touch:
            return number
    return 0


def _count_at_home(
    layout: Layout, corners: Array, places: Array, yaws: Array
) -> npt.NDArray[np.int64]:
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

    obstacles = layout.obstacles
    gaps = np.abs(middle[:, None] - obstacles.centers) - half[:, None]
    return np.asarray((gaps < obstacles.halves).all(axis=-1).sum(axis=1))


def _draw_places(layout: Layout, attach: Array, hang: float, rng: Generator) -> Array:
    """Draw places (P, 3) of the tool mount in the world, for a head whose shaft ends at a point (3,).

    Args:
        layout: has the arm.
        attach: where the shaft ends, in the world.
        hang: how far the head goes below that point.
        rng: random numbers.
    """
    least, most = _find_drop(layout, attach, hang)
    reach = layout.reach
    base = reach.base.position
    ahead = reach.find_heading(layout.home.position)
    angles = ahead + rng.uniform(-_SECTOR_RAD, _SECTOR_RAD, _PLACES)
    radii = rng.uniform(reach.inner, reach.outer, _PLACES)
    heights = attach[2] + rng.uniform(least, most, _PLACES)
    return np.column_stack(
        [base[0] + radii * np.cos(angles), base[1] + radii * np.sin(angles), heights]
    )


def _find_drop(layout: Layout, attach: Array, hang: float) -> tuple[float, float]:
    """Find how far the mount may be above the end of a shaft, at least and at most, metres; see `_draw_places`.

    It may be so far that a head which hangs at home stays above the ground there. Where the head works above home, the
    mount may stay as low as home.
    """
    x, y, home = layout.home.position
    low = np.array([x - _BESIDE_HOME_M, y - _BESIDE_HOME_M])
    ground = layout.top_at(low, low + 2 * _BESIDE_HOME_M, below=home)

    room = home - ground - hang - _OVER_GROUND_M
    most = float(np.clip(room, _LEAST_DROP_M + _DROP_PLAY_M, _MOST_DROP_M))
    least = float(np.clip(home - attach[2], -_MOST_DROP_M, _LEAST_DROP_M))
    return least, most
