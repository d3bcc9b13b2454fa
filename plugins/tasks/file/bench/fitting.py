"""Fit the numbers of a scene file that were seen, and the cameras that saw them, all at once; say how sure they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from core.errors import UserError
from core.geometry import Array, Shape
from core.scene import Body, Scene
from core.solids.standing import OVERLAP_M
from plugins.tasks.file.bench.cameras import Bundle
from plugins.tasks.file.bench.marks import Numbers
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.scene_replies import Sighting
from plugins.tasks.file.bench.touching import Touching
from plugins.tasks.file.bench.views import View
from plugins.tasks.file.task import FileTask

PIXEL_PX = 6.0  # how well a model points, one standard deviation
BASE = "robot_base"
"""A sighting of the middle of the arm's foot, which stands at the world's origin, has this name."""
BASE_PX = 20.0  # how well its middle is pointed at: the arm stands on it
LEAST_PX = 1.5  # nobody points better
PLACE_M = 0.1  # how well it says a place
TURN_DEG = 20.0
SIZE_SHARE = 0.4
APART_M = 0.0001  # what touches may come apart
OFF_PX = 25.0  # what is missed by more is a fault
BENCHES = 64  # that fit what was seen
_BLOCKS = 100  # of draws, of which the widest are tried
_TRIED = 4  # of these at most: in some draws bodies overlap
_FAR = 2.0  # standard deviations that a number may be off
_FAR_CAMERA = 6.0
_STEP = 1e-3  # of a standard deviation, of slopes
_CALLS = 60
_ENOUGH = 1e-3
_POINTED = 4.0  # sightings that `PIXEL_PX` counts as
_LEAST = 0.01  # of the largest slope of gaps: smaller ones are none
_TOUCHED = 3  # steps by which what touches is brought together again
_GUESSED = (
    0.7  # of its first standard deviation: a number that keeps so much is still a guess
)


@dataclass(frozen=True)
class Evidence:
    """What is known of a bench.

    Attributes:
        photographs: of it.
        sightings: what was seen in them.
        foot: (3,) where the middle of the arm's foot stands, in the world of the cameras.
        freed: told numbers that are fitted all the same, by their paths; those of one group by one share of each.
    """

    photographs: Sequence[Photograph]
    sightings: Sequence[Sighting]
    foot: tuple[float, ...] = (0.0, 0.0, 0.0)
    freed: tuple[tuple[str, ...], ...] = ()

    @property
    def sighted(self) -> set[str]:
        """The names of the bodies and marks that were seen in a photograph."""
        return {sighting.body for sighting in self.sightings}


@dataclass
class Fit:
    """What was fitted.

    Attributes:
        values: numbers by their paths, m or degrees.
        measured: the paths of those that photographs fix; the others are the model's guesses.
        benches: up to `BENCHES` values of each, all of which fit what was seen; those of one place belong together. The
            first are ``values``.
        views: of photographs by their numbers, from 0, as they were fitted.
        moves: how many standard deviations, at most, each camera is from where it was measured.
        off_px: by how much what was seen in each photograph is missed, root mean square, pixels.
        misses: a line for each sighting far off.
        base_px: by how much the middle of the arm's foot is missed at most, pixels.
        pixel_px: how well sightings seem to point, one standard deviation.
        misfit: of all that was seen and measured, a sum of squares of standard deviations, at first.
        count: how many numbers were seen or measured.
        cameras: by how much the cameras were shifted at first, in standard deviations (`Bundle`).
    """

    values: dict[str, float] = field(default_factory=dict)
    measured: set[str] = field(default_factory=set)
    benches: dict[str, list[float]] = field(default_factory=dict)
    views: dict[int, View] = field(default_factory=dict)
    moves: dict[int, float] = field(default_factory=dict)
    off_px: dict[int, float] = field(default_factory=dict)
    misses: list[str] = field(default_factory=list)
    base_px: float = 0.0
    pixel_px: float = PIXEL_PX
    misfit: float = 0.0
    count: int = 0
    cameras: Array = field(default_factory=lambda: np.zeros(0))


def fit_seen(task: FileTask, numbers: Numbers, evidence: Evidence) -> Fit:
    """Fit places, turns and sizes that are marked as seen, and the cameras, all at once (bundle adjustment).

    What was measured of a camera, and what the model says of a number, are priors. What touches something goes on
    touching it. What was not sighted stays.
    """
    problem = _Problem(task, numbers, evidence)
    fit = Fit()
    if not problem.unknowns:
        return fit

    best, slopes = _solve(problem, np.zeros(problem.size))
    count = len(problem.unknowns)
    # How well a person points shows in what is left.
    problem.pixel_px = fit.pixel_px = _estimate_error(problem, best, slopes)
    fit.misfit = problem.measure_misfit(best)
    fit.count = problem.count
    fit.cameras = best[count:]
    problem.keep_apart(best)
    best, slopes = _solve(problem, best)
    fit.values = problem.name(best[:count])
    spread = np.linalg.inv(np.linalg.cholesky(slopes.T @ slopes)).T
    for unknown, moves in zip(problem.unknowns, spread, strict=False):
        if np.linalg.norm(moves) < _GUESSED:
            fit.measured.update(unknown)

    fit.benches = _draw_benches(problem, best, slopes, spread)

    scene = task.with_numbers(fit.values)
    views = problem.bundle.move(best[count:])
    fit.base_px = problem.measure_base(best)
    fit.moves = problem.bundle.measure_moves(best[count:])
    for number, view in views.items():
        here = [s for s in problem.seen if s.photo == number + 1]
        fit.views[number] = view
        offs = [measure_off(place_points(scene, s), s, view) for s in here]
        square = np.mean(np.concatenate([*offs, np.zeros(1)]) ** 2)
        fit.off_px[number] = float(np.sqrt(square))
        fit.misses += [
            _describe_miss(sighting, off)
            for sighting, off in zip(here, offs, strict=True)
            if np.abs(off).max() > OFF_PX
        ]

    return fit


class Trial(NamedTuple):
    """What comes of other evidence.

    Attributes:
        misfit: of all that was seen and measured, a sum of squares of standard deviations.
        values: the numbers of the scene by their paths.
    """

    misfit: float
    values: dict[str, float]


def try_evidence(
    task: FileTask,
    numbers: Numbers,
    evidence: Evidence,
    fit: Fit,
    *,
    solved: bool,
) -> Trial:
    """Measure how badly other evidence fits, from the fit or from the scene as it was written: what is better.

    Args:
        task: the scene as it was written.
        numbers: its numbers, with their marks.
        evidence: what was seen where, supposedly.
        fit: of what was seen in fact.
        solved: whether it is fitted; else this is quick, and the misfit is larger.
    """
    problem = _Problem(task, numbers, evidence)
    problem.pixel_px = fit.pixel_px
    starts = [problem.find_start(fit), np.zeros(problem.size)]
    start = min(starts, key=problem.measure_misfit)
    if solved and problem.unknowns:
        start, _ = _solve(problem, start)

    values = problem.name(start[: len(problem.unknowns)])
    return Trial(problem.measure_misfit(start), values)


class _Problem:
    """What is fitted, in standard deviations of what was known: first the scene's numbers, then the cameras'.

    Attributes:
        unknowns: of the scene: numbers that change together, and the standard deviation of each.
        seen: sightings of bodies of the scene, in photographs whose camera is known.
        bundle: the cameras.
        pixel_px: how well a sighting points, one standard deviation.
        size: how many unknowns there are in all.
        most: (size,) how far each may be off.
        seen_values: how many numbers of pixels were sighted.
    """

    def __init__(
        self,
        task: FileTask,
        numbers: Numbers,
        evidence: Evidence,
    ) -> None:
        scene = task.scene(0)
        photographs = evidence.photographs
        sightings = evidence.sightings
        names = {body.name for body in scene.bodies}
        known = {n for n, photograph in enumerate(photographs, 1) if photograph.view}
        self.bundle = Bundle(photographs)
        self.pixel_px = PIXEL_PX
        self.seen = [s for s in sightings if s.body in names and s.photo in known]
        self._bases = [s for s in sightings if s.body == BASE and s.photo in known]
        self._foot = np.array([evidence.foot])
        sighted = {sighting.body for sighting in self.seen}
        self._touching = Touching(scene, sighted)
        follow = (self._touching.names - sighted) | self._touching.sunk
        self.unknowns = _find_unknowns(numbers, evidence, follow)
        self.seen_values = sum(len(sighting.pixels) for sighting in self.seen)
        self.size = len(self.unknowns) + self.bundle.size
        self.most = np.full(self.size, _FAR_CAMERA)
        self.most[: len(self.unknowns)] = _FAR
        self._task = task
        self._numbers = numbers

        self._look = lru_cache(maxsize=4)(self._measure)

    def name(self, shifted: Array) -> dict[str, float]:
        """Return the scene's numbers by their paths."""
        values = dict[str, float]()
        for unknown, by in zip(self.unknowns, shifted.tolist(), strict=True):
            for path, spread in unknown.items():
                values[path] = self._numbers.values[path] + spread * by

        return values

    def find_start(self, fit: Fit) -> Array:
        """Find what a fit of the same photographs found, as a start (size,); what it lacks begins as it was written."""
        start = np.zeros(self.size)
        start[len(self.unknowns) :] = fit.cameras
        for number, unknown in enumerate(self.unknowns):
            path, spread = max(unknown.items(), key=lambda item: abs(item[1]))
            if path in fit.values:
                start[number] = (fit.values[path] - self._numbers.values[path]) / spread

        return start.clip(-self.most, self.most)

    def keep_apart(self, shifted: Array) -> None:
        """Keep bodies apart that are near each other in a fit, and let what has lost its support rest again.

        Before, they may pass through each other: a ball that began beside its channel finds the way into it.
        """
        count = len(self.unknowns)
        scene = self._task.with_numbers(self.name(shifted[:count]))
        self._touching.keep_apart(scene)
        self._look.cache_clear()

    def read_gaps(self, shifted: Array) -> Array:
        """Measure by how much what touches has come apart, or what is apart overlaps, m."""
        return self._look(shifted[: len(self.unknowns)].tobytes())[1]

    def miss(self, shifted: Array) -> Array:
        """Compute all that is to be small: what is seen elsewhere, comes apart, or differs from what is known.

        Returns:
            The sightings' values first, then those of `read_gaps`, as standard deviations.
        """
        count = len(self.unknowns)
        points, apart = self._look(shifted[:count].tobytes())
        views = self.bundle.move(shifted[count:])
        off = _soften(self._miss_sightings(points, views) / self.pixel_px)
        landmarks = self.bundle.miss(views, shifted[count:])
        bases = _soften(self._miss_bases(views) / BASE_PX)
        self.count = len(off) + len(landmarks) + len(bases)
        return np.concatenate([off, apart / APART_M, landmarks, bases, shifted])

    def measure_misfit(self, shifted: Array) -> float:
        """Measure how badly all fits, a sum of squares of standard deviations."""
        return float(np.sum(self.miss(shifted) ** 2))

    def slope(self, shifted: Array) -> Array:
        """Compute the slopes of `miss`, by differences: a scene is built for its own numbers only."""
        before = self.miss(shifted)
        steps = _STEP * np.eye(self.size)
        columns = [(self.miss(shifted + step) - before) / _STEP for step in steps]
        return np.stack(columns, axis=1)

    def select_gaps(self, slopes: Array) -> Array:
        """Take from the slopes of `miss` those of `read_gaps` over the scene's numbers."""
        last = self.seen_values + len(self._touching.pairs)
        rows: Array = slopes[self.seen_values : last, : len(self.unknowns)]
        return APART_M * rows

    def measure_base(self, shifted: Array) -> float:
        """Measure by how many pixels the middle of the arm's foot is missed at most."""
        views = self.bundle.move(shifted[len(self.unknowns) :])
        return float(np.abs(self._miss_bases(views)).max(initial=0.0))

    def _miss_bases(self, views: Mapping[int, View]) -> Array:
        """Compute by how many pixels the middle of the arm's foot is missed, where it is seen."""
        off = [np.zeros(0)]
        for sighting in self._bases:
            drawn = views[sighting.photo - 1].project(self._foot)
            off.append(subtract_pixels(drawn, sighting))

        return np.concatenate(off)

    def _miss_sightings(
        self, points: Sequence[Array], views: Mapping[int, View]
    ) -> Array:
        off = [np.zeros(0)]
        for number, view in views.items():
            here = [n for n, s in enumerate(self.seen) if s.photo == number + 1]
            if here:
                drawn = view.project(np.concatenate([points[n] for n in here]))
                ends = np.cumsum([len(points[n]) for n in here])
                parts = np.split(drawn, ends[:-1])
                for index, pixels in zip(here, parts, strict=True):
                    off.append(subtract_pixels(pixels, self.seen[index]))

        return np.concatenate(off)

    def _measure(self, shifted: bytes) -> tuple[list[Array], Array]:
        scene = self._task.with_numbers(self.name(np.frombuffer(shifted)))
        points = _place_all(scene, self.seen)
        return points, self._touching.measure(scene)


