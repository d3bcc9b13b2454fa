from pathlib import Path

import numpy as np
import pytest

from core.design import Tool
from core.errors import UserError
from core.interfaces import Budget, EvolutionStrategy, GivenTools, Simulator, Task
from core.scene import Scene, table


class Stand(Task):
    def scene(self, seed):
        return Scene((table(),))

    def reward(self, start, end):
        return np.zeros(start.positions.shape[:-2])


class Blind(Simulator):
    def rollout(self, task, jobs):
        return []

    def render(self, task, **_):
        raise NotImplementedError


class Random(EvolutionStrategy):
    def ask(self):
        return iter(())

    def tell(self, evaluations):
        pass


class Bare(GivenTools):
    def given(self, task):
        return Tool()


def test_a_tasks_source_is_its_file():
    assert Stand().source() == Path(__file__).read_text()


def test_a_simulator_need_not_be_stepped():
    with pytest.raises(
        UserError,
        match="Blind plays whole rollouts only; one that can be stepped is needed",
    ):
        Blind().world(Stand(), Tool())


def test_a_given_tool_is_neither_written_nor_read():
    tools = Bare()
    assert (tools.schema(), tools.dump(Tool())) == ({}, {})
    with pytest.raises(TypeError, match="a given tool is not parsed"):
        tools.parse({}, gripper=False)


def test_a_population_is_all_that_agents_are_asked_for():
    assert Budget(2, 3, 4, 1, 5, 0.6).population == 24
