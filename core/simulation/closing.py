"""Choose the camera with which a film ends: close to what the task wants, from where that is not hidden."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from core.designs.sighting import measure_box
from core.geometry import Array
from core.goals import reaches
from core.interfaces import Image, Task
from core.robot.solids import box_corners
from core.scene import Camera, Scene, State

STANDS_DEG = ((0, 38), (-45, 38), (45, 38), (0, 65), (-100, 38), (100, 38))
"""How far cameras stand around the goal from the task's own, and how high they look down on it, degrees."""

FOV_DEG = 40.0
ROOM = 1.5  # of what is looked at, how much the picture shows
LEAST_M = 0.2  # half the side of what is looked at, at least
MOST_M = 0.5  # and at most
LARGE_M = 1.2  # what is larger, as a table, sets no picture
PREFERENCE = (
    0.003  # of what is seen, how much less a camera counts by degree of its turn
)
DIFFERENT = 12  # of 255: a pixel that differs by more shows the body
AWAY_M = -50.0  # along z, where bodies are moved to find out where they are seen

Look = Callable[[Camera, State], Image]
"""Draws the end of a film in another state, in a small picture."""


def choose_closing(task: Task, scene: Scene, end: State, draw: Look) -> Camera | None:
    """Choose the camera in which most of the bodies of the goals is seen at the end, and which turned least for it.

    Where a body is seen shows by what is different without it, so that every engine's own pictures decide.

    Args:
        task: whose goals say what is looked at.
        scene: the layout, with the bodies at their start.
        end: of the rollout, one world.
        draw: the end of the rollout.

    Returns:
        A camera; None: the task has no goal with a body.
    """
    bodies = _list_bodies(task, scene)
    if not bodies:
        return None

    corners = np.concatenate([*_points(task, scene, end, bodies)])
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    half = float(np.clip(np.ptp(corners, axis=0).max() / 2, LEAST_M, MOST_M))
    without = _take_away(end, bodies)

    best = None
    most = -1.0
    for turn_deg, height_deg in STANDS_DEG:
        camera = _stand(task.camera, middle, half, turn_deg, height_deg)
        seen = draw(camera, end).astype(int)
        behind = draw(camera, without).astype(int)
        count = int((np.abs(seen - behind).max(axis=-1) > DIFFERENT).sum())
        worth = count * (1 - PREFERENCE * abs(turn_deg))
        if worth > most:
            most = worth
            best = camera

    return best


def fly(before: Camera, after: Camera, share: float) -> Camera:
    """Return the camera on the straight way from one to another; ``share`` of the way is done, 0 to 1."""
    eased = share * share * (3 - 2 * share)
    begin = np.array([*before.position, *before.target, before.fov_deg])
    end = np.array([*after.position, *after.target, after.fov_deg])
    *place, fov_deg = (begin + eased * (end - begin)).tolist()

    return Camera(tuple(place[:3]), tuple(place[3:]), fov_deg)


def _stand(
    camera: Camera, middle: Array, half: float, turn_deg: float, height_deg: float
) -> Camera:
    """Make a camera that shows a cube of the half side ``half``, m, around a point, turned from another camera."""
    metres = ROOM * half / np.tan(np.radians(FOV_DEG) / 2)
    x, y, _ = np.subtract(camera.position, camera.target)
    around = np.arctan2(y, x) + np.radians(turn_deg)
    height = np.radians(height_deg)
    level = np.array([np.cos(around), np.sin(around), 0.0])
    upward = np.array([0.0, 0.0, np.sin(height)])
    place = middle + metres * (np.cos(height) * level + upward)
    return Camera(tuple(place.tolist()), tuple(middle.tolist()), FOV_DEG)


def _list_bodies(task: Task, scene: Scene) -> list[str]:
    """Name the bodies of the goals that can move."""
    start = scene.state()
    names = dict[str, None]()
    for goal in reaches(task.goals):
        names |= dict.fromkeys(goal.subjects(start))

    return [name for name in names if name in start.names]


def _points(
    task: Task, scene: Scene, end: State, names: Sequence[str]
) -> Iterator[Array]:
    """Yield points (N, 3) of what is to be seen: bodies at the end, where the goals want them, and what these name."""
    start = scene.state()
    bodies = {body.name: body for body in scene.bodies}
    boxes = {}
    for name in names:
        boxes[name] = _box(scene, name)
        yield end.pose(name).apply(boxes[name])

    for goal in reaches(task.goals):
        other = bodies.get(goal.reference or "")
        if other is not None:
            corners = other.pose.apply(_box(scene, other.name))
            if np.ptp(corners, axis=0).max() < LARGE_M:
                yield corners

        for name in goal.subjects(start):
            if name not in boxes:
                continue
            if goal.from_start:
                yield start.pose(name).apply(boxes[name])
            place = goal.place_of(name, start)
            if place is not None:
                known = np.where(np.isnan(place), end.position(name), place)
                yield known[None]


def _box(scene: Scene, body: str) -> Array:
    """Return the corners (8, 3) of a body's bounding box in its own frame."""
    middle, half = measure_box(scene, body)
    return box_corners(middle - half, middle + half)


def _take_away(state: State, names: Sequence[str]) -> State:
    """Return a state in which bodies are far below all others."""
    positions = state.positions.copy()
    numbers = [state.names.index(name) for name in names]
    positions[numbers, 2] += AWAY_M
    soft = {
        name: nodes + np.array((0.0, 0.0, AWAY_M)) if name in names else nodes
        for name, nodes in state.soft.items()
    }

    return replace(state, positions=positions, soft=soft)
