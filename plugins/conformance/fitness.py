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
from plugins.conformance.checking import as_json, expect, some_simulator, some_task
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


def candidates(lengths: Sequence[float] = (0.1, 0.1, 0.1), *, steps: int = 1) -> list[Candidate]:
    """A candidate for each length of a stick: from home a little to the side, in so many steps."""
    home, found = some_task().home, []
    tools = {length: stick(length) for length in lengths}
    for number, length in enumerate(lengths):
        plan = np.tile([*home.position, *home.rpy], (steps, 1))
        plan[:, 1] += 0.01 * (number + 1) + 0.1 * (np.arange(steps) % 2)
        found.append(Candidate(tools[length], Waypoints(plan), action=number))
    return found


def figures(evaluations: Sequence[Evaluation]) -> list[tuple[str, float]]:
    return [(evaluation.status, float(evaluation.reward)) for evaluation in evaluations]


def check_each_candidate_has_its_evaluation(make: Make) -> None:
    tried, fitness = candidates((0.1, 0.1, 0.15)), make(evaluator())
    expect(isinstance(said := fitness.instructions(), str), f"instructions returned {said!r}, not a text")
    expect((none := fitness([])) == [], f"without candidates it returned {none!r}, not an empty list")
    evaluations = fitness(tried)
    expect(isinstance(evaluations, list), f"it returned a {type(evaluations).__name__}, not a list of Evaluation")
    expect(len(evaluations) == len(tried), f"{len(tried)} candidates have {len(evaluations)} evaluations")
    for candidate, evaluation in zip(tried, evaluations, strict=True):
        expect(isinstance(evaluation, Evaluation), f"it returned a {type(evaluation).__name__}, not an Evaluation")
        got = evaluation.candidate.id
        expect(got == candidate.id, f"the evaluation of {candidate.id} belongs to {got}; keep the order")
        expect(0 <= evaluation.reward <= 1, f"a reward is {evaluation.reward}, not in [0, 1]")
        as_json(dict(evaluation.figures), "what an evaluation has as figures")


def check_it_travels_to_workers(make: Make) -> None:
    """A pickled copy gives the same evaluations."""
    fitness = make(evaluator())
    try:
        copy = pickle.loads(pickle.dumps(fitness))  # noqa: S301 - written in this line
    except RAISED as error:
        raise AssertionError(f"it can't be pickled, and workers need a copy: {error}") from error
    one, other = figures(fitness(candidates())), figures(copy(candidates()))
    expect(one == other, f"a pickled copy gives {other} instead of {one}")


def check_the_same_again(make: Make) -> None:
    """The same candidates earn the same again, after others too."""
    fitness = make(evaluator())
    first = figures(fitness(candidates()))
    fitness(candidates((0.2,)))
    again = figures(fitness(candidates()))
    expect(first == again, f"the same candidates earned {first}, then {again}; draw from a seed that is a setting")


def check_a_batch_gives_what_each_alone_gives(make: Make) -> None:
    """With a ``batch`` greater than 1 candidates need not share a tool."""
    fitness = make(evaluator())
    batch = fitness.batch
    expect(isinstance(batch, int) and batch >= 1, f"batch is {batch!r}, not a number from 1 up")
    tried = candidates((0.1, 0.15, 0.1) if batch > 1 else (0.1, 0.1, 0.1))
    together = figures(fitness(tried))
    alone = [figures(fitness([candidate]))[0] for candidate in tried]
    expect(together == alone, f"candidates earn {together} together and {alone} alone")


def check_rejected_and_failed_candidates_earn_nothing(make: Make) -> None:
    """They keep their place, say why, and leave their neighbours as they are."""
    fitness = make(evaluator())
    sound, slow = candidates((0.1,)) + candidates((0.1,), steps=20)
    unread = Candidate(None, NO_PLAN, problem="the tool is missing")
    broken = Candidate(sound.tool, sound.plan, strategy_name=BREAKS)
    evaluations = fitness([unread, sound, slow, broken])
    expect(len(evaluations) == 4, f"4 candidates, of which 3 can't be tried, have {len(evaluations)} evaluations")
    rejected = {"a rejected candidate": evaluations[0], "a candidate with too long a motion": evaluations[2]}
    for what, evaluation in rejected.items():
        expect(evaluation.status == "rejected", f"{what} has the status {evaluation.status!r}")
        expect(evaluation.reward == 0 and evaluation.reason, f"{what} needs the reward 0 and a reason")
    end = evaluations[3]
    expect(end.status == "ok" or (end.reward == 0 and end.reason), "a failed candidate needs the reward 0 and a reason")
    expect(figures(evaluations[1:2]) == figures(fitness([sound])), "a candidate earns otherwise beside rejected ones")
