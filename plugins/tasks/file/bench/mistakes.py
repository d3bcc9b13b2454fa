"""Name what a person usually gets wrong with photographs, by trying which of it explains what was seen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from core.errors import UserError
from core.geometry import Array
from plugins.tasks.file.bench.board import find_frame
from plugins.tasks.file.bench.fitting import BASE, Evidence, Fit, measure_misfit
from plugins.tasks.file.bench.marks import Numbers
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.scene_replies import Sighting
from plugins.tasks.file.task import FileTask

BETTER = 0.4  # of the misfit as it is: what explains so much is the mistake
POOR = 4.0  # misfit per number that was seen: below it nothing is suspected ...
FAR_BASE_PX = 80.0  # ... unless the arm's foot is missed by more than this ...
NEAR_BASE_PX = 60.0  # ... which the mistake explains if it is missed by less then
_SOLVED = 2  # of the hypotheses, those that begin best


@dataclass(frozen=True)
class Hypothesis:
    """A mistake of the person, and the evidence without it.

    Attributes:
        words: what it is, with what to type or do.
        evidence: as it would be without the mistake.
        may_point: whether the model may only have pointed badly, so that it is asked again first.
    """

    words: str
    evidence: Evidence
    may_point: bool = False


def find_mistake(
    task: FileTask,
    numbers: Numbers,
    evidence: Evidence,
    fit: Fit,
    board: Sequence[float],
) -> Hypothesis | None:
    """Find the usual mistake that explains what was seen much better; None: none does, or all fits as it is.

    Args:
        task: the scene as it was written.
        numbers: its numbers, with their marks.
        evidence: the photographs as they were given, and what was seen in them.
        fit: of that.
        board: x, y (m) and yaw (degrees) of the printed board; empty: there is none.
    """
    count = sum(len(sighting.pixels) for sighting in evidence.sightings)
    if fit.base_px > FAR_BASE_PX:
        return _explain_base(task, numbers, evidence, fit.base_px, board)
    if fit.misfit < POOR * max(count, 1) and not fit.misses:
        return None

    def measure(hypothesis: Hypothesis, *, solved: bool) -> float:
        bare = hypothesis.evidence
        return measure_misfit(task, numbers, bare, solved=solved).total

    hypotheses = [
        *_swap_cameras(evidence),
        *_turn_photographs(evidence),
        *_leave_out_moved(evidence),
    ]
    hypotheses.sort(key=lambda hypothesis: measure(hypothesis, solved=False))
    likely = hypotheses[:_SOLVED]
    after = {measure(found, solved=True): found for found in reversed(likely)}
    least = min(after, default=math.inf)
    return after[least] if least < BETTER * fit.misfit else None


def _explain_base(
    task: FileTask,
    numbers: Numbers,
    evidence: Evidence,
    base_px: float,
    board: Sequence[float],
) -> Hypothesis:
    """Say why the arm's foot is seen far from the origin: all that is seen stands otherwise than the board says.

    What was written of the scene says nothing of it, since the model saw the bench as the board placed it.
    """
    hypotheses = [*_swap_cameras(evidence), *_turn_photographs(evidence)]
    if board:
        hypotheses += _turn_board(evidence, board)

    found = dict[float, Hypothesis]()
    for hypothesis in reversed(hypotheses):
        after = measure_misfit(task, numbers, hypothesis.evidence, solved=False)
        found[after.base_px] = hypothesis

    least = min(found, default=math.inf)
    if least < NEAR_BASE_PX:
        return found[least]

    what = "board's place and yaw" if board else "cameras"
    return Hypothesis(
        f"the middle of the robot's foot is seen {base_px:.0f} pixels from the origin: measure the {what} again",
        evidence,
        may_point=True,
    )


def _swap_cameras(evidence: Evidence) -> Iterator[Hypothesis]:
    """Suppose that two measured cameras were given in the wrong order."""
    measured = [
        number
        for number, photograph in enumerate(evidence.photographs)
        if photograph.view is not None and not photograph.found
    ]
    for one, other in combinations(measured, 2):
        photographs = [*evidence.photographs]
        photographs[one] = replace(
            photographs[one], view=evidence.photographs[other].view
        )
        photographs[other] = replace(
            photographs[other], view=evidence.photographs[one].view
        )
        names = [photographs[number].picture.name for number in (one, other)]
        words = f"the cameras of {' and '.join(names)} are swapped: give cameras=[...] in the order of pictures=[...]"
        yield Hypothesis(words, Evidence(photographs, evidence.sightings))


def _turn_photographs(evidence: Evidence) -> Iterator[Hypothesis]:
    """Suppose that a photograph is upside down, or mirrored."""
    for number, photograph in enumerate(evidence.photographs):
        if photograph.view is None or photograph.found:
            continue

        width, height = photograph.size
        name = photograph.picture.name
        for turned, mend in (
            ("upside down", "turn it by 180 degrees"),
            ("mirrored", "give the picture as it was taken"),
        ):
            flips = (width, height if turned == "upside down" else None)
            sightings = [
                _flip(sighting, *flips) if sighting.photo == number + 1 else sighting
                for sighting in evidence.sightings
            ]
            words = f"{name} is {turned}: {mend}"
            yield Hypothesis(words, Evidence(evidence.photographs, sightings))


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


def _turn_board(evidence: Evidence, board: Sequence[float]) -> Iterator[Hypothesis]:
    """Suppose that the board's place was written otherwise than it lies."""
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
        if there == (x, y, yaw):
            continue

        photographs = _lay_board(evidence.photographs, board, there)
        values = ",".join(f"{value:g}" for value in there)
        words = f"the board lies {how}: measure it again, and give board=[{values}] if it is so"
        if photographs is not None:
            yield Hypothesis(words, Evidence(photographs, evidence.sightings))


def _lay_board(
    photographs: Sequence[Photograph],
    here: Sequence[float],
    there: Sequence[float],
) -> list[Photograph] | None:
    """Return photographs as if the board lay elsewhere; None: no camera sees it so."""
    before = find_frame(here)
    after = find_frame(there)
    moved = []
    for photograph in photographs:
        known = photograph.landmarks
        if known is None or not known.markers:
            moved.append(photograph)
            continue

        places: Array = after.apply(before.inverse().apply(known.places))
        landmarks = replace(known, places=places)
        if photograph.found:
            view = photograph.view
            fov_deg = view.camera.fov_deg if view is not None else None
            try:
                found = photograph.find(landmarks, fov_deg)
            except UserError:  # no camera: this is no explanation
                return None
            moved.append(replace(found, error=photograph.error))
        else:
            moved.append(replace(photograph, landmarks=landmarks))

    return moved


def _leave_out_moved(evidence: Evidence) -> Iterator[Hypothesis]:
    """Suppose that a body was moved before a photograph was taken."""
    places = {(sighting.body, sighting.photo) for sighting in evidence.sightings}
    for body, photo in sorted(places):
        elsewhere = {other for name, other in places if name == body and other != photo}
        if body == BASE or not elsewhere or photo > len(evidence.photographs):
            continue

        kept = [
            sighting
            for sighting in evidence.sightings
            if (sighting.body, sighting.photo) != (body, photo)
        ]
        name = evidence.photographs[photo - 1].picture.name
        words = (
            f"{body} lies elsewhere in {name} than in the other photographs: it was moved in between, or {name} is of "
            "another bench; take photographs again of the bench as it is"
        )
        bare = Evidence(evidence.photographs, kept)
        yield Hypothesis(words, bare, may_point=True)