def _soften(off: Array) -> Array:
    """Let what is far off count less: a point that was taken for another one."""
    softened: Array = off / np.sqrt(1 + np.abs(off) / 4)
    return softened


def _solve(problem: _Problem, start: Array) -> tuple[Array, Array]:
    """Find what fits best, and the slopes of `_Problem.miss` there."""
    solution = least_squares(
        problem.miss,
        start,
        problem.slope,
        bounds=(-problem.most, problem.most),
        ftol=_ENOUGH,
        xtol=_ENOUGH,
        max_nfev=_CALLS,
    )
    return solution.x, np.asarray(solution.jac)


def _estimate_error(problem: _Problem, best: Array, slopes: Array) -> float:
    """Estimate how well sightings point, pixels, from what they are missed by; few of them say little."""
    left = np.trace(np.linalg.inv(slopes.T @ slopes))
    missed = problem.miss(best)[: problem.seen_values]
    # Unknowns that sightings decide make what they are missed by smaller.
    free = max(len(missed) - (problem.size - left), 0.0)
    square = _POINTED * PIXEL_PX**2 + np.sum((problem.pixel_px * missed) ** 2)
    return max(float(np.sqrt(square / (_POINTED + free))), LEAST_PX)


def _draw_benches(
    problem: _Problem, best: Array, slopes: Array, spread: Array
) -> dict[str, list[float]]:
    """Draw benches from what fits, linearised about the best one; those in which bodies overlap are none.

    ``spread`` (size, size) is a root of the covariance. What touches is brought together again: a turn lifts
    it by a second order.
    """
    count = len(problem.unknowns)
    # What hardly moves a gap would have to move far.
    back = np.linalg.pinv(problem.select_gaps(slopes), rcond=_LEAST)
    benches = {path: [value] for path, value in problem.name(best[:count]).items()}
    drawn = 1
    for errors in _draw_errors(spread[:count]):
        shifted = best + spread @ errors
        shifted = shifted.clip(-problem.most, problem.most)
        try:
            apart = problem.read_gaps(shifted)
            for _ in range(_TOUCHED):
                if np.abs(apart).max(initial=0.0) > APART_M:
                    shifted[:count] -= back @ apart
                    apart = problem.read_gaps(shifted)
        except UserError:  # a size below zero
            continue

        if np.abs(apart).max(initial=0.0) > OVERLAP_M:
            continue

        for path, value in problem.name(shifted[:count]).items():
            benches[path].append(value)

        drawn += 1
        if drawn == BENCHES:
            break

    return benches


