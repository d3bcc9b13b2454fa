"""Checks that every listener must pass. Each takes a factory, ``make()``, since a listener belongs to one run.

The events are those of small scripted runs, in the order of `core.hooks.Events`. No model is asked.
Covered by `tests/core/conformance/test_suites.py`.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np
import pluggy
from omegaconf import OmegaConf

from core.config.compose import load
from core.conformance import checking
from core.conformance.checking import LengthOnly, collect, describe_error, fingers, request, rigid, some_simulator
from core.design import Candidate, Evaluation
from core.events import Generation, Result, Run
from core.hooks import PROJECT, Events
from core.interfaces import Budget, Reply, Simulator
from core.plugins import installed

Make = Callable[[], Any]
PLAIN = "a stick"
# What a model may write: markup of several kinds, control characters, other scripts, far too much.
ODD = "[bold]{0} %s </td> \x1b[31m\x00\r\n| \u202e 柄 ```" + "long " * 1000


@lru_cache(maxsize=1)
def _config() -> tuple[str, dict[str, Any]]:
    """The first task's name, and the configuration of a run of it."""
    name = installed().names("task")[0]
    return name, cast(dict[str, Any], OmegaConf.to_container(load("config", [f"task={name}"]), resolve=True))


class _Broken(Exception):
    """Ends a scripted run early, as an error does."""


class Script:
    """A run in ``folder`` of two generations and an empty one, sent to a listener event by event.

    Every text that a model writes in a run is ``text``. With ``until`` an error ends the run after that event.
    """

    def __init__(
        self, listener: Any, folder: Path, text: str = PLAIN, simulator: Simulator | None = None, until: str = ""
    ) -> None:
        self._hub = pluggy.PluginManager(PROJECT)
        self._hub.add_hookspecs(Events)
        self._hub.register(listener)
        self._text = text
        self._until = until
        name, config = _config()
        budget = Budget(**{field.name: config["budget"][field.name] for field in fields(Budget)})
        parts = {kind: node["name"] for kind, node in config.items() if isinstance(node, dict) and "name" in node}
        task, writing = installed().create("task", name), LengthOnly()
        self._request = request(checking.brief(task, writing))
        self._run = Run(folder, config, parts, "a model", task, writing, budget, 0, simulator)

    def play(self) -> None:
        """Send the events of the whole run, in order."""
        generations: list[Generation] = []
        with contextlib.suppress(_Broken):
            self.send("run_started", run=self._run)
            for index in range(3):
                self.send("generation_started", index=index)
                self._ask(index)
                evaluations = tuple(self._evaluations(index)) if index < 2 else ()
                for evaluation in evaluations:
                    self.send("candidate_evaluated", evaluation=evaluation)
                generations.append(Generation(index, evaluations))
                self.send("generation_finished", generation=generations[-1])
            self.send("run_finished", run=self._run, result=Result(tuple(generations), 1.5))
        self.send("run_ended")

    def send(self, event: str, **content: Any) -> None:
        """Send one event.

        Raises:
            AssertionError: the listener raised; says where.
        """
        try:
            getattr(self._hub.hook, event)(**content)
        except Exception as error:
            raise AssertionError(f"{event} raised {describe_error(error)}") from error
        if event == self._until:
            raise _Broken

    def _ask(self, generation: int) -> None:
        """Send a request, and from another thread its reply, as a run does."""
        sent = replace(self._request, id=f"g{generation}-a0", brief=replace(self._request.brief, generation=generation))
        self.send("request_composed", request=sent)
        reply = Reply(sent.id, self._text, "a model", self._text if generation else None, 10, 20)
        with ThreadPoolExecutor(1) as pool:
            pool.submit(self.send, "reply_received", request=sent, reply=reply).result()

    def _evaluations(self, generation: int) -> Iterator[Evaluation]:
        """Two that are ok, a rejected one and a failed one."""
        text, plan = self._text, np.array([[0.45, 0.0, 0.5, 0.0, 0.0, 0.0]])
        tool = replace(rigid(), name=text, description=text)
        parents = ("g0-a0-s0-p0",) if generation else ()
        whole = Candidate(tool, plan, generation, 0, 0, 0, text, text, text, parents)
        moved, details = {text: 0.1}, {text: [1.0, None, text]}
        yield Evaluation(whole, "ok", 0.25, 0.3, "", 0.001, 0.01, 0.002, moved, (text,), details)
        yield Evaluation(replace(whole, tool=rigid(), action=1, plan=plan + 0.01), "ok", 0.0)
        unread = Candidate(None, np.zeros((0, 6)), generation, 1, problem=text)
        yield Evaluation(unread, "rejected", reason=text)
        gripping = Candidate(fingers(), np.append(plan, [[0.5]], axis=1), generation, 2)
        yield Evaluation(gripping, "failed", reason=text)


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """A folder for a run; what listeners print meanwhile is left out."""
    quiet = io.StringIO()
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.redirect_stdout(quiet),
        contextlib.redirect_stderr(quiet),
    ):
        yield Path(folder)


def check_it_receives_a_whole_run(make: Make) -> str:
    """The run has a simulator, with which a listener may play candidates again."""
    name, simulator = some_simulator()
    with scratch() as folder:
        Script(make(), folder, simulator=simulator).play()
    return f"with {name}"


def check_odd_texts_are_no_error(make: Make) -> None:
    """Names, reasons and replies are what a model wrote; numbers may be nan."""
    with scratch() as folder:
        Script(make(), folder, ODD).play()
        Script(make(), folder, "").play()


def check_a_run_may_break_off(make: Make) -> None:
    """After an error ``run_ended`` comes, wherever the run was; the same folder then sees the run go on."""
    with scratch() as folder:
        for until in ("run_started", "request_composed", "candidate_evaluated", "generation_finished"):
            Script(make(), folder, until=until).play()
        Script(make(), folder).play()


def check_a_run_may_end_before_it_starts(make: Make) -> None:
    """If another listener's ``run_started`` raises, ``run_ended`` is the only event."""
    with scratch() as folder:
        Script(make(), folder).send("run_ended")


CHECKS = collect(globals())
