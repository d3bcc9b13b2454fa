"""Rewards less what the way costs."""

from dataclasses import replace

from core.interfaces import Fitness


class Thrifty(Fitness):
    """``per_metre``: what a metre of the end-effector's way costs."""

    def __init__(self, evaluator, per_metre: float = 0.01):
        self.evaluator = evaluator
        self.per_metre = per_metre

    @property
    def batch(self):
        return self.evaluator.batch

    def __call__(self, candidates):
        return [self.less(evaluation) for evaluation in self.evaluator(candidates)]

    def less(self, evaluation):
        if evaluation.status != "ok":
            return evaluation
        reward = evaluation.reward - self.per_metre * evaluation.distance_m
        return replace(evaluation, reward=max(0.0, reward), figures={"before_costs": evaluation.reward})