def _draw_errors(spread: Array) -> Iterator[Array]:
    """Yield errors (size,), each of standard deviation 1, which move numbers by ``spread`` (N, size).

    Few draws differ by luck: 63 of them made every yaw of a channel 28 % too sure. So a block of them has exactly that
    mean and covariance. Those blocks come first in which all numbers reach far to both sides.
    """
    rng = np.random.default_rng(0)
    blocks = [_draw_block(rng, spread.shape[1]) for _ in range(_BLOCKS)]
    per_deviation = spread / np.linalg.norm(spread, axis=1, keepdims=True)

    def measure_reach(block: Array) -> float:
        moves = block @ per_deviation.T
        return float(np.minimum(moves.max(axis=0), -moves.min(axis=0)).min())

    for block in sorted(blocks, key=measure_reach, reverse=True)[:_TRIED]:
        yield from block


def _draw_block(rng: np.random.Generator, size: int) -> Array:
    """Draw `BENCHES` - 1 errors (N, size) of mean 0 and covariance 1; slices of N - 1 may be correlated by chance."""
    count = BENCHES - 1  # the best one comes first
    block = rng.standard_normal((count, size))
    block -= block.mean(axis=0)
    for begin in range(0, size, count - 1):
        columns = slice(begin, begin + count - 1)
        block[:, columns] = np.sqrt(count) * np.linalg.qr(block[:, columns]).Q

    return block


