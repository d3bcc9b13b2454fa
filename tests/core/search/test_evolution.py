import threading
from dataclasses import replace

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.errors import Fault, LimitReached, UserError
from core.events import INTERRUPTED
from core.geometry import Box, Pose
from core.hooks import hookimpl
from core.interfaces import CHUNK, Budget, EvolutionStrategy
from core.plugins import event_hub, installed
from core.search.evolution import evolve
from core.search.finalists import Race
from core.trial import TIE
from plugins.conformance.evaluations import tried_once
from tests.support.executors import Inline
from tests.support.playing import scripted


def tool(name="rod"):
    return Tool((Component(name, "tool_mount", Pose(), Box((0.1, 0.1, 0.1))),))


def population(generation, *plans_per_tool, problem=None):
    return [
        Candidate(
            own,
            np.full((1, 6), generation + action / 100),
            generation,
            0,
            strategy,
            action,
            problem=problem,
        )
        for strategy, plans in enumerate(plans_per_tool)
        for own in [tool(f"rod_{strategy}")]
        for action in range(plans)
    ]


class Scripted(EvolutionStrategy):
    """Asks for the generations that it is given."""

    def __init__(self, generations):
        super().__init__(None, None)
        self.generations = generations
        self.asked = 0
        self.evaluated = []

    def ask(self):
        self.asked += 1
        return iter(self.generations[self.asked - 1])

    def tell(self, evaluations):
        self.evaluated.append(list(evaluations))


class Diary:
    def __init__(self, strategy):
        self.entries = []
        self.strategy = strategy

    @hookimpl
    def generation_started(self, index):
        self.entries.append(f"start {index}")

    @hookimpl
    def candidate_evaluated(self, evaluation):
        self.entries.append(evaluation.candidate.id)
        # Before tell.
        assert len(self.strategy.evaluated) == evaluation.candidate.generation

    @hookimpl
    def generation_finished(self, generation):
        self.entries.append(f"finish {generation.index}")
        assert len(self.strategy.evaluated) == generation.index + 1  # after tell


def reward_of(candidate):
    return (1 + candidate.generation) * (candidate.design + candidate.action) / 100


def earn(chunk):
    return [
        tried_once(candidate, "ok", reward=reward_of(candidate), distance_m=1.0)
        for candidate in chunk
    ]


def evaluate_all(candidates, evaluate, executor):
    trials, fitness = scripted(evaluate, executor)
    return trials.evaluate(candidates, fitness)


def run(
    asked,
    evaluate=earn,
    executor=None,
    known=(),
    tie=TIE,
    watch=Diary,
    least=0,
    **budget,
):
    """Search with generations, or with a strategy that has them."""
    strategy = asked if isinstance(asked, Scripted) else Scripted(asked)
    strategy.tie = tie
    diary = watch(strategy)
    events = event_hub()
    events.register(diary)
    last = len(strategy.generations) - 1
    limits = {"n_iteration": last, "stop_reward": None, **budget}
    spent = Budget(1, 1, 1, k_top=5, reward_save=0.5, **limits)
    trials, fitness = scripted(evaluate, executor or Inline())
    race = Race(iter(()), fitness, trials, tie)
    (condition,) = fitness.conditions()
    trials.known.update(
        {(e.candidate.content, condition.where): e.trials[0] for e in known}
    )
    robot = installed().default_robot
    found = evolve(strategy, race, spent, events, robot, least=least)
    return found, strategy, diary.entries


# --- the loop ---------------------------------------------------------------------------------------------------


def test_events_come_in_order():
    _, strategy, diary = run([population(0, 2), population(1, 1)])
    assert diary == [
        "start 0",
        "g0-a0-s0-p0",
        "g0-a0-s0-p1",
        "finish 0",
        "start 1",
        "g1-a0-s0-p0",
        "finish 1",
    ]
    assert strategy.asked == 2


@pytest.mark.parametrize("seed", range(5))
def test_the_strategy_gets_results_in_order_however_they_arrive(seed):
    order = np.random.default_rng(seed)
    generations = [population(0, 12, 1, 9), population(1, 3, 3)]
    result, strategy, _ = run(generations, executor=Inline(order))
    for evaluated, generation in zip(strategy.evaluated, generations, strict=True):
        assert [e.candidate for e in evaluated] == generation
    for generation, evaluated in zip(
        result.generations, strategy.evaluated, strict=True
    ):
        assert list(generation.evaluations) == evaluated


