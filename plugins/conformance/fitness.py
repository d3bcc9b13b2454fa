"""Checks that every fitness must pass. Each takes a factory, ``make(evaluator)``, and raises an AssertionError.

Candidates are tried for real: in the first task and the first engine that are installed, for a second each.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from core.design import Candidate, Evaluation
from core.designs.planning import NO_PLAN
from core.errors import RAISED
from core.interfaces import Fitness, RolloutSettings, Waypoints
from core.plugins import PluginPart, installed
from core.simulation.rollout import Evaluator
from plugins.conformance.checking import as_json, between, expect, some_simulator, some_task
from plugins.conformance.worlds import stick

Make = Callable[[Evaluator], Fitness]
QUICK = RolloutSettings(segment_s=0.2, settle_s=0.05, hold_s=0.1, max_motion_s=2.0)
BREAKS = "breaks"


@dataclass(frozen=True)
class Breaking(Evaluator):
    """Reports a failure for each candidate named `BREAKS`, as for a rollout that broke."""

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        return [
            Evaluation(e.candidate, "failed", reason="it broke") if e.candidate.strategy_name == BREAKS else e
            for e in super().__call__(candidates)
        ]


def evaluator() -> Evaluator:
    """An evaluator in the first task and the first engine that are installed."""
    return Breaking(PluginPart("task", installed().ready("task")[0]), PluginPart("sim", some_simulator()[0]), 0, QUICK)


def candidates(*lengths: float, steps: int = 1) -> list[Candidate]:
    """A candidate for each length of a stick: from home a little to the side, in so many steps."""
    home = some_task().home
    tools = {length: stick(length) for length in lengths}
    made = []
    for number, length in enumerate(lengths):
        plan = np.tile([*home.position, *home.rpy], (steps, 1))
        plan[:, 1] += 0.01 * (number + 1) + 0.1 * (np.arange(steps) % 2)
        made.append(Candidate(tools[length], Waypoints(plan), action=number))
    return made


def figures(evaluations: Sequence[Evaluation]) -> list[tuple[str, float]]:
    return [(evaluation.status, float(evaluation.reward)) for evaluation in evaluations]


def check_each_candidate_has_its_evaluation(make: Make) -> None:
    tried, fitness = candidates(0.1, 0.1, 0.15), make(evaluator())
    expect(isinstance(fitness.instructions(), str), "instructions did not return a text")
    expect(fitness([]) == [], "without candidates it did not return an empty list")
    evaluations = fitness(tried)
    expect(isinstance(evaluations, list), f"it returned a {type(evaluations).__name__}, not a list of Evaluation")
    owners = [evaluation.candidate.id for evaluation in evaluations]
    wanted = [candidate.id for candidate in tried]
    expect(owners == wanted, f"candidates {', '.join(wanted)} have evaluations of {', '.join(owners)}; keep the order")
    for evaluation in evaluations:
        between("a reward", evaluation.reward, 0.0, 1.0)
        as_json(dict(evaluation.figures), "what an evaluation has as figures")


def check_it_travels_to_workers(make: Make) -> None:
    """A pickled copy gives the same evaluations."""
    fitness = make(evaluator())
    try:
        copy = pickle.loads(pickle.dumps(fitness))  # noqa: S301 - written in this line
    except RAISED as error:
        raise AssertionError(f"it can't be pickled, and workers need a copy: {error}") from error
    tried = candidates(0.1, 0.1, 0.1)
    _expect_same("by a pickled copy", fitness(tried), copy(tried))


def check_the_same_again(make: Make) -> None:
    """The same candidates earn the same again, after others too."""
    fitness = make(evaluator())
    tried = candidates(0.1, 0.1, 0.1)
    first = fitness(tried)
    fitness(candidates(0.2))
    _expect_same("again (draw from a seed that is a setting)", first, fitness(tried))


def check_a_batch_gives_what_each_alone_gives(make: Make) -> None:
    """With a ``batch`` greater than 1 candidates need not share a tool."""
    fitness = make(evaluator())
    batch = fitness.batch
    expect(isinstance(batch, int) and batch >= 1, f"batch is {batch!r}, not a number from 1 up")
    tried = candidates(0.1, 0.15, 0.1) if batch > 1 else candidates(0.1, 0.1, 0.1)
    alone = [fitness([candidate])[0] for candidate in tried]
    _expect_same("each alone", fitness(tried), alone)


def _expect_same(what: str, first: Sequence[Evaluation], other: Sequence[Evaluation]) -> None:
    one, two = figures(first), figures(other)
    expect(one == two, f"the same candidates earned {one}, and {what} {two}")


def check_rejected_and_failed_candidates_earn_nothing(make: Make) -> None:
    """They keep their place, say why, and leave their neighbours as they are."""
    fitness = make(evaluator())
    (sound,) = candidates(0.1)
    (slow,) = candidates(0.1, steps=20)
    unread = Candidate(None, NO_PLAN, problem="the tool is missing")
    broken = Candidate(sound.tool, sound.plan, strategy_name=BREAKS)
    first, beside, second, failed = fitness([unread, sound, slow, broken])
    for evaluation in (first, second):
        expect(evaluation.status == "rejected", f"a rejected candidate has the status {evaluation.status!r}")
    for evaluation in (first, second, failed):
        nothing = evaluation.reward == 0 and evaluation.reason
        expect(nothing or evaluation.status == "ok", f"a {evaluation.status} candidate needs the reward 0 and a reason")
    _expect_same("beside rejected ones", fitness([sound]), [beside])
