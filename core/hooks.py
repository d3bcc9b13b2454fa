"""The hook specifications: how plugins offer parts, and what listeners hear. All of the plugin contract is on this
page.

A plugin is a module (or object) named by an entry point in the group ``vlmgineer``. It offers a part by implementing
the hook of its kind with `hookimpl`, and returns a mapping from the name that a config says (``sim=NAME``) to a
factory: a class or function called with the part's settings, or a string ``"module:attribute"`` that is imported when
it is first used, which keeps discovery quick::

    from core.hooks import hookimpl

    @hookimpl
    def simulators():
        return {"mine": "my_package.simulator:MySimulator"}
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import pluggy

if TYPE_CHECKING:
    from core.design import Evaluation
    from core.events import Generation, Result, Run
    from core.interfaces import Reply, Request

PROJECT = "vlmgineer"

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)

Factory = Callable[..., Any] | str
Factories = Mapping[str, Factory]


class Parts:
    """One hook per kind of part."""

    @hookspec
    def tasks(self) -> Factories:
        """Make a `core.interfaces.Task`."""
        raise NotImplementedError

    @hookspec
    def simulators(self) -> Factories:
        """Make a `core.interfaces.Simulator`."""
        raise NotImplementedError

    @hookspec
    def vlms(self) -> Factories:
        """Make a `core.interfaces.VLM`."""
        raise NotImplementedError

    @hookspec
    def tool_representations(self) -> Factories:
        """Make a `core.interfaces.ToolRepresentation`."""
        raise NotImplementedError

    @hookspec
    def evolution_strategies(self) -> Factories:
        """Make a `core.interfaces.EvolutionStrategy`; besides its settings the factory is given ``designer`` and
        ``budget``.
        """
        raise NotImplementedError

    @hookspec
    def fitness_functions(self) -> Factories:
        """Make a `core.interfaces.Fitness`; besides its settings the factory is given ``evaluator``."""
        raise NotImplementedError

    @hookspec
    def executors(self) -> Factories:
        """Make a `core.interfaces.Executor`."""
        raise NotImplementedError

    @hookspec
    def listeners(self) -> Factories:
        """Make an object that implements some of `Events` with `hookimpl`."""
        raise NotImplementedError


class Configs:
    """What else a plugin may bring."""

    @hookspec
    def config_path(self) -> str:
        """The package that holds the plugin's Hydra configs, ``"pkg://my_package.conf"``: a folder per config group, in
        it a file per part, ``sim/mine.yaml``. Of a part without one, the config is its factory's defaults.
        """
        raise NotImplementedError


class Events:
    """What happens in a run, in this order. A listener implements the events that it wants; the loop waits for it.

    A listener that raises is reported in one line, and from then on receives no event but `run_ended`.
    """

    @hookspec
    def run_started(self, run: Run) -> None:
        """All parts are made, nothing is asked yet."""

    @hookspec
    def generation_started(self, index: int) -> None:
        """A generation begins; 0 is the first sampling."""

    @hookspec
    def request_composed(self, request: Request) -> None:
        """A model is about to be asked."""

    @hookspec
    def reply_received(self, request: Request, reply: Reply) -> None:
        """A model answered; nobody has read the text yet. This one is called from another thread than the others."""

    @hookspec
    def candidate_evaluated(self, evaluation: Evaluation) -> None:
        """A candidate was tried, or rejected."""

    @hookspec
    def generation_finished(self, generation: Generation) -> None:
        """The strategy was told of all of them."""

    @hookspec
    def run_finished(self, run: Run, result: Result) -> None:
        """The loop ended, and the best design is on disk."""

    @hookspec
    def run_ended(self) -> None:
        """Always last, after an error or an interrupt too: let go of what is held."""
