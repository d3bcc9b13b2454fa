"""Read study files: which methods are compared, on which tasks, with how many seeds."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import pydantic
import yaml

from core.errors import UsageError, UserError, choices
from core.support.cli import arguments, expand, path_exists, say
from core.support.files import read_text
from core.support.inputs import FIELDS, check
from core.support.text import clean, hydra_word
from plugins.results.pages.runs import AnyRun, FinishedRun, LeftOutRun, read_run

RECORD = "study.yaml"
"""What the folder of a study says of it, for reports and for who goes on with it."""

AGAIN = ("executor", "listener", "film", "vlm.")
"""What the words begin with that are said again when a run goes on."""

DECISIVE = ("vlm.model=", "vlm.run=", "vlm.max_output_tokens=")
"""Of these, what results depend on."""

MOST_BYTES = 1_000_000  # of a study file or a record, which others may have written
LISTS = ("families", "methods", "tasks")  # settings with several values
_DEEPEST = 30  # lists and objects within each other
_MOST_REFERENCES = 100  # to what is named by ``&``, each of which is read again
_RESERVED = ("report",)  # folders beside those of methods

_STUDIES = Path(__file__).with_name("studies")
_PROMPTS = Path(str(files("prompts")))


Config = TypeVar("Config", bound=pydantic.BaseModel)


class _Part(pydantic.BaseModel):
    model_config = pydantic.ConfigDict(**FIELDS, frozen=True)


class Method(_Part):
    """One of the methods that are compared.

    Attributes:
        name: in reports and in the names of folders: letters, digits, and within it ``_.-``.
        settings: words of ``core.run`` by which it differs; the place holders are those of `Study`.
        budgets: more of them, by the budget's name.
        tasks: on which it is run; None: on all.
        language: it means nothing to a model that reads no words.
    """

    name: str = pydantic.Field(pattern=r"^\w[\w.-]*$", max_length=100)
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
    def _names_are_folders(self) -> Study:
        methods = [method.name for method in self.methods]
        tasks = [name_task(task) for task in self.tasks]
        for kind, names in (("methods", methods), ("tasks", tasks)):
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"two {kind} have the name {name!r}; rename one")
                if name in ("", ".", "..", *_RESERVED):
                    raise ValueError(f"{kind}: {name!r} can't name a folder of runs")

        return self

    @pydantic.model_validator(mode="after")
    def _budgets_are_known(self) -> Study:
        for method in self.methods:
            unknown = {*method.budgets} - {*self.budgets}
            if unknown:
                raise ValueError(f"{method.name}: no budget {unknown.pop()!r}")

        return self


class Record(_Part):
    """What the folder of a study says of the runs in it.

    Attributes:
        words: of the runs of a method on a task, by their folder, and one for what the task's scene file held.
        study: the study.
    """

    words: dict[str, tuple[str, ...]]
    study: Study


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


def read_settings(
    schema: type[Config], words: Sequence[str], usage: str, command: str
) -> tuple[Config, list[str]]:
    """Return the settings of a command, and the words for its runs.

    Args:
        schema: of the settings; those that are lists are typed with commas.
        words: of the command line.
        usage: of the command.
        command: its name.

    Raises:
        UsageError: a setting has a wrong value.
    """
    own: dict[str, str | list[str]] = {}
    others: list[str] = []
    for word in arguments(usage, words):
        key, _, value = word.partition("=")
        if key not in schema.model_fields:
            others.append(word)
        elif key in LISTS:
            own[key] = [item.strip() for item in value.strip("[]").split(",")]
        else:
            own[key] = value

    return check(schema, own, command, UsageError), others


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


def name_task(task: str) -> str:
    """Return the name of a task of a study, by which its folders are called."""
    return Path(task).stem


def find_record(folders: Iterable[Path]) -> Study | None:
    """Return the study of the first folder that holds one; None: none does. A line says what can't be read."""
    for folder in folders:
        record = read_record(folder / RECORD)
        if record is not None:
            return record.study

    return None


def read_record(file: Path) -> Record | None:
    """Read the record of a study; None: there is none, or it can't be read, as a line says."""
    if not file.exists():
        return None

    try:
        return check(Record, _read_yaml(file), str(file), UserError)
    except UserError as error:
        say(
            f"warning: {error}; it is left out: which words its runs were made with is not known",
            file=sys.stderr,
        )
        return None