@pytest.mark.parametrize(
    ("stop_reward", "generations"), [(0.04, 2), (0.041, 3), (None, 4), (0.01, 1)]
)
def test_a_reward_that_is_enough_ends_the_run(stop_reward, generations):
    """The best of generation i is 0.02 * (i + 1)."""
    result, strategy, diary = run(
        [population(i, 3) for i in range(4)], stop_reward=stop_reward
    )
    assert (
        len(result.generations)
        == strategy.asked
        == len(strategy.evaluated)
        == generations
    )
    assert diary[-1] == f"finish {generations - 1}"


@pytest.mark.parametrize(("least", "generations"), [(1, 2), (3, 3), (4, 4)])
def test_a_reward_that_is_enough_takes_nothing_away_that_was_tried(least, generations):
    asked = [population(i, 3) for i in range(4)]
    result, _, _ = run(asked, stop_reward=0.04, least=least)
    assert len(result.generations) == generations
    highest = max(generation.best_reward for generation in result.generations)
    assert highest == pytest.approx(0.02 * generations)


def earn_less_later(chunk):
    return [
        tried_once(
            candidate, "ok", reward=0.1 - 0.02 * candidate.generation, distance_m=1.0
        )
        for candidate in chunk
    ]


def test_generations_after_the_goal_need_not_reach_it_again():
    asked = [population(i, 3) for i in range(4)]
    result, _, _ = run(asked, earn_less_later, stop_reward=0.09, least=2)
    assert len(result.generations) == 2


def earn_by_action(rewards):
    """The later an action, the shorter its way; the later a generation, the longer."""
    return lambda chunk: [
        tried_once(
            c,
            "ok",
            reward=rewards[c.action],
            distance_m=2.0 + c.generation - c.action / 10,
        )
        for c in chunk
    ]


def test_ties_are_those_of_all_generations_and_the_strategy_says_how_large():
    """The best of the first generation, g0-a0-s0-p1, earned too little to win in the end."""
    rewards = {0: [0.900, 0.896], 1: [0.903, 0.1]}

    def earn_later(chunk):
        return [e for c in chunk for e in earn_by_action(rewards[c.generation])([c])]

    result, _, _ = run([population(0, 2), population(1, 2)], earn_later)
    assert [g.best.candidate.id for g in result.generations] == [
        "g0-a0-s0-p1",
        "g1-a0-s0-p0",
    ]
    assert result.best.candidate.id == "g0-a0-s0-p0"
    for tie, best in ((0.0, "g1-a0-s0-p0"), (0.01, "g0-a0-s0-p1")):
        result, _, _ = run([population(0, 2), population(1, 2)], earn_later, tie=tie)
        assert (result.best.candidate.id, result.tie) == (best, tie)


@pytest.mark.parametrize(("stop_reward", "generations"), [(0.9, 1), (0.901, 2)])
def test_the_highest_reward_ends_the_run_not_the_winners(stop_reward, generations):
    result, _, _ = run(
        [population(i, 2) for i in range(2)],
        earn_by_action([0.900, 0.896]),
        stop_reward=stop_reward,
    )
    assert len(result.generations) == generations
    assert result.best.reward == 0.896


@pytest.mark.parametrize(
    ("reward", "solved", "stop_reward", "generations"),
    [
        (0.98, False, 0.97, 2),
        (0.98, True, 0.97, 1),
        (0.98, True, 0.99, 2),
        (0.98, False, 0.9, 1),  # so little asks for no more than that
    ],
)
def test_a_reward_near_one_ends_the_run_where_the_task_is_solved(
    reward, solved, stop_reward, generations
):
    def earn_alike(chunk):
        return [tried_once(c, "ok", reward=reward, solved=solved) for c in chunk]

    asked = [population(i, 2) for i in range(2)]
    result, _, _ = run(asked, earn_alike, stop_reward=stop_reward)
    assert len(result.generations) == generations


def test_the_strategy_gets_an_empty_generation_too():
    result, strategy, _ = run([[], population(1, 2)])
    assert strategy.evaluated[0] == []
    assert result.generations[0].best is None
    assert result.generations[0].mean_reward is None
    assert result.best is not None


# --- what is rejected, what fails -------------------------------------------------------------------------------


