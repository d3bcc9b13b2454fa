"""Have a model write down at the end of a run what it taught, for runs of other tasks."""

from __future__ import annotations

import json
import sys
from collections.abc import Container
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from core.designs.prompt_values import prompt_values
from core.errors import UserError
from core.events import Result
from core.interfaces import Message, Request
from core.search.assignment import Team
from core.search.designer import ModelDesigner
from core.search.model_requests import ask_model
from core.support.cli import say
from core.support.files import write_whole, writing
from plugins.vlms.artist import shown_in
from plugins.vlms.told.feedback import WHOLE, generation_lines
from plugins.vlms.told.lessons import FILE, MOST_WRITTEN, Lesson, read_entries

TEMPLATE = "write_lessons"
_LINES = 6_000  # characters about the candidates that are not shown whole
_MOST_SEEN = 12  # ids of a lesson


@dataclass(eq=False)
class ModelMemory:
    """Asks for a run's lessons, and writes them to its folder: a `core.search.designer.Memory`."""

    designer: ModelDesigner

    def __post_init__(self) -> None:
        self.designer.prompts.templates.load(TEMPLATE)

    def learn(self, result: Result, folder: Path) -> None:
        """See `core.search.designer.Memory.learn`; a failure costs the lessons, and a line says why.

        Lessons that are there stay: they may have been edited.
        """
        file = folder / FILE
        if file.exists():
            say(f"{file} is there and stays as it is")
            return

        designer = self.designer
        try:
            request = self._request(result)
            asked = ask_model(designer.vlm, [request], designer.events, designer.stored)
            texts = [reply.text for reply in asked if reply.error is None]
            if not texts:
                raise UserError("the model gave no answer")  # noqa: TRY301
            known = {evaluation.candidate.id for evaluation in result.evaluations}
            lessons = read_answer(texts[0], known)
        except UserError as error:
            say(f"no {FILE}: {error}", file=sys.stderr)
            return

        document = {
            "task": designer.assignment.task.name,
            "told": designer.prompts.facts.settings.told,
            "lessons": [lesson.written for lesson in lessons],
        }
        text = json.dumps(document, indent=2, ensure_ascii=False) + "\n"
        with writing(folder):
            write_whole(file, text.encode())
        say(f"{len(lessons)} lessons: {file}")

    def _request(self, result: Result) -> Request:
        """Compose the request, with the best candidates whole, and a line for each of the others.

        Raises:
            UserError: the template uses an unknown name or fails otherwise.
        """
        designer = self.designer
        best = result.best
        assert best is not None  # see `learn`
        task, _ = shown_in(designer.assignment.task, best)
        tried = tuple(e.in_task(task.name) for e in result.evaluations)
        # Of those that earn alike, further layouts chose the best one.
        ranking = sorted(
            result.ranking, key=lambda e: e.candidate.id != best.candidate.id
        )
        elites = tuple(e.in_task(task.name) for e in ranking[:WHOLE])

        generation = len(result.generations)
        team = Team(range(1), elites)
        brief, temperature = designer.brief(generation, 0, team, tried)
        brief = replace(brief, task=task, critiques={}, n_tool=1, n_action=1)

        facts = replace(designer.prompts.facts, criticised=True)
        values = prompt_values(facts, brief)
        shown = {elite.candidate.id for elite in elites}
        others = tuple(e for e in tried if e.candidate.id not in shown)
        sight = facts.level.sight(task, brief.scene_seed)
        values["lines"] = generation_lines(others, _LINES, sight)
        values["most"] = MOST_WRITTEN

        text = designer.prompts.templates.fill(TEMPLATE, values)
        messages = (*designer.prompts.system(values), Message("user", (text,)))
        name = f"g{generation}-lessons"

        return Request(name, brief, messages, {}, temperature, critique=True)


def read_answer(text: str, known: Container[str]) -> list[Lesson]:
    """Read the lessons in a model's answer, `MOST_WRITTEN` at most, each within its bounds.

    Args:
        text: the answer, JSON with or without words around it.
        known: ids of candidates; a lesson keeps no other.

    Raises:
        UserError: there are none, or one says nothing.
    """
    start = text.find("{")
    end = text.rfind("}") + 1
    try:
        document: Any = json.loads(text[start:end])
    except (ValueError, RecursionError) as error:
        raise UserError(f"the answer is no JSON: {error}") from error

    lessons = []
    for lesson in read_entries(document, "the answer")[:MOST_WRITTEN]:
        seen = [name for name in lesson.seen if name in known]
        lessons.append(replace(lesson, seen=tuple(seen[:_MOST_SEEN])))

    return lessons