def read_study(file: Path) -> Study:
    """Read a study file.

    Raises:
        UserError: it can't be read, or is no study; says where.
    """
    return check(Study, _read_yaml(file), str(file), UserError)


def _read_yaml(file: Path) -> Any:
    """Read a file that others may have written, as plain data.

    Raises:
        UserError: it is too large or too deep, no UTF-8, or no YAML.
    """
    try:
        text = read_text(file, most=MOST_BYTES)
        _check_depth(text, file)
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError) as error:  # such as a date that is none
        reason = clean(" ".join(str(error).split()), 300)
        raise UserError(f"{file} is no YAML: {reason}") from error


def _check_depth(text: str, file: Path) -> None:
    """Refuse what has very many lists and objects within each other, or uses a name for many others.

    Raises:
        UserError: it does.
    """
    depth = 0
    references = 0
    event: Any
    for event in yaml.parse(text, yaml.SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        references += isinstance(event, yaml.AliasEvent)
        if depth > _DEEPEST or references > _MOST_REFERENCES:
            line = event.start_mark.line + 1
            raise UserError(f"{file}, line {line}: this is too deep for a study")


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
        name = name_task(task)
        inside = f"{method.name}/{name}/seed{seed}"
        chosen = [f"task={task}"]
        if _is_scene(task):
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

    def describe(
        self, methods: Iterable[Method], tasks: Sequence[str]
    ) -> dict[str, tuple[str, ...]]:
        """List the words of the runs of methods on tasks, as `Record` has them.

        Raises:
            UserError: a scene file can't be read.
        """
        own = {}
        for task in tasks:
            own[task] = list(self.study.by_task.get(name_task(task), ()))
            if _is_scene(task):
                scene = read_text(self.file.parent / task, f"scene file {task}")
                digest = sha256(scene.encode()).hexdigest()[:16]
                own[task].append(f"the scene file's checksum {digest}")

        return {
            f"{method.name}/{name_task(task)}": (*words, *self.settings_of(method))
            for method in methods
            for task, words in own.items()
        }

    def record(self, methods: Iterable[Method], tasks: Sequence[str]) -> str:
        """Write down the study and the words of its runs, for the folder of the results.

        Of methods and tasks that are not chosen, what was written before stays.
        """
        before = read_record(self.folder / RECORD)
        words = dict(before.words) if before else {}
        words |= self.describe(methods, tasks)
        record = Record(words=words, study=self.study)
        dumped = record.model_dump(mode="json")
        return yaml.safe_dump(dumped, sort_keys=False, allow_unicode=True, width=120)

    def check_record(self, methods: Iterable[Method], tasks: Sequence[str]) -> None:
        """Check that the runs that are there were made with the same words, of the same scene files.

        Raises:
            UsageError: they were not, or a scene file can't be read.
        """
        before = read_record(self.folder / RECORD)
        if before is None:
            return

        for name, words in self.describe(methods, tasks).items():
            stored = before.words.get(name, ())
            different = {*_matter(stored)} ^ {*_matter(words)}
            if different and (self.folder / name).exists():
                listed = clean(" ".join(sorted(different)), 1000)
                raise UsageError(
                    f"{self.folder} holds runs of {name} that differ in: {listed}; name another folder with "
                    "folder=FOLDER, or say what was said before"
                )


def _is_scene(task: str) -> bool:
    """Report whether a task of a study is a scene file."""
    return task.endswith((".yaml", ".yml"))


def merge(*groups: Iterable[str]) -> list[str]:
    """Join words ``KEY=VALUE``; of the same key the last one counts, in its place."""
    last: dict[str, str] = {}
    for word in chain(*groups):
        key = word.partition("=")[0]
        last.pop(key, None)
        last[key] = word

    return list(last.values())


def list_repeated(words: Iterable[str]) -> list[str]:
    """Return the words that are said again when a run goes on."""
    return [word for word in words if word.startswith(AGAIN)]


def _matter(words: Iterable[str]) -> list[str]:
    """Return the words that results depend on."""
    return [
        word
        for word in words
        if word.startswith(DECISIVE) or not word.startswith(AGAIN)
    ]


def _fill(word: str, values: dict[str, str]) -> str:
    for key, value in values.items():
        word = word.replace(f"{{{key}}}", value)

    return word
