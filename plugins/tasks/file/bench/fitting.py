"""Fit the numbers of a scene file that were seen to where they were seen, with their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares

from core.geometry import Array
from core.robot.solids import body_solids, closest
from core.scene import Scene
from plugins.tasks.file.bench.marks import Numbers
from plugins.tasks.file.bench.replies import Sighting
from plugins.tasks.file.bench.views import View
from plugins.tasks.file.task import FileTask

PIXEL_PX = 6.0  # how well a model points
PLACE_M = 0.1  # how well it says a place, one standard deviation
TURN_DEG = 20.0
SIZE_SHARE = 0.4
CAMERA_M = 0.006  # what the pose of a camera adds to the error of a place
TOUCHES_M = 0.003
APART_M = 0.0003  # what touches may come apart
OFF_PX = 25.0  # what is missed by more is a fault
_FAR = 2.0  # standard deviations that a number may be off
_CALLS = 40


@dataclass
class Fit:
    """What was fitted: numbers by their paths, their errors, m or degrees, and a line for each sighting far off."""

    values: dict[str, float] = field(default_factory=dict)
    errors: dict[str, float] = field(default_factory=dict)
    misses: list[str] = field(default_factory=list)


def fit_seen(
    task: FileTask, numbers: Numbers, seen: Sequence[tuple[Sighting, View]]
) -> Fit:
    """Fit places, turns and sizes that are marked as seen, all at once.

    What touches something goes on touching it. What was not sighted stays.
    """
    scene = task.scene(0)
    names = {body.name for body in scene.bodies}
    seen = [pair for pair in seen if pair[0].body in names]
    sighted = {sighting.body for sighting, _ in seen}
    near = {name for pair in find_gaps(scene, sighted) for name in pair}
    # What overlaps by more is a mistake, and not held.
    found = find_gaps(scene, sighted | near).items()
    gaps = {pair: gap for pair, gap in found if gap > -TOUCHES_M}
    unknowns = _find_unknowns(numbers, sighted, near - sighted)
    fit = Fit()
    if not unknowns:
        return fit

    def move(shifted: Array) -> dict[str, float]:
        values = dict[str, float]()
        for unknown, by in zip(unknowns, shifted.tolist(), strict=True):
            for path, spread in unknown.items():
                values[path] = numbers.values[path] + spread * (by - 1)

        return values

    def miss(shifted: Array) -> Array:
        scene = task.with_numbers(move(shifted))
        off = np.concatenate([off_px(scene, *pair) for pair in seen]) / PIXEL_PX
        # What is far off counts less: a point that was taken for another one.
        softened = off / np.sqrt(1 + np.abs(off) / 4)
        apart = [(measure_gap(scene, *pair) - gaps[pair]) / APART_M for pair in gaps]
        return np.concatenate([softened, apart, shifted - 1])

    # Steps of differences are shares of a number, so that it may not be 0.
    start = np.ones(len(unknowns))
    around = (1 - _FAR, 1 + _FAR)
    solution = least_squares(
        miss, start, diff_step=1e-3 * start, bounds=around, max_nfev=_CALLS
    )
    slopes: Array = np.asarray(solution.jac)
    errors = 2 * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    fit.values = move(solution.x)
    for unknown, error in zip(unknowns, errors.tolist(), strict=True):
        path, spread = next(iter(unknown.items()))
        fit.errors[path] = spread * error + CAMERA_M

    scene = task.with_numbers(fit.values)
    for sighting, view in seen:
        off = off_px(scene, sighting, view)
        if np.abs(off).max() > OFF_PX:
            fit.misses.append(
                f"{sighting.body}, seen at {list(sighting.pixels)} in photo{sighting.photo}, would be {np.round(off)} "
                "pixels from there; correct the pixels, the point, or its place and size; leave out what is hidden"
            )

    return fit


def off_px(scene: Scene, sighting: Sighting, view: View) -> Array:
    """Compute by how many pixels a scene misses a sighting: (2,) of a point, (4,) of a box; 0 where that is hidden."""
    body = scene[sighting.body]
    geoms = body.collisions or body.visuals
    frame = body.pose
    local = [geom.pose.apply(geom.shape.to_trimesh().vertices) for geom in geoms]
    corners = np.concatenate(local)
    if sighting.part is not None:
        geom = geoms[sighting.part % len(geoms)]
        frame = frame @ geom.pose
        corners = geom.shape.to_trimesh().vertices

    low = corners.min(axis=0)
    high = corners.max(axis=0)
    point = (low + high) / 2 + np.array(sighting.point) * (high - low) / 2
    drawn = view.project(frame.apply([point]))[0]
    if len(sighting.pixels) == 4:
        pixels = view.project(frame.apply(corners))
        drawn = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])

    off: Array = drawn - np.array(sighting.pixels, dtype=np.float64)
    return np.where(np.isnan(off), 0.0, off)


def find_gaps(scene: Scene, names: set[str]) -> dict[tuple[str, str], float]:
    """Find the pairs of bodies that touch, of which one has such a name, and the gaps between them, m."""
    found = dict[tuple[str, str], float]()
    solid = [body.name for body in scene.bodies if body.collisions]
    for number, name in enumerate(solid):
        for other in solid[:number]:
            if names & {name, other}:
                gap = measure_gap(scene, other, name)
                if gap < TOUCHES_M:
                    found[other, name] = gap

    return found


def measure_gap(scene: Scene, name: str, other: str) -> float:
    """Measure the signed distance of two bodies, m."""
    return closest(tuple(body_solids(scene[name])), tuple(body_solids(scene[other])))[0]


def _find_unknowns(
    numbers: Numbers, sighted: set[str], near: set[str]
) -> list[dict[str, float]]:
    """Find what is fitted: numbers of sighted bodies and marks that were seen, and places of what is near.

    Numbers that change together are in one mapping, with one standard deviation of each: boxes that are parts, and not
    turned, become longer together along an axis.
    """
    found = dict[str, dict[str, float]]()
    for path, mark in numbers.marks.items():
        _, name, *rest = path.split(".")
        follows = name in near and rest[0] == "position" and mark != "told"
        if not (follows or (name in sighted and mark == "seen")):
            continue

        group = path
        spread = SIZE_SHARE * numbers.values[path]
        whole = rest[0] == "parts" and rest[2] in ("box", "position")
        if whole and f"bodies.{name}.parts.{rest[1]}.rpy_deg.yaw" not in numbers.values:
            group = f"{name}.{rest[-1]}"
        elif "position" in rest:
            spread = PLACE_M
        elif "rpy_deg" in rest:
            spread = TURN_DEG

        found.setdefault(group, {})[path] = spread

    return list(found.values())
