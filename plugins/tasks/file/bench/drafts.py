"""Have a scene file written, and read each draft as strictly as a person's file, all faults at once."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from core.errors import UserError
from core.interfaces import Message, Robot, Text
from core.support.cli import say
from core.support.templates import fill
from core.support.text import clean
from plugins.tasks.file.bench.asking import Asker
from plugins.tasks.file.bench.board import MARKER_M
from plugins.tasks.file.bench.checks import find_faults, measure_reach
from plugins.tasks.file.bench.edits import set_variation
from plugins.tasks.file.bench.fitting import Evidence, Fit, fit_seen, place_points
from plugins.tasks.file.bench.marks import Numbers
from plugins.tasks.file.bench.mistakes import Referee
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.scene_replies import LONGEST, Beside, read_reply
from plugins.tasks.file.bench.views import LEAST_PLACES, Landmarks
from plugins.tasks.file.spec import SceneSpec, name_pictures
from plugins.tasks.file.task import FileTask
from plugins.tasks.file.tree import Tree

PACKAGE = "plugins.tasks.file.bench"
PLACES_PX = 8.0  # how well a model points at a place, and a person measures it


class BenchMistake(UserError):
    """Something is wrong with the photographs or what was measured, which no answer of a model can mend."""


@dataclass
class Draft:
    """A scene file that is written by a model, or changed, and examined.

    Attributes:
        file: where it lies, in the folder of the file to be written.
        photographs: of the bench; views that are found are added to them.
        known: what the person told: numbers by what they are of, and places in the world (x, y, z) by their names.
        robot: that stands there.
        fov_deg: of photographs whose camera is found; None: not given.
        text: of the file, with fitted numbers.
        beside: what was said beside it.
        fit: the errors of what was seen.
        faults: a line for each; none: it is sound.
        board: x, y (m) and yaw (degrees) of the printed board; empty: there is none.
        marker_mm: how wide its markers are said to be.
    """

    file: Path
    photographs: list[Photograph]
    known: Mapping[str, Any]
    robot: Robot
    fov_deg: float | None
    text: str = ""
    beside: Beside = field(default_factory=Beside)
    fit: Fit = field(default_factory=Fit)
    faults: list[str] = field(default_factory=list)
    board: tuple[float, ...] = ()
    marker_mm: float = 1000 * MARKER_M

    def ask(self, asker: Asker, tries: int, sentence: str) -> None:
        """Have the file written for a sentence, or changed; the last draft may have faults.

        Raises:
            UserError: the model has questions, or gave no answer.
        """
        before = self.read_numbers()
        pictures = self._read_pictures()
        told = fill(
            PACKAGE,
            "ask",
            reach=measure_reach(self.robot),
            sentence=sentence,
            text=self.text,
            known=self.known,
            photographs=self.photographs,
            schema=json.dumps(FileTask.json_schema(), separators=(",", ":")),
        )
        sent = [photograph.picture for photograph in self.photographs]
        messages = [Message("user", (Text(told), *sent))]
        reply = ""
        for _ in range(tries):
            before_it = reply
            reply = asker.ask(messages)
            if reply == before_it:  # it mends nothing
                return

            try:
                self.text, self.beside = read_reply(self.file, reply)
            except UserError as error:
                self.faults = [str(error)]
            else:
                asked = [clean(line, LONGEST) for line in self.beside.questions]
                if asked:
                    raise UserError(
                        f"the model asks: {' '.join(asked)} Say it in the sentence."
                    )

                strays = [
                    *self._find_strays(before, sentence),
                    *self.find_unsighted(before),
                ]
                if self._read_pictures() != pictures:
                    strays.append(
                        "pictures are the person's to name; leave that key as it was, or out"
                    )

                self.examine()
                self.faults += strays

            if not self.faults:
                return

            again = fill(PACKAGE, "again", faults=self.faults)
            messages.append(Message("assistant", (Text(reply),)))
            messages.append(Message("user", (Text(again),)))

    def _find_strays(self, before: Numbers, sentence: str) -> Iterator[str]:
        """Yield a line for each number that was changed or left out, though the sentence names nothing of it.

        What the answer marks as told counts as named, such as the place of what lies in a cup that is moved.
        """
        now = self.read_numbers()
        for path in before.marks:
            name = path.split(".")[1].lower()
            if any(word in sentence.lower() for word in re.findall("[a-z]+", name)):
                continue

            old = before.values[path]
            new = now.values.get(path)
            if new != old and now.marks.get(path) != "told":
                yield (
                    f"{path} was {old} and is {new}, which the sentence does not ask for; leave it as it was, or mark "
                    "it # told where it has to change too"
                )

    def find_unsighted(self, before: Numbers) -> Iterator[str]:
        """Yield a line for each new body or mark that is marked as seen, though it was sighted in no photograph."""
        if not self.photographs:
            return

        sighted = {sighting.body for sighting in self.beside.sightings}
        seen = set[str]()
        for path, mark in self.read_numbers().marks.items():
            kind, name, *_ = path.split(".")
            if mark == "seen" and kind != "joints" and path not in before.marks:
                seen.add(name)

        for name in sorted(seen - sighted):
            if not any(body.startswith(f"{name}_") for body in sighted):
                yield (
                    f"{name} is marked # seen, and no sighting says where; add sightings of it, or mark its numbers "
                    "# assumed"
                )

    def _read_pictures(self) -> Any:
        return Tree(self.file, self.text or "{}").data.get("pictures")

    def read_numbers(self) -> Numbers:
        """Read the numbers of the file, with their marks."""
        return Numbers(Tree(self.file, self.text or "{}"), self.text)

    def examine(self) -> None:
        """Fit the file to what was seen, and list all its faults."""
        try:
            tree = Tree(self.file, self.text)
            numbers = Numbers(tree, self.text)
            marks = numbers.marks
            told = {numbers.values[path] for path in marks if marks[path] == "told"}
            self.faults = [
                *tree.list_mistakes(SceneSpec, name_pictures(tree.data)),
                *numbers.unmarked,
            ]
            for name, value in self.known.items():
                if isinstance(value, float) and value not in told:
                    mend = "write that number, and mark it # told"
                    self.faults.append(f"{name} is told as {value:g}; {mend}")

            if not self.faults:
                self._find_views()
                evidence = Evidence(self.photographs, self.beside.sightings)
                task = self.read()
                self.fit = fit_seen(task, numbers, evidence)
                self._name_mistake(task, numbers, evidence)
                if self._place_others(task):
                    self.fit = fit_seen(task, numbers, evidence)

                self.text = numbers.write(self.fit.values)
                self.faults = [*find_faults(self.read()), *self.fit.misses]
        except BenchMistake:
            raise
        except UserError as error:
            self.faults = [str(error)]

    def read(self) -> FileTask:
        """Read the file as a task.

        Raises:
            UserError: it can't be used.
        """
        self.file.write_text(self.text, encoding="utf-8")
        task = FileTask(str(self.file))
        task.robot = self.robot
        return task

    def vary(self) -> None:
        """Write a variation ``seen`` into the file: the benches that fit what was seen.

        Those of a file that is changed go along with their numbers.
        """
        tree = Tree(self.file, self.text)
        numbers = Numbers(tree, self.text)
        benches = dict[str, list[float]]()
        for path, before in tree.data.get("variations", {}).get("seen", {}).items():
            if numbers.marks.get(path) == "seen" or path not in numbers.marks:
                benches[path] = [numbers.values[path] + v - before[0] for v in before]

        if self.fit.benches:
            benches = self.fit.benches
        if not benches:
            return

        block = fill(PACKAGE, "variation", benches=benches)
        self.text = set_variation(self.text, "seen", block)

    @property
    def names_pictures(self) -> bool:
        """Whether the file names the pictures of the bench."""
        return self._read_pictures() is not None

    @property
    def fitted(self) -> list[Photograph]:
        """The photographs, with their cameras as they were fitted."""
        return [
            replace(photograph, view=self.fit.views.get(number, photograph.view))
            for number, photograph in enumerate(self.photographs)
        ]

    def _name_mistake(
        self, task: FileTask, numbers: Numbers, evidence: Evidence
    ) -> None:
        """Look for what a person gets wrong, before pixels are blamed.

        Raises:
            BenchMistake: it is that.
        """
        referee = Referee(task, numbers, evidence, self.fit, self.board, self.marker_mm)
        found = referee.find_mistake()
        if found is None:
            return
        if found.may_point:
            self.fit.misses.append(found.words)
        else:
            raise BenchMistake(found.words)

    def _place_others(self, task: FileTask) -> bool:
        """Find the cameras of other photographs by the bodies that they share with those whose camera is known."""
        fitted = {path.split(".")[1] for path in self.fit.measured}
        scene = task.with_numbers(self.fit.values)
        placed = False
        for number, photograph in enumerate(self.photographs):
            shared = [
                sighting
                for sighting in self.beside.sightings
                if sighting.photo == number + 1
                and sighting.body in fitted
                and len(sighting.pixels) == 2
            ]
            if photograph.view is not None or len(shared) < LEAST_PLACES:
                continue

            places = np.concatenate([place_points(scene, s) for s in shared])
            pixels = np.array([sighting.pixels for sighting in shared])
            name = photograph.picture.name
            try:
                found = photograph.find(
                    Landmarks(places, pixels, PLACES_PX), self.fov_deg
                )
            except UserError as error:
                say(
                    f"{name}: no camera is found by what it shares with others: {error}"
                )
                continue

            say(f"{name}: its camera is found by {len(shared)} points that it shares")
            self.photographs[number] = replace(found, landmarks=None)
            placed = True

        return placed

    def _find_views(self) -> None:
        """Find views by known places, where enough are seen.

        Raises:
            UserError: no camera sees the places so.
        """
        for number, photograph in enumerate(self.photographs):
            here = [s for s in self.beside.sightings if s.photo == number + 1]
            placed = [s for s in here if isinstance(self.known.get(s.body), tuple)]
            is_measured = photograph.view is not None and not photograph.found
            if not placed or (photograph.landmarks and photograph.landmarks.markers):
                continue

            world = np.array([self.known[sighting.body] for sighting in placed])
            pixels = np.array([sighting.pixels[:2] for sighting in placed])
            landmarks = Landmarks(world, pixels, PLACES_PX)
            if is_measured:
                found = replace(photograph, landmarks=landmarks)
            elif len(placed) >= LEAST_PLACES:
                found = photograph.find(landmarks, self.fov_deg)
            else:
                continue

            self.photographs[number] = found