def _describe_miss(sighting: Sighting, off: Array) -> str:
    return (
        f"{sighting.body}, seen at {list(sighting.pixels)} in photo{sighting.photo}, would be {np.round(off)} "
        "pixels from there; correct the pixels, the point, or its place and size; leave out what is hidden"
    )


def list_corners(body: Body) -> Array:
    """List the corners (N, 3) of a body's shapes, in its frame."""
    geoms = body.collisions or body.visuals
    return np.concatenate([g.pose.apply(_find_corners(g.shape)) for g in geoms])


def place_points(scene: Scene, sighting: Sighting) -> Array:
    """Return what was sighted, in the world: one point (1, 3), or all corners (N, 3) of a body in a box."""
    (points,) = _place_all(scene, [sighting])
    return points


def _place_all(scene: Scene, sightings: Sequence[Sighting]) -> list[Array]:
    """Return what was sighted, in the world (`place_points`)."""
    boxes = dict[tuple[str, int | None], _Box]()
    points = []
    for sighting in sightings:
        is_point = len(sighting.pixels) == 2
        which = (sighting.body, sighting.part if is_point else None)
        if which not in boxes:
            boxes[which] = _find_box(scene[sighting.body], which[1])

        box = boxes[which]
        point = box.middle + np.array([sighting.point]) @ box.edges
        points.append(point if is_point else box.corners)

    return points


