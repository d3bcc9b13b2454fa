"""Rewards less what the way costs."""

from core.interfaces import Fitness, Score


class Thrifty(Fitness):
    """``per_metre``: what a metre of the end-effector's way costs."""

    def __init__(self, condition, per_metre: float = 0.01):
        self.condition = condition
        self.per_metre = per_metre

    def conditions(self):
        return [self.condition]

    def score(self, candidate, trials):
        (trial,) = trials
        if trial.status != "ok":
            return Score(0.0)
        reward = trial.reward - self.per_metre * trial.distance_m
        return Score(max(0.0, reward), {"before_costs": trial.reward})
