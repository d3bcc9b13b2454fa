"""Choose what was learnt elsewhere for a prompt: the lessons of other runs, or of people, that fit a task.

A folder holds ``lessons.json``, which is anybody's to edit::

    {"task": "OneBook", "context": "source", "lessons": [
      {"says": "A toe that ends below the middle of a book tips it over.", "seen": ["g0-a1-s2-p0"],
       "for": "pulling what stands upright", "sure": "seen twice"}]}

``seen`` are candidates' ids, ``for`` says for which kind of task it counts, ``sure`` how sure it is. But for ``says``
all may be left out. ``context`` is the run's ``prompt.context``: what one run saw is hidden from one that sees less.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from core.design import Tool
from core.designs.prompt_values import RunFacts
from core.errors import UserError
from core.interfaces import Brief, Recalled, Task
from core.support.files import read_text
from core.support.text import clean

FILE = "lessons.json"
LESSON = "lesson"  # a kind of what is recalled
MOST_WORDS = 400  # of all lessons in a prompt
MOST_BYTES = 1_000_000  # of a file
LONGEST = 400  # letters of a sentence
MOST = 200  # lessons that are read of a file
MOST_WRITTEN = 12  # lessons of a run

_NUMBER = re.compile(r"\d")  # which a run without numbers must not learn in this way
_WORD = re.compile(r"[a-z]{4,}")
_COMMON = frozenset(("arms", "robot", "table", "task", "that", "this", "tool", "with"))


@dataclass(frozen=True)
class Lesson:
    """A sentence that was learnt, and where.

    Attributes:
        says: the sentence.
        kind: for which kind of task; empty: nobody said.
        seen: the ids of candidates by which it was seen.
        sure: how sure it is, in words.
        task: of the run; empty: unknown.
        context: the level at which that run was told of its scene; empty: unknown.
        source: the folder, and the lesson's number in it.
    """

    says: str
    kind: str = ""
    seen: tuple[str, ...] = ()
    sure: str = ""
    task: str = ""
    context: str = ""
    source: str = field(default="", compare=False)

    @property
    def shown(self) -> dict[str, Any]:
        """What a prompt shows of it."""
        entry = {"says": self.says, "for": self.kind, "sure": self.sure}
        return {key: value for key, value in entry.items() if value}

    @property
    def written(self) -> dict[str, Any]:
        """What a file holds of it, beside the task and what was told."""
        return {**self.shown, "seen": list(self.seen)}


def lessons_value(brief: Brief, mounted: Tool, facts: RunFacts) -> str:
    """Write the lessons that a request recalls as JSON for templates, their ``lessons``; empty: there are none.

    Args:
        brief: with what is recalled.
        mounted: the tool on the arm, which this says nothing of.
        facts: of the run.
    """
    return dump_recalled(brief, LESSON)


def dump_recalled(brief: Brief, kind: str) -> str:
    """Write what a request recalls of a kind as JSON, an item on a line; empty: there is nothing."""
    found = [recalled for recalled in brief.recalled if recalled.kind == kind]
    if not found:
        return ""
    lines = [json.dumps(recalled.shown, ensure_ascii=False) for recalled in found]
    return "[\n" + ",\n".join(lines) + "\n]"


def recall_lessons(task: Task, facts: RunFacts) -> list[Recalled]:
    """Read the lessons of the folders that the settings name, and choose those that fit a task.

    Args:
        task: what prompts are for.
        facts: of the run: the folders, and the level at which bodies are described.

    Raises:
        UserError: a folder holds no lessons, or they can't be read.
    """
    found: list[Lesson] = []
    for folder in facts.settings.lesson_folders:
        for number, lesson in enumerate(read_lessons(Path(folder))):
            found.append(replace(lesson, source=f"{folder}#{number}"))

    level = facts.settings.context
    allowed = [
        lesson
        for lesson in found
        if facts.level.numbers
        or lesson.context == level
        or not _NUMBER.search(f"{lesson.says} {lesson.kind}")
    ]
    chosen = choose_lessons(allowed, task)

    return [Recalled(LESSON, lesson.source, lesson.shown) for lesson in chosen]


def read_lessons(folder: Path) -> list[Lesson]:
    """Read the lessons of a folder.

    Raises:
        UserError: there are none, or a lesson says nothing; says in which file.
    """
    file = folder / FILE
    text = read_text(file, f"prompt.lessons: {file}", MOST_BYTES, within=folder)
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UserError(f"prompt.lessons: {file} is no JSON: {error}") from error

    return read_entries(document, f"prompt.lessons: {file}")


def read_entries(document: object, what: str) -> list[Lesson]:
    """Read the lessons of a document; ``what`` names it in an error.

    Raises:
        UserError: there are none, or a lesson says nothing.
    """
    if not isinstance(document, dict) or not isinstance(document.get("lessons"), list):
        raise UserError(f'{what} must hold {{"lessons": [{{"says": "..."}}, ...]}}')

    lessons = []
    for number, entry in enumerate(document["lessons"][:MOST]):
        says = entry.get("says") if isinstance(entry, dict) else entry
        if not isinstance(says, str) or not says.strip():
            raise UserError(
                f'{what}: lesson {number} says nothing; write {{"says": "..."}}'
            )

        fields = entry if isinstance(entry, dict) else {}
        seen = fields.get("seen")
        lesson = Lesson(
            _words(says),
            _words(fields.get("for")),
            tuple(map(_words, seen)) if isinstance(seen, list) else (),
            _words(fields.get("sure")),
            _words(document.get("task")),
            _words(document.get("context")),
        )
        lessons.append(lesson)

    return lessons


def _words(value: object) -> str:
    """Return a text on one line, without what would end the block in which it stands; of anything else nothing."""
    if not isinstance(value, str):
        return ""
    return clean(value, LONGEST).replace("```", "'''")


def choose_lessons(lessons: list[Lesson], task: Task) -> list[Lesson]:
    """Choose the lessons that share most words with a task's description and goals, `MOST_WORDS` at most.

    One that shares none is left out, unless nobody said what it is for. Those that are alike are shown once.
    """
    wanted = words_of(task)
    ranked = []
    for lesson in dict.fromkeys(lessons):
        shared = len(_keys(f"{lesson.says} {lesson.kind} {lesson.task}") & wanted)
        if shared or not lesson.kind:
            ranked.append((shared, lesson))
    ranked.sort(key=lambda pair: -pair[0])

    chosen = []
    left = MOST_WORDS
    for _, lesson in ranked:
        count = len(" ".join(lesson.shown.values()).split())
        if count <= left:
            chosen.append(lesson)
            left -= count

    return chosen


def words_of(task: Task) -> set[str]:
    """Return the words of a task's name, description and goals that say what it is about."""
    return _keys(f"{task.name} {task.description} {task.in_words} {task.goals!r}")


def _keys(text: str) -> set[str]:
    """Return the words of a text that say what it is about, without the endings of plurals."""
    spread = re.sub(r"([a-z])([A-Z])", r"\1 \2", text).replace("_", " ").lower()
    return {word.rstrip("s") for word in _WORD.findall(spread) if word not in _COMMON}
