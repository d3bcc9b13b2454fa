"""Read study files: which methods are compared, on which tasks, with how many seeds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from itertools import chain
from pathlib import Path
from typing import Any

import pydantic
import yaml

from core.errors import UsageError, UserError, choices
from core.support.cli import expand, path_exists
from core.support.files import read_text
from core.support.text import hydra_word
from plugins.results.pages.runs import AnyRun, FinishedRun, LeftOutRun, read_run

RECORD = "study.yaml"
"""What the folder of a study says of it, for reports and for who goes on with it."""

HARMLESS = ("executor", "listener", "film", "vlm.")
"""What the words begin with that may change while a study is under way: no result depends on it."""

_STUDIES = Path(__file__).with_name("studies")
_PROMPTS = Path(str(files("prompts")))


class _Part(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)


class Method(_Part):
    """One of the methods that are compared.

    Attributes:
        name: in reports and in the names of folders: letters, digits, and ``_.-``.
        settings: words of ``core.run`` by which it differs; the place holders are those of `Study`.
        budgets: more of them, by the budget's name.
        tasks: on which it is run; None: on all.
        language: it means nothing to a model that reads no words.
    """

    name: str = pydantic.Field(pattern=r"^[\w.-]+$")
    settings: tuple[str, ...] = ()
    budgets: dict[str, tuple[str, ...]] = {}
    tasks: tuple[str, ...] | None = None
    language: bool = False


class Published(_Part):
    """A figure that others printed, to stand beside one's own.

    Attributes:
        what: in words, and where it is printed.
        value: the figure.
        methods: whose mean over tasks it is.
        against: the methods over which it is the improvement, in percent of theirs; empty: it is the mean itself.
        tasks: over which; None: all that are there.
    """

    what: str
    value: float
    methods: tuple[str, ...]
    against: tuple[str, ...] = ()
    tasks: tuple[str, ...] | None = None


class Study(_Part):
    """A study, as its file says.

    In words of runs ``{task}``, ``{seed}`` and ``{run}`` (the run's folder in that of the study) are filled in,
    ``{here}`` is the folder of the file, and ``{prompts}`` that of the project's prompts.

    Attributes:
        about: what it compares, in a sentence.
        tasks: names, or scene files beside the study file.
        seeds: how many; they count from 0.
        settings: words of all runs.
        by_task: words of the runs of a task.
        budgets: words by the budget's name; the first is the default.
        methods: in the order of reports; the others are compared with the first.
        published: figures of others.
    """

    about: str
    tasks: tuple[str, ...] = pydantic.Field(min_length=1)
    methods: tuple[Method, ...] = pydantic.Field(min_length=1)
    seeds: int = pydantic.Field(default=5, ge=1)
    settings: tuple[str, ...] = ()
    by_task: dict[str, tuple[str, ...]] = {}
    budgets: dict[str, tuple[str, ...]] = {"quick": ()}
    published: tuple[Published, ...] = ()

    @pydantic.model_validator(mode="after")
    def _budgets_are_known(self) -> Study:
        for method in self.methods:
            unknown = {*method.budgets} - {*self.budgets}
            if unknown:
                raise ValueError(f"{method.name}: no budget {unknown.pop()!r}")

        return self


@dataclass(frozen=True)
class StudyRun:
    """A run of a study: its method, task and seed, its folder, and the words of ``core.run`` that make it."""

    method: str
    task: str
    seed: int
    folder: Path
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.method} {self.task} seed {self.seed}"


def read_state(run: StudyRun) -> AnyRun | None:
    """Return what is known of a run; None: it has not begun, so that it starts from the beginning."""
    state = read_run(run.folder)
    if isinstance(state, LeftOutRun) and not state.config:
        return state if state.status == "unreadable" else None

    return state


def is_done(state: AnyRun | None) -> bool:
    """Report whether a run has come to its end, with a design or without one: then it is never run again."""
    if isinstance(state, FinishedRun):
        return True

    return state is not None and state.status == "failed"


def find_study(word: str) -> Path:
    """Return the file of one of the project's own studies, or of one's own.

    Raises:
        UsageError: there is none.
    """
    own = {file.stem: file for file in _STUDIES.glob("*.yaml")}
    if word in own:
        return own[word]
    if path_exists(word) and expand(word).is_file():
        return expand(word)

    raise choices("study", word, own, "the studies, nor a file of that name")


def find_record(folders: Iterable[Path]) -> Study | None:
    """Return the study of the first folder that holds one; None: none does.

    Raises:
        UserError: its record can't be read.
    """
    for folder in folders:
        file = folder / RECORD
        if file.is_file():
            return _parse(_read_yaml(file).get("study"), file)

    return None


def read_study(file: Path) -> Study:
    """Read a study file.

    Raises:
        UserError: it can't be read, or is no study; says where.
    """
    return _parse(_read_yaml(file), file)


def _parse(read: Any, file: Path) -> Study:
    try:
        return Study.model_validate(read)
    except pydantic.ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise UserError(f"{file}: {place or 'study'}: {first['msg']}") from error


def _read_yaml(file: Path) -> Any:
    try:
        return yaml.safe_load(read_text(file, str(file)))
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())
        raise UserError(f"{file} is no YAML: {reason}") from error


@dataclass(frozen=True)
class Selection:
    """What of a study is to be run.

    Attributes:
        study: all of it.
        file: of the study.
        folder: of the results.
        budget: its name.
        words: of the command line, for all runs; they come last.
    """

    study: Study
    file: Path
    folder: Path
    budget: str
    words: tuple[str, ...] = ()

    def plan(
        self, methods: Sequence[Method], tasks: Sequence[str], seeds: int
    ) -> list[StudyRun]:
        """List the runs, seed by seed, so that what is there first has all methods and tasks."""
        runs = []
        for seed in range(seeds):
            for task in tasks:
                for method in methods:
                    if task in (method.tasks or tasks):
                        runs.append(self._run(method, task, seed))

        return runs

    def settings_of(self, method: Method) -> list[str]:
        """Return the words that the runs of a method have in common; a later word replaces an earlier one."""
        return merge(
            self.study.settings,
            self.study.budgets[self.budget],
            method.settings,
            method.budgets.get(self.budget, ()),
            self.words,
        )

    def _run(self, method: Method, task: str, seed: int) -> StudyRun:
        name = Path(task).stem
        inside = f"{method.name}/{name}/seed{seed}"
        chosen = [f"task={task}"]
        if task.endswith((".yaml", ".yml")):
            scene = (self.file.parent / task).resolve()
            chosen = ["task=file", f"task.file={hydra_word(str(scene))}"]

        named = [*chosen, f"seed={seed}", f"name={method.name}"]
        more = self.study.by_task.get(name, ())
        words = merge(named, more, self.settings_of(method))
        values = {
            "task": name,
            "seed": str(seed),
            "run": inside,
            "here": str(self.file.parent.resolve()),
            "prompts": str(_PROMPTS),
        }
        filled = tuple(_fill(word, values) for word in words)
        return StudyRun(method.name, name, seed, self.folder / inside, filled)

    def record(self) -> str:
        """Write down the study, with the words of each method, for the folder of the results."""
        words = {method.name: self.settings_of(method) for method in self.study.methods}
        record = {
            "budget": self.budget,
            "words": words,
            "study": self.study.model_dump(mode="json"),
        }
        return yaml.safe_dump(record, sort_keys=False, allow_unicode=True, width=120)

    def check_record(self, methods: Iterable[Method]) -> None:
        """Check that the runs that are there were made with the same words.

        Raises:
            UsageError: they were not.
        """
        file = self.folder / RECORD
        before = _read_yaml(file)["words"] if file.exists() else {}
        there = [m for m in methods if (self.folder / m.name).exists()]
        for method in there:
            stored = _matter(before.get(method.name, ()))
            different = {*stored} ^ {*_matter(self.settings_of(method))}
            if different:
                words = " ".join(sorted(different))
                raise UsageError(
                    f"{self.folder} holds runs of {method.name} that differ in: {words}; name another folder with "
                    "folder=FOLDER, or say what was said before"
                )


def merge(*groups: Iterable[str]) -> list[str]:
    """Join words ``KEY=VALUE``; of the same key the last one counts, in its place."""
    last: dict[str, str] = {}
    for word in chain(*groups):
        key = word.partition("=")[0]
        last.pop(key, None)
        last[key] = word

    return list(last.values())


def harmless(words: Iterable[str]) -> list[str]:
    """Return the words that may change, or be said again, when a run goes on."""
    return [word for word in words if word.startswith(HARMLESS)]


def _matter(words: Iterable[str]) -> list[str]:
    return [word for word in words if not word.startswith(HARMLESS)]


def _fill(word: str, values: dict[str, str]) -> str:
    for key, value in values.items():
        word = word.replace(f"{{{key}}}", value)

    return word
