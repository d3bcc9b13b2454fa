"""Checks that every listener must pass. Each takes a factory, ``make()``, since a listener belongs to one run.

The events are those of small scripted runs, in the order of `core.hooks.Events`. No model is asked.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import OmegaConf

from core.config.compose import load
from core.design import Candidate
from core.errors import RAISED
from core.events import Generation, Result, Run
from core.interfaces import Budget, Reply, Simulator, Waypoints
from core.plugins import event_hub
from core.trial import Evaluation, Score, Trial, Where
from core.values.plans import NO_PLAN
from plugins.conformance.evaluations import tried_once
from plugins.conformance.sample_tools import LengthOnly, rigid
from plugins.conformance.shared import (
    brief,
    describe_error,
    ready,
    request,
    some_simulator,
    some_task,
)

Make = Callable[[], Any]
PLAIN = "a stick"
# What a model may write: markup of several kinds, control characters, other scripts, far too much.
ODD = "[bold]{0} %s </td> \x1b[31m\x00\r\n| \u202e 柄 ```" + "long " * 1000


@lru_cache(maxsize=1)
def _config() -> Any:
    """The configuration of a run of the first task."""
    config = load("config", [f"task={ready('task')[0]}"])
    return OmegaConf.to_container(config, resolve=True)


def script(
    folder: Path, text: str = PLAIN, simulator: Simulator | None = None
) -> list[tuple[str, dict[str, Any]]]:
    """The events of a run in ``folder`` of two generations and an empty one; ``text`` is all that the model writes."""
    config = _config()
    budget = Budget(**config["budget"])
    parts = {}
    for kind, node in config.items():
        if isinstance(node, dict) and "name" in node:
            parts[kind] = node["name"]

    task = some_task()
    tools = LengthOnly()
    run = Run(folder, config, parts, "a model", task, tools, budget, 0, simulator)
    events: list[tuple[str, dict[str, Any]]] = [("run_started", {"run": run})]
    generations: list[Generation] = []
    for index in range(3):
        sent = request(replace(brief(task, tools), generation=index))
        reply = Reply(sent.id, text, "a model", text if index else None, 10, 20)
        generation = Generation(index, _evaluations(index, text) if index < 2 else ())
        generations.append(generation)
        events.append(("generation_started", {"index": index}))
        events.append(("request_composed", {"request": sent}))
        events.append(("reply_received", {"request": sent, "reply": reply}))
        for evaluation in generation.evaluations:
            events.append(("candidate_evaluated", {"evaluation": evaluation}))
        events.append(("generation_finished", {"generation": generation}))

    first = generations[0].evaluations[0]
    result = Result(tuple(generations), 1.5)
    events.append(("finalist_tried", {"evaluation": first}))
    events.append(("run_finished", {"run": run, "result": result}))
    return events


def _evaluations(generation: int, text: str) -> tuple[Evaluation, ...]:
    """One that is ok, a rejected one and a failed one."""
    plan = Waypoints(np.array([[0.45, 0.0, 0.5, 0.0, 0.0, 0.0]]))
    tool = replace(rigid(), name=text, description=text)
    parents = ("g0-a0-s0-p0",) if generation else ()
    whole = Candidate(tool, plan, generation, 0, 0, 0, text, text, text, parents)
    where = Where(text, text, 0)
    figures: dict[str, Any] = {"moved_m": {text: 0.1}, "measured": {"distance_m": 0.3}}
    trial = Trial(where, whole.id, "ok", 0.25, text, warnings=(text,), **figures)
    return (
        Evaluation(whole, (trial,), Score(0.25, {text: 1})),
        Evaluation(Candidate(None, NO_PLAN, generation, 1, problem=text)),
        tried_once(replace(whole, action=1), "failed", reason=text),
    )


def play(listener: object, events: Sequence[tuple[str, dict[str, Any]]]) -> None:
    """Send a listener these events, then ``run_ended``, as a run does: replies come from another thread.

    Raises:
        AssertionError: the listener raised; says where.
    """
    hub = event_hub()
    hub.register(listener)

    with ThreadPoolExecutor(1) as pool:
        for event, content in (*events, ("run_ended", {})):
            send = partial(getattr(hub.hook, event), **content)
            try:
                pool.submit(send).result() if event == "reply_received" else send()
            except RAISED as error:
                what = f"{event} raised {describe_error(error)}"
                raise AssertionError(what) from error


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
        play(make(), script(folder, simulator=simulator))

    return f"with {name}"


def check_odd_texts_are_no_error(make: Make) -> None:
    """Names, reasons and replies are what a model wrote; numbers may be nan."""
    for text in (ODD, ""):
        with scratch() as folder:
            play(make(), script(folder, text))


def check_a_run_may_break_off(make: Make) -> None:
    """After an error ``run_ended`` comes, wherever the run was; the same folder then sees the run go on."""
    with scratch() as folder:
        events = script(folder)
        # Until it started, a request, an evaluation, a generation.
        for count in (1, 3, 5, 8):
            play(make(), events[:count])

        play(make(), events)


def check_a_run_may_end_before_it_starts(make: Make) -> None:
    """If another listener's ``run_started`` raises, ``run_ended`` is the only event."""
    play(make(), [])