class _Box(NamedTuple):
    """The box of a body or part along its own axes, in the world: all corners (N, 3) of what is in it, its middle (3,),
    and half of each of its edges, as rows (3, 3)."""

    corners: Array
    middle: Array
    edges: Array


def _find_box(body: Body, part: int | None) -> _Box:
    frame = body.pose
    corners = list_corners(body)
    if part is not None:
        geoms = body.collisions or body.visuals
        geom = geoms[part % len(geoms)]
        frame = frame @ geom.pose
        corners = _find_corners(geom.shape)

    low = corners.min(axis=0)
    high = corners.max(axis=0)
    ends = (low + high) / 2 + np.concatenate(
        [np.zeros((1, 3)), np.diag(high - low)]
    ) / 2
    middle, *others = frame.apply(ends)
    return _Box(frame.apply(corners), middle, np.array(others) - middle)


def measure_off(points: Array, sighting: Sighting, view: View) -> Array:
    """Compute by how many pixels points miss a sighting: (2,) of one, (4,) of a box; 0 where that is hidden."""
    return subtract_pixels(view.project(points), sighting)


def subtract_pixels(drawn: Array, sighting: Sighting) -> Array:
    """Compute by how many pixels a sighting is missed by what is drawn: (N, 2) pixels of its points."""
    if len(sighting.pixels) == 4:
        drawn = np.concatenate([drawn.min(axis=0), drawn.max(axis=0)])

    off: Array = drawn.ravel() - np.array(sighting.pixels, dtype=np.float64)
    return np.where(np.isnan(off), 0.0, off)


@lru_cache(maxsize=512)
def _find_corners(shape: Shape) -> Array:
    return np.asarray(shape.to_trimesh().vertices)


WHOLE = frozenset(("count", "counts", "pinned", "grid", "ring", "heap"))
"""Keys of whole numbers, which are counted and not fitted."""


def _find_unknowns(
    numbers: Numbers, evidence: Evidence, follow: set[str]
) -> list[dict[str, float]]:
    """Find what is fitted: numbers of sighted bodies and marks that were seen, and places of what follows.

    Numbers that change together are in one mapping, with one standard deviation of each: boxes that are parts, and not
    turned, become longer together along an axis, unless both ends of each part were seen.
    """
    sighted = evidence.sighted
    proportioned = _find_proportioned(numbers, evidence.sightings)
    groups = {path: group for group in evidence.freed for path in group}
    found = dict[str, dict[str, float]]()
    for path, mark in numbers.marks.items():
        _, name, *rest = path.split(".")
        if not WHOLE.isdisjoint(rest):
            continue

        follows = name in follow and rest[0] == "position" and mark != "told"
        is_seen = name in sighted and mark == "seen"
        if not (follows or is_seen or path in groups):
            continue

        group = str(groups.get(path, path))
        spread = SIZE_SHARE * numbers.values[path]
        whole = rest[0] == "parts" and rest[2] in ("box", "position")
        if whole and f"bodies.{name}.parts.{rest[1]}.rpy_deg.yaw" not in numbers.values:
            if (name, rest[-1]) not in proportioned and path not in groups:
                group = f"{name}.{rest[-1]}"
        elif path in groups:
            spread = numbers.values[path]
        elif "position" in rest:
            spread = PLACE_M
        elif "rpy_deg" in rest:
            spread = TURN_DEG

        found.setdefault(group, {})[path] = spread

    return [unknown for unknown in found.values() if any(unknown.values())]


def _find_proportioned(
    numbers: Numbers, sightings: Sequence[Sighting]
) -> set[tuple[str, str]]:
    """Find bodies of parts, and axes along which points at both ends of each part were seen."""
    ends = set[tuple[str, str, str, bool]]()
    for sighting in sightings:
        if sighting.part is not None and len(sighting.pixels) == 2:
            for axis, value in zip("xyz", sighting.point, strict=True):
                if value:
                    ends.add((sighting.body, str(sighting.part), axis, value > 0))

    free = set[tuple[str, str]]()
    hidden = set[tuple[str, str]]()
    for path in numbers.marks:
        _, name, *rest = path.split(".")
        if rest[0] != "parts":
            continue

        for axis in "xyz":
            free.add((name, axis))
            wanted = {(name, rest[1], axis, side) for side in (True, False)}
            if not wanted <= ends:
                hidden.add((name, axis))

    return free - hidden
