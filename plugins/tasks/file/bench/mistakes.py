"""Name what a person usually gets wrong with photographs: each mistake is tried by the same fit, the best is named."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from core.geometry import Pose
from plugins.tasks.file.bench.board import find_frame
from plugins.tasks.file.bench.fitting import BASE, Evidence, Fit, Trial, try_evidence
from plugins.tasks.file.bench.marks import Numbers
from plugins.tasks.file.bench.scene_replies import Sighting
from plugins.tasks.file.task import FileTask

POOR_PX = 5.0  # what is seen fits no better than that: something is suspected ...
FAR_BASE_PX = 80.0  # ... as it is if the arm's foot is missed by more than this
CLEAR = 30.0  # what a mistake explains has to be so many times what numbers are missed by without it
ALIKE = 0.8  # of what explains most: what explains so much is named, too
PRICE = 10.0  # of each number that a mistake leaves out or frees, in the same unit
LEAST = 0.1  # misfit of a number: less is luck
PRINTED = 0.02  # a board is printed as it should be if its scale is so near
_SOLVED = 2  # of the mistakes of a kind, those that begin best


@dataclass(frozen=True)
class Mistake:
    """A mistake that a person may have made, and the evidence without it.

    Attributes:
        words: what it is, with what to type or do.
        evidence: as it would be without the mistake.
        price: how many numbers that leaves out or frees.
        may_point: whether the model may only have pointed badly, so that it is asked again first.
    """

    words: str
    evidence: Evidence
    price: int = 0
    may_point: bool = False


class Referee:
    """Finds the mistake that explains what was seen much better.

    Args:
        task: the scene as it was written.
        numbers: its numbers, with their marks.
        evidence: the photographs as they were given, and what was seen in them.
        fit: of that.
        board: x, y (m) and yaw (degrees) of the printed board; empty: there is none.
        marker_mm: how wide its markers are said to be.
    """

    def __init__(
        self,
        task: FileTask,
        numbers: Numbers,
        evidence: Evidence,
        fit: Fit,
        board: Sequence[float],
        marker_mm: float,
    ) -> None:
        self._task = task
        self._numbers = numbers
        self._evidence = evidence
        self._fit = fit
        self._board = board
        self._marker_mm = marker_mm

    def find_mistake(self) -> Mistake | None:
        """Try all mistakes, and return the one that explains most; None: none does, or all fits as it is."""
        fit = self._fit
        if not fit.values:
            return None

        likely = list(self._doubt_told())
        is_far = fit.base_px > FAR_BASE_PX
        if fit.pixel_px > POOR_PX or fit.misses or is_far:
            changed = [
                *_swap_cameras(self._evidence),
                *_turn_photographs(self._evidence),
                *_turn_board(self._evidence, self._board),
            ]
            moved = list(_leave_out_moved(self._evidence))
            photographs = list(_leave_out_photographs(self._evidence))
            for mistakes in (changed, moved, photographs):
                mistakes.sort(key=self._measure_start)
                likely += mistakes[:_SOLVED]

        judged = [(self._judge(mistake), mistake) for mistake in likely]
        judged.sort(key=lambda pair: pair[0], reverse=True)
        least = max([CLEAR, *(ALIKE * explained for explained, _ in judged)])
        found = [mistake for explained, mistake in judged if explained >= least]
        if found:
            words = "; or ".join(mistake.words for mistake in found)
            may_point = any(mistake.may_point for mistake in found)
            return replace(found[0], words=words, may_point=may_point)

        if is_far:
            what = "board's place and yaw" if self._board else "cameras"
            words = (
                f"the middle of the robot's foot is seen {fit.base_px:.0f} pixels from the origin: measure the {what} "
                "again"
            )
            return Mistake(words, self._evidence, may_point=True)

        return None

    def _try(self, evidence: Evidence, *, solved: bool) -> Trial:
        return try_evidence(
            self._task, self._numbers, evidence, self._fit, solved=solved
        )

    def _measure_start(self, mistake: Mistake) -> float:
        """Measure how badly all fits before it is fitted to what is seen without a mistake."""
        return self._try(mistake.evidence, solved=False).misfit

    def _judge(self, mistake: Mistake) -> float:
        """Measure how much a mistake explains, in units of what a number is missed by if it was made."""
        misfit = self._try(mistake.evidence, solved=True).misfit
        unit = max(misfit / max(self._fit.count, 1), LEAST)
        return (self._fit.misfit - misfit) / unit - PRICE * mistake.price

    def _doubt_told(self) -> Iterator[Mistake]:
        """Suppose that a told number is another one, or that the board has another scale than it should."""
        before = self._numbers.values
        told = self._group_told()
        if not told:
            return

        freed = replace(self._evidence, freed=tuple(told))
        if self._judge(Mistake("", freed, len(told))) < CLEAR:
            return

        seen = self._try(freed, solved=True).values
        for group in told:
            path = group[0]
            words = (
                f"{path} is told as {before[path]:g}, and the photographs show {seen[path]:.3g}: measure it again, in "
                "metres and degrees"
            )
            yield Mistake(words, replace(self._evidence, freed=(group,)), 1)

        sizes = [
            path
            for group in told
            for path in group
            if "position" not in path and "rpy_deg" not in path
        ]
        if self._board and sizes:
            scale = sum(before[path] for path in sizes) / sum(seen[p] for p in sizes)
            if abs(scale - 1) > PRINTED:
                yield self._scale_board(scale, sizes)

    def _group_told(self) -> list[tuple[str, ...]]:
        """List the paths of what photographs should show as it was told; one number may stand in several places.

        Heights of places follow from what bears.
        """
        groups = dict[tuple[str, float], list[str]]()
        for path, mark in self._numbers.marks.items():
            name = path.split(".")[1]
            value = self._numbers.values[path]
            is_shown = value and not path.endswith("position.z")
            if mark == "told" and is_shown and name in self._evidence.sighted:
                groups.setdefault((name, value), []).append(path)

        return [tuple(group) for group in groups.values()]

    def _scale_board(self, scale: float, sizes: Sequence[str]) -> Mistake:
        """Suppose that the board was printed at a scale: all looks larger, and the foot farther."""
        x, y, _ = self._board
        middle = np.array([x, y, 0.0])
        foot = middle - middle / scale
        words = (
            f"the board was printed at {100 * scale:.0f} %, by the sizes that were told: measure a marker, and give "
            f"board_marker_mm={scale * self._marker_mm:.1f} if it is so"
        )
        freed = (tuple(sizes),)
        larger = replace(self._evidence, freed=freed, foot=tuple(foot.tolist()))
        return Mistake(words, larger, 1)


def _swap_cameras(evidence: Evidence) -> Iterator[Mistake]:
    """Suppose that two measured cameras were given in the wrong order."""
    given = evidence.photographs
    measured = [
        number
        for number, photograph in enumerate(given)
        if photograph.view is not None and not photograph.found
    ]
    for first, second in combinations(measured, 2):
        photographs = [*given]
        photographs[first] = replace(given[first], view=given[second].view)
        photographs[second] = replace(given[second], view=given[first].view)
        names = [given[number].picture.name for number in (first, second)]
        words = f"the cameras of {' and '.join(names)} are swapped: give cameras=[...] in the order of pictures=[...]"
        yield Mistake(words, replace(evidence, photographs=photographs))


def _turn_photographs(evidence: Evidence) -> Iterator[Mistake]:
    """Suppose that a photograph is upside down, or mirrored."""
    for number, photograph in enumerate(evidence.photographs, 1):
        if photograph.view is None or photograph.found:
            continue

        width, height = photograph.size
        name = photograph.picture.name
        for how, mend, flips in (
            ("upside down", "turn it by 180 degrees", (width, height)),
            ("mirrored", "give the picture as it was taken", (width, None)),
        ):
            sightings = [
                _flip(sighting, *flips) if sighting.photo == number else sighting
                for sighting in evidence.sightings
            ]
            words = f"{name} is {how}: {mend}"
            yield Mistake(words, replace(evidence, sightings=sightings))


def _flip(sighting: Sighting, width: float, height: float | None) -> Sighting:
    """Return a sighting with right and left, and with a height up and down, exchanged."""
    if len(sighting.pixels) == 2:
        x, y = sighting.pixels
        flipped = (width - x, y if height is None else height - y)
        return sighting.model_copy(update={"pixels": flipped})

    left, top, right, bottom = sighting.pixels
    sides = [None if side is None else width - side for side in (right, left)]
    ends = [top, bottom]
    if height is not None:
        ends = [None if end is None else height - end for end in (bottom, top)]

    pixels = (sides[0], ends[0], sides[1], ends[1])
    return sighting.model_copy(update={"pixels": pixels})


def _turn_board(evidence: Evidence, board: Sequence[float]) -> Iterator[Mistake]:
    """Suppose that the board lies otherwise than was said: all that is seen goes along, and the arm's foot does not."""
    if not board:
        return

    x, y, yaw = board
    places = [
        ("turned the other way", (x, y, -yaw)),
        ("turned by half a circle", (x, y, yaw + 180)),
        ("turned by a quarter", (x, y, yaw + 90)),
        ("turned by a quarter", (x, y, yaw - 90)),
        ("where x and y are exchanged", (y, x, yaw)),
        ("on the other side", (x, -y, yaw)),
        ("turned the other way, on the other side", (x, -y, -yaw)),
    ]
    for how, (there_x, there_y, there_yaw) in places:
        there = (there_x, there_y, (there_yaw + 180) % 360 - 180)
        if there != (x, y, yaw):
            moved: Pose = find_frame(board) @ find_frame(there).inverse()
            foot = tuple(moved.position.tolist())
            values = ",".join(f"{value:g}" for value in there)
            words = f"the board lies {how}: measure it again, and give board=[{values}] if it is so"
            yield Mistake(words, replace(evidence, foot=foot))


