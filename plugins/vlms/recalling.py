"""Recall what other runs taught, and have a model write down at the end of a run what it taught."""

from __future__ import annotations

import json
import sys
from collections.abc import Container
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from core.config.schemas import PARTS, PromptSettings
from core.designs.prompt_values import prompt_values
from core.errors import UsageError, UserError
from core.events import Result
from core.interfaces import Message, Recalled, Request, Task, ToolRepresentation
from core.search.assignment import Team
from core.search.designer import ModelDesigner
from core.search.model_requests import ask_model
from core.support.cli import say
from core.support.files import write_whole, writing
from plugins.vlms.artist import shown_in
from plugins.vlms.context.examples import EXAMPLE, recall_examples
from plugins.vlms.context.feedback import WHOLE, generation_lines
from plugins.vlms.context.lessons import (
    FILE,
    MOST_WRITTEN,
    Lesson,
    read_entries,
    recall_lessons,
)

TEMPLATE = "write_lessons"
_LINES = 6_000  # characters about the candidates that are not shown whole
_MOST_SEEN = 12  # ids of a lesson


@dataclass(eq=False)
class ModelMemory:
    """Recalls lessons and winners, and writes a run's own lessons to its folder: a `core.search.designer.Memory`.

    Raises:
        UserError: what the settings name can't be read, or no prompt shows it.
    """

    designer: ModelDesigner
    _found: dict[str, list[Recalled]] = field(default_factory=dict)  # by task

    def __post_init__(self) -> None:
        assignment = self.designer.assignment
        settings = self.designer.prompts.facts.settings
        if settings.writes_lessons:
            self.designer.prompts.templates.load(TEMPLATE)
        if settings.lesson_folders:
            _check_shown(settings, "lessons")
        if settings.examples:
            _check_shown(settings, "examples")
            if assignment.given is not None:
                raise UsageError(
                    "prompt.examples shows tools, and this run's is given; leave one of them away"
                )

        self.recall(assignment.task, assignment.representation)

    def recall(
        self, task: Task, representation: ToolRepresentation
    ) -> tuple[Recalled, ...]:
        """See `core.search.designer.Memory.recall`; files are read once."""
        if task.name not in self._found:
            facts = self.designer.prompts.facts
            tools = self.designer.assignment.representation
            examples = recall_examples(task, tools, facts)
            self._found[task.name] = [*recall_lessons(task, facts), *examples]

        found = self._found[task.name]
        if representation.given(task) is not None:
            found = [recalled for recalled in found if recalled.kind != EXAMPLE]

        return tuple(found)

    def learn(self, result: Result, folder: Path) -> None:
        """See `core.search.designer.Memory.learn`; a failure costs the lessons, and a line says why.

        Lessons that are there stay: they may have been edited.
        """
        designer = self.designer
        if not designer.prompts.facts.settings.writes_lessons:
            return

        file = folder / FILE
        if file.exists():
            say(f"{file} is there and stays as it is")
            return

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
            "context": designer.prompts.facts.settings.context,
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
        brief = replace(
            brief, task=task, critiques={}, recalled=(), n_tool=1, n_action=1
        )

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

        return Request(name, brief, messages, {}, temperature, "lessons")


def _check_shown(settings: PromptSettings, part: str) -> None:
    """Check that some prompt has the part that shows what is recalled.

    Raises:
        UsageError: none has.
    """
    uses = [getattr(settings, use) for use in PARTS]
    if not any(part in parts for parts in uses):
        raise UsageError(
            f"prompt={settings.name} has no part that shows prompt.{part}; leave it away, or add {part} to "
            "prompt.initial and the others"
        )


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
