import numpy as np
import pytest

from core.design import Candidate, Component, Evaluation, Tool
from core.evolution import CHUNK, evaluate_all, evolve
from core.geometry import Box, Pose
from core.hooks import hookimpl
from core.interfaces import Budget, EvolutionStrategy, Executor
from core.plugins import event_hub


def tool(name="rod"):
    return Tool((Component(name, "panda_virtual", Pose(), Box((0.1, 0.1, 0.1))),))


def population(generation, *plans_per_tool, problem=None):
    return [
        Candidate(own, np.zeros((1, 6)), generation, 0, strategy, action, problem=problem)
        for strategy, plans in enumerate(plans_per_tool)
        for own in [tool()]
        for action in range(plans)
    ]


class Here(Executor):
    """In this process; ``order`` shuffles the results' arrival."""

    def __init__(self, order=None):
        self.order = order
        self.chunks = []
        self.read = 0

    def map(self, function, chunks):
        results = []
        for chunk in chunks:
            self.chunks.append(list(chunk))
            try:
                result = function(chunk)
            except Exception as error:
                result = error
            if self.order is None:
                yield chunk, result
            results.append((chunk, result))
        if self.order is not None:
            for i in self.order.permutation(len(results)):
                yield results[i]

    def close(self):
        pass


class Scripted(EvolutionStrategy):
    """Asks for the generations that it is given."""

    def __init__(self, generations):
        super().__init__(None, None)
        self.generations = generations
        self.asked = 0
        self.told = []

    def ask(self):
        self.asked += 1
        return iter(self.generations[self.asked - 1])

    def tell(self, evaluations):
        self.told.append(list(evaluations))


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
        assert len(self.strategy.told) == evaluation.candidate.generation  # not told yet

    @hookimpl
    def generation_finished(self, generation):
        self.entries.append(f"finish {generation.index}")
        assert len(self.strategy.told) == generation.index + 1  # told already


def reward_of(candidate):
    return (1 + candidate.generation) * (candidate.strategy + candidate.action) / 100


def earn(chunk):
    return [Evaluation(candidate, "ok", reward=reward_of(candidate), distance_m=1.0) for candidate in chunk]


def run(generations, evaluate=earn, executor=None, **budget):
    strategy = Scripted(generations)
    diary = Diary(strategy)
    events = event_hub()
    events.register(diary)
    limits = {"n_iteration": len(generations) - 1, "stop_reward": None, **budget}
    found = evolve(strategy, evaluate, executor or Here(), Budget(1, 1, 1, k_top=5, reward_save=0.5, **limits), events)
    return found, strategy, diary.entries


# --- the loop ---------------------------------------------------------------------------------------------------


def test_events_come_in_order():
    _, strategy, diary = run([population(0, 2), population(1, 1)])
    assert diary == ["start 0", "g0-a0-s0-p0", "g0-a0-s0-p1", "finish 0", "start 1", "g1-a0-s0-p0", "finish 1"]
    assert strategy.asked == 2


@pytest.mark.parametrize("seed", range(5))
def test_whatever_order_results_arrive_in_the_strategy_is_told_in_order(seed):
    order = np.random.default_rng(seed)
    generations = [population(0, 12, 1, 9), population(1, 3, 3)]
    result, strategy, _ = run(generations, executor=Here(order))
    for told, generation in zip(strategy.told, generations, strict=True):
        assert [e.candidate for e in told] == generation
    for generation, told in zip(result.generations, strategy.told, strict=True):
        assert list(generation.evaluations) == told


def test_one_generation_more_than_iterations():
    result, strategy, _ = run([population(i, 1) for i in range(9)], n_iteration=3)
    assert strategy.asked == len(result.generations) == 4
    assert [generation.index for generation in result.generations] == [0, 1, 2, 3]


@pytest.mark.parametrize(("stop_reward", "generations"), [(0.04, 2), (0.041, 3), (None, 4), (0.01, 1)])
def test_a_reward_that_is_enough_ends_the_run(stop_reward, generations):
    """The best of generation i is 0.02 * (i + 1)."""
    result, strategy, diary = run([population(i, 3) for i in range(4)], stop_reward=stop_reward)
    assert len(result.generations) == strategy.asked == len(strategy.told) == generations
    assert diary[-1] == f"finish {generations - 1}"