def _leave_out_moved(evidence: Evidence) -> Iterator[Mistake]:
    """Suppose that a body was moved before a photograph was taken."""
    places = {(sighting.body, sighting.photo) for sighting in evidence.sightings}
    for body, photo in sorted(places):
        others = [other for name, other in places if name == body and other != photo]
        # Of two photographs neither is the right one.
        is_second = others == [other for other in others if other > photo]
        if body == BASE or not others or (len(others) == 1 and is_second):
            continue

        name = evidence.photographs[photo - 1].picture.name
        words = (
            f"{body} lies elsewhere in {name} than in the other photographs: it was moved in between; take photographs "
            "again of the bench as it is"
        )
        yield _leave_out(evidence, photo, {body}, words, may_point=True)


def _leave_out_photographs(evidence: Evidence) -> Iterator[Mistake]:
    """Suppose that a photograph shows another bench, around the same robot."""
    names = [photograph.picture.name for photograph in evidence.photographs]
    for photo, name in enumerate(names, 1):
        if len(names) < 2 or (len(names) == 2 and photo == 1):
            continue  # of two photographs neither is the right one

        others = ", ".join(other for other in names if other != name)
        words = f"{name} shows another bench than {others}: take photographs again of the bench as it is"
        yield _leave_out(evidence, photo, evidence.sighted - {BASE}, words)


def _leave_out(
    evidence: Evidence,
    photo: int,
    bodies: set[str],
    words: str,
    *,
    may_point: bool = False,
) -> Mistake:
    """Suppose that what is seen of bodies in a photograph says nothing."""
    kept = [
        sighting
        for sighting in evidence.sightings
        if sighting.photo != photo or sighting.body not in bodies
    ]
    count = sum(len(s.pixels) for s in evidence.sightings) - sum(
        len(s.pixels) for s in kept
    )
    return Mistake(words, replace(evidence, sightings=kept), count, may_point)
