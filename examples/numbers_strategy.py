"""A (1+1) evolution strategy over the numbers of a hook and its motion. It asks no designer and no model."""

from collections.abc import Iterator, Sequence

import numpy as np

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import Budget, Designer, EvolutionStrategy, Waypoints
from core.trial import Evaluation

# Reach forward and down, x where the pull begins and ends, metres.
FIRST = np.array([0.45, 0.38, 0.62, 0.30])


class NumbersStrategy(EvolutionStrategy):
    """``step``: of the first change, metres. ``seed``: of the random changes."""

    def __init__(
        self, designer: Designer, budget: Budget, step: float = 0.02, seed: int = 0
    ) -> None:
        super().__init__(designer, budget)
        self.random = np.random.default_rng(seed)
        self.step = step
        self.best = FIRST
        self.reward = -1.0
        self.tried = FIRST
        self.generation = 0

    def ask(self) -> Iterator[Candidate]:
        if self.generation > 0:
            change = self.random.standard_normal(len(self.best))
            self.tried = self.best + self.step * change
        yield self.candidate(self.tried)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self.generation += 1
        reward = max((evaluation.reward for evaluation in evaluations), default=-1.0)
        if reward >= self.reward:
            self.best = self.tried
            self.reward = reward
            self.step *= 1.5
        else:
            self.step *= 1.5**-0.25

    def candidate(self, numbers: np.ndarray) -> Candidate:
        reach, drop, begin, end = numbers
        bar = Component(
            "bar",
            "tool_mount",
            Pose(np.array([reach / 2, 0.0, -0.01])),
            Box((reach, 0.02, 0.02)),
            mass=0.05,
        )
        post = Component(
            "post",
            "bar",
            Pose(np.array([reach / 2, 0.0, -drop / 2])),
            Box((0.02, 0.06, drop)),
            mass=0.05,
        )
        low = drop + 0.02  # the post ends above the table
        places = [(begin, 0.55), (begin, low), (end, low)]  # x and z of the flange
        plan = np.array([[x, 0.0, z, 0.0, 0.0, 0.0] for x, z in places])
        return Candidate(Tool((bar, post)), Waypoints(plan), self.generation)
