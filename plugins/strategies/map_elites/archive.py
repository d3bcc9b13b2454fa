"""Keep the best evaluation of each kind of tool and motion, and what a user picks from all of them.

The kinds are cells of a grid: J.-B. Mouret and J. Clune, "Illuminating search spaces by mapping elites", 2015.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import ConfigDict, Field, FiniteFloat
from pydantic.dataclasses import dataclass

from core.design import Tool
from core.designs.reading import dump_design
from core.errors import UsageError, choices
from core.geometry import Array
from core.interfaces import ToolRepresentation
from core.support.inputs import check
from core.trial import TIE, Evaluation, best_first, mean_figure
from core.values.warnings import warn_once

MAX_BINS = 100

Cell = tuple[int, ...]


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Measure:
    """An axis of an archive, cut into bins of the same width.

    Attributes:
        name: one of `VALUES`, which says what is measured.
        lower: where the first bin begins, in the unit of the value; what lies below is in it, too.
        upper: where the last bin ends; what lies above, or is nan, is in it, too.
        bins: how many there are, 1 to `MAX_BINS`.

    For example, tools by mass in steps of 0.1 kg::

        measure = Measure("mass", lower=0.0, upper=0.5, bins=5)
        measure.bin(evaluation)  # 2 for a tool of 0.25 kg

    Raises:
        UsageError: the bounds are not in order.
    """

    name: str
    lower: FiniteFloat
    upper: FiniteFloat
    bins: Annotated[int, Field(ge=1, le=MAX_BINS)]

    def __post_init__(self) -> None:
        if not self.lower < self.upper:
            bounds = f"from {self.lower:g} to {self.upper:g}"
            raise UsageError(
                f"evolution.measures: {self.name} goes {bounds}; lower must be less than upper"
            )

    def bin(self, evaluation: Evaluation) -> int:
        """Return the number of the bin that an evaluation lies in, from 0; that of nan is the last."""
        value = VALUES[self.name].read(evaluation)
        share = (value - self.lower) / (self.upper - self.lower)
        if not share < 1:  # nan, too
            return self.bins - 1

        return min(int(max(share, 0.0) * self.bins), self.bins - 1)


def tool_of(evaluation: Evaluation) -> Tool:
    """Return the tool that was tried."""
    assert evaluation.candidate.tool is not None
    return evaluation.candidate.tool


def measure_extent(tool: Tool) -> float:
    """Measure the longest side of the box around a tool, in the frame of its mount, metres; without components 0.

    Of attachments to two fingers the larger counts.
    """
    placed = tool.placed()
    corners: dict[str, list[Array]] = {}
    for component in tool.components:
        mount, pose = placed[component.name]
        vertices = component.shape.to_trimesh().vertices
        corners.setdefault(mount, []).append(pose.apply(vertices))

    longest = 0.0
    for points in corners.values():
        sides = np.ptp(np.concatenate(points), axis=0)
        longest = max(longest, float(sides.max()))

    return longest


def mean_touch(evaluation: Evaluation) -> float:
    """Return how far from its mount a tool first touched a body that can move, metres; nan: none, or not observed.

    Of several trials it is the mean of those in which it touched one.
    """
    touches = [
        trial.touch_m for trial in evaluation.trials if trial.touch_m is not None
    ]
    if touches:
        return float(np.mean(touches))

    if not any(trial.outcome for trial in evaluation.trials):
        warn_once(
            "evolution.measures: where tools touch was not observed; set rollout.observe=true"
        )

    return float("nan")


class Value(NamedTuple):
    """What an axis may measure.

    Attributes:
        column: its head in ``archive.csv``.
        read: returns it, of an evaluation; nan: it is not known.
        usual: the bounds and the number of bins of an axis that says no others.
    """

    column: str
    read: Callable[[Evaluation], float]
    usual: tuple[float, float, int]


def _figure(name: str) -> Callable[[Evaluation], float]:
    """Return what reads a figure of trials, see `core.trial.Figure`."""
    return lambda evaluation: mean_figure(evaluation.trials, name)


VALUES = {
    "mass": Value("mass_kg", lambda e: tool_of(e).mass, (0.0, 0.5, 10)),
    "extent": Value("extent_m", lambda e: measure_extent(tool_of(e)), (0.0, 1.0, 25)),
    "components": Value(
        "components", lambda e: len(tool_of(e).components), (0.5, 10.5, 10)
    ),
    "distance": Value("distance_m", _figure("distance_m"), (0.0, 2.5, 25)),
    "touch": Value("touch_m", mean_touch, (0.0, 1.0, 25)),
    "time": Value("motion_s", _figure("motion_s"), (0.0, 20.0, 20)),
}
"""What may be measured, in the order of the columns."""


def read_measures(written: Sequence[str | Mapping[str, Any]]) -> tuple[Measure, ...]:
    """Read the setting ``evolution.measures``.

    Args:
        written: names, or mappings of a name and of what differs from what is usual (`Value`): bounds or bins.

    Raises:
        UsageError: there is none, one is unknown or named twice, or see `Measure`.

    For example::

        read_measures(["distance", {"name": "mass", "upper": 0.1}])
    """
    found: dict[str, Measure] = {}
    for item in written:
        given = {"name": item} if isinstance(item, str) else item
        name = str(given.get("name"))
        if name not in VALUES:
            raise choices("measure", name, VALUES, "evolution.measures")
        if name in found:
            raise UsageError(f"evolution.measures names {name} twice")

        usual = zip(("lower", "upper", "bins"), VALUES[name].usual, strict=True)
        whole = {**dict(usual), "name": name, **given}
        found[name] = check(Measure, whole, f"evolution.measures: {name}", UsageError)

    if not found:
        raise UsageError(
            f"evolution.measures is empty; name some of {', '.join(VALUES)}"
        )

    return tuple(found.values())


class Archive:
    """The tried candidates by cell: a bin of each of the measures. All are kept, and the best of a cell is its elite.

    Args:
        measures: the axes of the grid.

    For example, the reward of the best candidate of each kind::

        archive = Archive(read_measures(["mass", "extent"]))
        archive.add(evaluations)
        for (mass_bin, extent_bin), elite in archive.best().items():
            print(mass_bin, extent_bin, elite.reward)
    """

    def __init__(self, measures: Sequence[Measure]) -> None:
        self.measures = tuple(measures)
        self._found: dict[Cell, list[Evaluation]] = {}

    def add(self, evaluations: Iterable[Evaluation]) -> None:
        """File the evaluations with status ``ok``; others are ignored."""
        for evaluation in evaluations:
            if evaluation.status == "ok":
                cell = tuple(measure.bin(evaluation) for measure in self.measures)
                self._found.setdefault(cell, []).append(evaluation)

    def best(self, tie: float = TIE) -> dict[Cell, Evaluation]:
        """Return the best evaluation of each cell (`core.trial.best_first`), in the order of the cells."""
        return {
            cell: best_first(self._found[cell], tie)[0] for cell in sorted(self._found)
        }


def lean_front(evaluations: Iterable[Evaluation]) -> list[Evaluation]:
    """Return what holds and is not beaten in mass without a longer motion, the lightest first; of equal ones one."""
    held = [
        (evaluation.effort, evaluation)
        for evaluation in evaluations
        if evaluation.effort is not None and evaluation.holds
    ]
    front: list[Evaluation] = []
    shortest_s = math.inf
    held.sort(key=lambda pair: (pair[0].mass_kg, pair[0].motion_s))
    for effort, evaluation in held:
        if effort.motion_s < shortest_s:
            shortest_s = effort.motion_s
            front.append(evaluation)

    return front


def save_archive(
    archive: Archive,
    ranking: Sequence[Evaluation],
    representation: ToolRepresentation,
    folder: Path,
    tie: float = TIE,
) -> None:
    """Write ``designs.json``, a designs file, and ``archive.csv``, with a row for each of its strategies.

    These are the best of each cell, in the order of the cells, and then the best of ``ranking``, and the front of mass
    against time (`lean_front`), where these are none.

    Args:
        archive: the cells.
        ranking: all that was tried, among them what the archive holds.
        representation: writes the tools.
        folder: where the files are written; made if it is not there.
        tie: rewards this close to the highest count as equal.
    """
    chosen = {
        "best": _by_candidate(best_first(ranking, tie)[:1]),
        "front": _by_candidate(lean_front(ranking)),
    }
    elites = archive.best(tie)
    cells = {elite.candidate.id: cell for cell, elite in elites.items()}
    kept = {**_by_candidate(elites.values()), **chosen["best"], **chosen["front"]}

    folder.mkdir(parents=True, exist_ok=True)
    designs = [dump_design(e.candidate, representation) for e in kept.values()]
    text = json.dumps({"strategies": designs}, indent=2) + "\n"
    (folder / "designs.json").write_text(text, encoding="utf-8")

    with (folder / "archive.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        axes = [f"cell_{measure.name}" for measure in archive.measures]
        columns = [value.column for value in VALUES.values()]
        writer.writerow(["design", "candidate", *axes, "picked", "reward", *columns])

        for number, (name, evaluation) in enumerate(kept.items()):
            where = cells.get(name, [""] * len(axes))
            reasons = [reason for reason, picked in chosen.items() if name in picked]
            values = [value.read(evaluation) for value in VALUES.values()]
            row = [*where, " ".join(reasons), evaluation.reward, *values]
            writer.writerow([number, name, *row])


def _by_candidate(evaluations: Iterable[Evaluation]) -> dict[str, Evaluation]:
    """Return evaluations by the ids of their candidates, in order."""
    return {evaluation.candidate.id: evaluation for evaluation in evaluations}