def test_what_breaks_a_rule_is_never_tried():
    good, bad = population(0, 2, 2), population(0, 0, 0, 2, problem="it has no boxes")
    mixed = [bad[0], good[0], good[1], bad[1], good[2], good[3]]
    executor = Inline()
    result, strategy, diary = run([mixed], executor=executor)
    assert [c for chunk in executor.chunks for c in chunk] == good
    (evaluated,) = strategy.evaluated
    assert [(e.status, e.reason) for e in evaluated] == [("ok", "")] * 4 + [
        ("rejected", "it has no boxes")
    ] * 2
    # Listeners receive the rejected ones too.
    assert sorted(diary[1:-1]) == sorted(c.id for c in mixed)
    assert result.generations[0].count("rejected") == 2
    assert result.n_evaluations == 4


def test_only_the_guilty_one_of_a_broken_chunk_fails():
    calls = []

    def burst(chunk):
        calls.append([c.action for c in chunk])
        if any(c.action == 2 for c in chunk):
            raise RuntimeError("it burst")
        return earn(chunk)

    result, strategy, _ = run([population(0, 5)], burst)
    assert calls == [[0, 1, 2, 3, 4], [0], [1], [2], [3], [4]]
    (evaluated,) = strategy.evaluated
    assert [e.status for e in evaluated] == ["ok", "ok", "failed", "ok", "ok"]
    assert evaluated[2].reason == "RuntimeError: it burst"
    assert evaluated[2].reward == 0
    assert result.best.candidate.action == 4
    assert result.n_evaluations == 5


@pytest.mark.parametrize(
    "error",
    [OSError(28, "No space left on device"), MemoryError(), Fault("it was killed")],
)
def test_a_fault_of_the_machine_is_no_verdict(error):
    """The design would fail for ever, in this run and where it goes on."""
    faults = []

    def fail(chunk):
        if len(chunk) == 1 and chunk[0].action == 1:
            faults.append(error)
            raise error
        return burst(chunk)

    def burst(chunk):
        if len(chunk) > 1:
            raise error
        return earn(chunk)

    evaluations = []
    with pytest.raises(
        UserError, match=r"candidate g0-a0-s0-p1 can't be tried: .*fault of the machine"
    ):
        evaluations.extend(evaluate_all(population(0, 3), fail, Inline()))
    assert faults == [error]
    # It has passed when the candidates are tried again.
    _, strategy, _ = run([population(0, 3)], burst)
    assert [e.status for e in strategy.evaluated[0]] == ["ok"] * 3


# --- chunks -----------------------------------------------------------------------------------------------------


def test_chunks_never_mix_tools_and_are_not_too_long():
    executor = Inline()
    candidates = population(0, 3, CHUNK, 1, 2 * CHUNK + 1, 1)
    assert len(list(evaluate_all(candidates, earn, executor))) == len(candidates)
    for chunk in executor.chunks:
        assert len({id(candidate.tool) for candidate in chunk}) == 1
        assert len(chunk) <= CHUNK
    assert [len(chunk) for chunk in executor.chunks] == [
        3,
        CHUNK,
        1,
        CHUNK,
        CHUNK,
        1,
        1,
    ]
    assert [c for chunk in executor.chunks for c in chunk] == candidates


class ManyAtOnce:
    """Earns like `earn`, and likes ``batch`` candidates at once."""

    def __init__(self, batch, breaks=lambda chunk: False):
        self.batch, self.breaks = batch, breaks

    def __call__(self, chunk):
        if self.breaks(chunk):
            raise RuntimeError("too many")
        return earn(chunk)


def test_an_engine_that_batches_is_given_all_that_has_come_whatever_the_tools():
    executor = Inline()
    candidates = population(0, 3, 1, 4)
    assert {
        e.candidate for e in evaluate_all(candidates, ManyAtOnce(6), executor)
    } == set(candidates)
    assert [len(chunk) for chunk in executor.chunks] == [6, 2]
    assert [c for chunk in executor.chunks for c in chunk] == candidates


def test_what_has_come_is_tried_while_an_engine_that_batches_waits_for_more():
    later = threading.Event()

    def two_replies():
        yield from population(0, 3)
        assert later.wait(60)
        yield from population(0, 3, 2)[3:]

    executor = Inline()
    evaluations = evaluate_all(two_replies(), ManyAtOnce(100), executor)
    first = [next(evaluations) for _ in range(3)]
    later.set()
    assert len(first) + len(list(evaluations)) == 5
    assert [len(chunk) for chunk in executor.chunks] == [3, 2]


