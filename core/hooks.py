"""The hook specifications: how plugins offer parts, and which events listeners receive.

This page is the whole contract for plugins.

A plugin is a module (or object) named by an entry point in the group ``vlmgineer``. It offers a part by implementing
the hook of its kind with `hookimpl`. The hook returns a mapping from names, as in ``sim=NAME``, to factories. A factory
is a class or function that is called with the part's settings, or a string ``"module:attribute"``. A string is imported
when it is first used, which keeps discovery quick::

    from core.hooks import hookimpl

    @hookimpl
    def simulators():
        return {"mine": "my_package.simulator:MySimulator"}
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import pluggy

from core.values.harmless import Harmless as Harmless
from core.values.harmless import Names as Names
from core.values.harmless import PartsOf as PartsOf

if TYPE_CHECKING:
    from core.events import Generation, Result, Run
    from core.geometry import Pose
    from core.interfaces import Reply, Request
    from core.trial import Evaluation

PROJECT = "vlmgineer"

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)

Factory = Callable[..., Any] | str
Factories = Mapping[str, Factory]


@dataclass(frozen=True)
class Command:
    """A command, which is typed as ``vlmgineer NAME ARGUMENT ...``.

    Attributes:
        help: what it does, in one line.
        main: is called with the list of arguments, and returns an exit status; None: 0. It may raise a `UserError`,
            which is printed as one line. A string ``"module:attribute"`` is imported when the command is called.
    """

    help: str
    main: Callable[[list[str]], int | None] | str


@dataclass(frozen=True)
class Taken:
    """A file that others made, as `importers` take it.

    Attributes:
        lines: what it is, what was assumed, and how to use it, for people.
        words: a configuration in which it stands, as ``task=file``; without any there is nothing to draw.
        frames: poses in the world, of which a picture shows the axes, by their names.
    """

    lines: Sequence[str]
    words: Sequence[str] = ()
    frames: Mapping[str, Pose] = field(default_factory=dict)


class Parts(Protocol):
    """One hook per kind of part."""

    @hookspec
    def tasks(self) -> Factories:
        """Make a `core.interfaces.Task`."""

    @hookspec
    def robots(self) -> Factories:
        """Make a `core.interfaces.Robot`."""

    @hookspec
    def simulators(self) -> Factories:
        """Make a `core.interfaces.Simulator`."""

    @hookspec
    def vlms(self) -> Factories:
        """Make a `core.interfaces.VLM`."""

    @hookspec
    def tool_representations(self) -> Factories:
        """Make a `core.interfaces.ToolRepresentation`."""

    @hookspec
    def action_representations(self) -> Factories:
        """Make a `core.interfaces.ActionRepresentation`."""

    @hookspec
    def evolution_strategies(self) -> Factories:
        """Make a `core.interfaces.EvolutionStrategy`; the factory also receives ``designer`` and ``budget``."""

    @hookspec
    def fitness_functions(self) -> Factories:
        """Make a `core.interfaces.Fitness`; the factory also receives ``condition``."""

    @hookspec
    def executors(self) -> Factories:
        """Make a `core.interfaces.Executor`."""

    @hookspec
    def listeners(self) -> Factories:
        """Make an object that implements some of `Events` with `hookimpl`."""

    @hookspec
    def commands(self) -> Mapping[str, Command]:
        """Give commands by their names: each with a line of help, and what to call. They are no factories."""


class Configs(Protocol):
    """What a plugin may bring beside parts."""

    @hookspec
    def levels(self) -> Factories:
        """Make a `core.task.Level` of ``prompt.context``, without settings."""

    @hookspec
    def prompt_values(self) -> Factories:
        """Compute what templates of prompts show under a name: a `core.designs.prompt_values.PromptValue`."""

    @hookspec
    def readers(self) -> Factories:
        """Read designs that are not spelled as they were asked for: a `core.designs.replies.Reader`, ``designs``."""

    @hookspec
    def tool_rules(self) -> Factories:
        """Refuse tools: a `core.designs.rules.ToolRule`, which every tool must pass."""

    @hookspec
    def figures(self) -> Factories:
        """Measure rollouts: each is a `core.trial.Figure`, which all trials then have under its name."""

    @hookspec
    def artists(self) -> Factories:
        """Draw what prompts show: makes a `core.search.designer.Artist` of assignment, composer and engine."""

    @hookspec
    def critics(self) -> Factories:
        """Say before each generation what fails, with ``prompt.critic``: makes a `core.search.designer.Critic`."""

    @hookspec
    def memories(self) -> Factories:
        """Recall other runs, and write what this one taught: makes a `core.search.designer.Memory`."""

    @hookspec
    def menders(self) -> Factories:
        """Send designs that break a rule back, with ``prompt.repair``: makes a `core.search.answers.Mender`."""

    @hookspec
    def exports(self) -> Factories:
        """Write what one takes from a run: called with its `Result`, its `Run` and its strategy at the end."""

    @hookspec
    def goals(self) -> Factories:
        """Offer kinds of goals for scene files, which have ``keys`` (`core.goals.Goal`): each is a class."""

    @hookspec
    def makers(self) -> Factories:
        """Judge whether a tool can be made: called with a `Run`, a `Condition` and an `Evaluation` of a design tried in
        it. Returns a `core.trial.Making`, or None where there is nothing to make."""

    @hookspec
    def importers(self) -> Factories:
        """Take a file that others made, by what it is (`core.imports.kinds`): called with its path and the settings of
        ``vlmgineer import``. Returns a `Taken`."""

    @hookspec
    def config_path(self) -> str:
        """Name the package that holds the plugin's Hydra configs, ``"pkg://my_package.conf"``.

        It has a folder per config group, and in it a file per part, ``sim/mine.yaml``. A part without a file has the
        defaults of its factory's signature.
        """


class Events:
    """The events of a run, in their order. A listener implements the events that it wants; the loop waits for it.

    **Threads.** Events come one after the other from the run's thread, but for `reply_received`.

    **Order.** The run's store hears each event first: what a listener hears of is on disk.

    **What may be lost.** A listener that raises is reported in one line, and from then on receives no event but
    `run_ended`; the run goes on without it. A run that is killed ends without `run_ended`.
    """

    @hookspec
    def run_started(self, run: Run) -> None:
        """All parts are made; the model has not been asked yet."""

    @hookspec
    def generation_started(self, index: int) -> None:
        """A generation begins; 0 is the first sampling."""

    @hookspec
    def request_composed(self, request: Request) -> None:
        """A model is about to be asked."""

    @hookspec
    def reply_received(self, request: Request, reply: Reply) -> None:
        """A model answered; the text is not parsed yet. This event comes from another thread than the others."""

    @hookspec
    def candidate_evaluated(self, evaluation: Evaluation) -> None:
        """A candidate was tried, or rejected."""

    @hookspec
    def generation_finished(self, generation: Generation) -> None:
        """The strategy has received all evaluations of the generation."""

    @hookspec
    def finalist_tried(self, evaluation: Evaluation) -> None:
        """A candidate that earns what the best one earns was tried in a further layout (`Evaluation.finals`)."""

    @hookspec
    def run_finished(self, run: Run, result: Result) -> None:
        """The loop ended, and the best design is on disk."""

    @hookspec
    def run_ended(self) -> None:
        """Always the last event, also after an error or an interrupt: release files and processes."""