def test_the_best_is_of_all_generations():
    def earn_less_later(chunk):
        return [Evaluation(c, "ok", reward=0.5 / (1 + c.generation), distance_m=2.0 - c.action) for c in chunk]

    result, _, _ = run([population(i, 2) for i in range(3)], earn_less_later)
    assert result.best.candidate.id == "g0-a0-s0-p1"  # the shorter of two equal ones
    assert [generation.best.reward for generation in result.generations] == [0.5, 0.25, 0.5 / 3]
    assert result.generations[1].mean_reward == 0.25


def test_an_empty_generation_is_told_too():
    result, strategy, _ = run([[], population(1, 2)])
    assert strategy.told[0] == []
    assert result.generations[0].best is None
    assert result.generations[0].mean_reward is None
    assert result.best is not None


def test_a_run_in_which_nothing_could_be_tried():
    result, _, _ = run([population(0, 2, problem="a rule")])
    assert result.best is None
    assert result.n_evaluations == 0


# --- what is rejected, what fails -------------------------------------------------------------------------------


def test_what_breaks_a_rule_is_never_tried():
    good, bad = population(0, 2, 2), population(0, 0, 0, 2, problem="it has no boxes")
    mixed = [bad[0], good[0], good[1], bad[1], good[2], good[3]]
    executor = Here()
    result, strategy, diary = run([mixed], executor=executor)
    assert [c for chunk in executor.chunks for c in chunk] == good
    (told,) = strategy.told
    assert [(e.status, e.reason) for e in told] == [("ok", "")] * 4 + [("rejected", "it has no boxes")] * 2
    assert sorted(diary[1:-1]) == sorted(c.id for c in mixed)  # listeners hear of the rejected ones too
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
    (told,) = strategy.told
    assert [e.status for e in told] == ["ok", "ok", "failed", "ok", "ok"]
    assert told[2].reason == "RuntimeError: it burst"
    assert told[2].reward == 0
    assert result.best.candidate.action == 4
    assert result.n_evaluations == 5


def test_a_chunk_that_breaks_does_not_touch_its_neighbours():
    def burst(chunk):
        if chunk[0].strategy == 1 and len(chunk) > 1:
            raise MemoryError
        return earn(chunk)

    executor = Here()
    _, strategy, _ = run([population(0, 3, 3, 3)], burst, executor)
    assert [len(chunk) for chunk in executor.chunks] == [3, 3, 3, 1, 1, 1]
    assert [e.status for e in strategy.told[0]] == ["ok"] * 9


def test_a_failed_one_is_not_the_best():
    def fail(chunk):
        if len(chunk) > 1 or chunk[0].action == 1:
            raise RuntimeError
        return earn(chunk)

    result, _, _ = run([population(0, 2)], fail)
    assert result.best.candidate.action == 0
    assert result.generations[0].count("failed") == 1


# --- chunks -----------------------------------------------------------------------------------------------------


def test_chunks_never_mix_tools_and_are_not_too_long():
    executor = Here()
    candidates = population(0, 3, CHUNK, 1, 2 * CHUNK + 1, 1)
    assert len(list(evaluate_all(candidates, earn, executor))) == len(candidates)
    for chunk in executor.chunks:
        assert len({id(candidate.tool) for candidate in chunk}) == 1
        assert len(chunk) <= CHUNK
    assert [len(chunk) for chunk in executor.chunks] == [3, CHUNK, 1, CHUNK, CHUNK, 1, 1]
    assert [c for chunk in executor.chunks for c in chunk] == candidates


def test_results_are_told_while_candidates_still_come():
    """Listeners must not wait for a model's last reply to hear of the first evaluation."""
    seen = []

    def slowly():
        for candidate in population(0, 2, 2, 2):
            seen.append("asked")
            yield candidate

    evaluations = evaluate_all(slowly(), earn, Here())
    next(evaluations)
    assert len(seen) < 6


def test_a_strategy_that_breaks_ends_the_run():
    class Broken(Scripted):
        def ask(self):
            raise RuntimeError("no more ideas")

    with pytest.raises(RuntimeError, match="no more ideas"):
        evolve(Broken([]), earn, Here(), Budget(1, 1, 1, 0, 5, 0.5), event_hub())