def test_a_batch_that_breaks_is_tried_in_smaller_ones_and_at_last_one_by_one():
    executor = Inline()
    candidates = population(0, CHUNK + 4, CHUNK)
    bad = candidates[CHUNK + 5]
    evaluations = list(
        evaluate_all(candidates, ManyAtOnce(100, lambda chunk: bad in chunk), executor)
    )
    assert [len(chunk) for chunk in executor.chunks] == [
        2 * CHUNK + 4,
        CHUNK,
        CHUNK,
        4,
        *[1] * CHUNK,
    ]
    assert [e.candidate for e in evaluations if e.status == "failed"] == [bad]
    assert len(evaluations) == len(candidates)


def test_what_candidates_raise_while_they_are_gathered_is_raised():
    def broken():
        yield from population(0, 2)
        raise RuntimeError("no more ideas")

    with pytest.raises(RuntimeError, match="no more ideas"):
        list(evaluate_all(broken(), ManyAtOnce(100), Inline()))


# --- identical candidates ---------------------------------------------------------------------------------------


def alike(*ids, plan=0.0, own=None):
    """Candidates of one content, by (generation, agent, strategy, action)."""
    own = own or tool()
    return [
        Candidate(own, np.full((1, 6), plan), *key, design_name=f"{key}") for key in ids
    ]


def tried(executor):
    return [candidate.id for chunk in executor.chunks for candidate in chunk]


def test_identical_candidates_are_tried_once_and_earn_the_same():
    first = [
        *alike((0, 0, 0, 0), (0, 1, 0, 0)),
        *alike((0, 1, 0, 1), plan=0.5),
        *alike((0, 2, 0, 0)),
    ]
    later = [*alike((1, 0, 0, 0)), *alike((1, 0, 0, 1), plan=0.25)]
    executor = Inline()
    result, strategy, diary = run([first, later], executor=executor)
    assert tried(executor) == ["g0-a0-s0-p0", "g0-a1-s0-p1", "g1-a0-s0-p1"]
    evaluated = {
        e.candidate.id: e.reward
        for e in [*strategy.evaluated[0], *strategy.evaluated[1]]
    }
    assert (
        evaluated["g0-a0-s0-p0"]
        == evaluated["g0-a1-s0-p0"]
        == evaluated["g0-a2-s0-p0"]
        == evaluated["g1-a0-s0-p0"]
    )
    # Each is reported once.
    assert sorted(diary) == sorted(
        ["start 0", "finish 0", "start 1", "finish 1", *evaluated]
    )
    in_order = sorted(first, key=lambda candidate: candidate.key)
    assert [e.candidate.design_name for e in strategy.evaluated[0]] == [
        c.design_name for c in in_order
    ]
    assert result.n_evaluations == 6


def test_what_is_said_about_a_tool_makes_no_difference_and_what_it_is_does():
    rod = tool()
    same = replace(rod, name="a rod", description="to poke with")
    longer = Tool((replace(rod.components[0], shape=Box((0.1, 0.1, 0.1 + 1e-15))),))
    turned = Tool(
        (replace(rod.components[0], pose=Pose.xyz_rpy((0, 0, 0), (0, 0, 1e-15))),)
    )
    open_hand = Tool(gripper=True)
    contents = [
        Candidate(own, np.zeros((1, 6))).content
        for own in (rod, same, longer, turned, Tool(), open_hand)
    ]
    assert contents[0] == contents[1]
    assert len(set(contents)) == 5
    plans = (
        np.zeros((1, 6)),
        np.zeros((2, 3)),
        np.zeros((1, 7)),
        np.zeros((1, 6)) + 1e-300,
    )
    assert len({Candidate(rod, plan).content for plan in plans}) == 4


# --- what is known, limits, interrupts --------------------------------------------------------------------------


def test_what_is_known_is_not_tried():
    known = [tried_once(population(0, 2)[1], "ok", reward=0.75, distance_m=3.0)]
    executor = Inline()
    result, strategy, diary = run([population(0, 3)], executor=executor, known=known)
    assert tried(executor) == ["g0-a0-s0-p0", "g0-a0-s0-p2"]
    assert [e.reward for e in strategy.evaluated[0]] == [0.0, 0.75, 0.02]
    assert sorted(diary[1:-1]) == ["g0-a0-s0-p0", "g0-a0-s0-p1", "g0-a0-s0-p2"]
    assert result.best.reward == 0.75


class Limited(Scripted):
    """Reaches its limit after ``last`` candidates of the last generation."""

    def __init__(self, generations, last):
        super().__init__(generations)
        self.last = last

    def ask(self):
        candidates = list(super().ask())
        if self.asked < len(self.generations):
            yield from candidates
        else:
            yield from candidates[: self.last]
            raise LimitReached("3 dollars are spent")


@pytest.mark.parametrize("last", [0, 3])
def test_a_limit_ends_the_run_with_what_there_is(last):
    strategy = Limited([population(0, 2), population(1, 4)], last)
    result, _, diary = run(strategy, executor=Inline(np.random.default_rng(1)))
    assert result.stopped == "3 dollars are spent"
    assert [len(generation.evaluations) for generation in result.generations] == [2, 3][
        : 1 + bool(last)
    ]
    assert result.best.candidate.id == ("g1-a0-s0-p2" if last else "g0-a0-s0-p1")
    assert len(strategy.evaluated) == 1
    assert "finish 1" not in diary  # it may go on where the limit is raised


@pytest.mark.parametrize(
    ("when", "arrived"),
    [
        ("while one is tried", 2),
        ("while one is reported", 1),
        ("while a generation ends", 4),
    ],
)
def test_an_interrupt_ends_the_run_with_what_there_is(when, arrived):
    def interrupted(chunk):
        if (
            when == "while one is tried"
            and chunk[0].generation == 1
            and chunk[0].design == 1
        ):
            raise KeyboardInterrupt
        return earn(chunk)

    class Impatient(Diary):
        @hookimpl
        def candidate_evaluated(self, evaluation):
            if (
                when == "while one is reported"
                and evaluation.candidate.id == "g1-a0-s0-p1"
            ):
                raise KeyboardInterrupt

        @hookimpl
        def generation_finished(self, generation):
            if when == "while a generation ends" and generation.index == 1:
                raise KeyboardInterrupt

    generations = [population(0, 2, 2), population(1, 2, 2), population(2, 2)]
    result, strategy, _ = run(generations, interrupted, watch=Impatient)
    assert result.stopped == INTERRUPTED
    assert [len(generation.evaluations) for generation in result.generations] == [
        4,
        arrived,
    ]
    assert strategy.asked == 2


def test_rollouts_that_the_budget_does_not_hold_end_the_search():
    """What broke a rule takes none, and equal designs take theirs once."""
    equal = [replace(candidate, agent=1) for candidate in population(0, 1)]
    first = [*population(0, 1), *equal, *population(0, 0, 1, problem="too heavy")]
    result, strategy, _ = run([first, population(1, 1), population(2, 2)], n_rollouts=3)
    assert [e.candidate.id for e in result.evaluations] == [
        "g0-a0-s0-p0",
        "g0-a0-s1-p0",
        "g0-a1-s0-p0",
        "g1-a0-s0-p0",
        "g2-a0-s0-p0",
    ]
    assert result.rollouts == 3
    assert len(strategy.evaluated) == 2
    assert result.stopped == "budget.n_rollouts=3: 0 left, and a candidate takes 1"


@pytest.mark.thorough
def test_processes_come_to_the_same_as_this_one():
    """Candidates are read in another thread then, while results come: identical and rejected ones, and a limit."""
    asked = [
        *population(0, 3, 3),
        *alike((0, 1, 0, 0), (0, 1, 0, 1), (0, 2, 0, 0)),
        *population(0, 0, 0, 0, 2, problem="a rule"),
    ]
    again = [replace(candidate, generation=1) for candidate in asked]
    found = []
    for executor in (Inline(), installed().create("executor", "local", {"workers": 2})):
        strategy = Limited([asked, again], 5)
        with executor:
            result, *_ = run(strategy, executor=executor)
        found.append(
            [
                [(e.candidate.id, e.status, e.reward) for e in g.evaluations]
                for g in result.generations
            ]
        )
        assert result.stopped == "3 dollars are spent"
    assert found[0] == found[1]
    assert [len(generation) for generation in found[0]] == [11, 5]
