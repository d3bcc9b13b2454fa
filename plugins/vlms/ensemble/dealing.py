"""Choose the member of an ensemble that answers a request, by what its answers have earned for their cost."""

from __future__ import annotations

from collections.abc import Sequence
from math import fsum
from statistics import fmean

import numpy as np


class Dealer:
    """Ranks members by Thompson sampling for bandits with a budget.

    Y. Xia et al., "Thompson Sampling for Budgeted Multi-armed Bandits", IJCAI 2015: of each member the mean reward is
    drawn from its Beta posterior, and the highest ratio of reward and cost goes first. The cost is not drawn, but the
    mean of what was paid, since a model's calls cost much alike. A reward between 0 and 1 counts as that fraction of a
    success. If the cost of a member that has answered is unknown or 0, rewards alone count.

    A draw depends on the seed, the request and what was heard, in any order: not on when it is made.
    """

    def __init__(self, members: Sequence[str], seed: int) -> None:
        self._seed = seed
        self._rewards: dict[str, list[float]] = {name: [] for name in members}
        self._costs: dict[str, list[float]] = {name: [] for name in members}
        self._priced = True

    def hear(self, member: str, reward: float, cost_usd: float | None) -> None:
        """Take what an answer earned, and its cost; None: it is not known. An answer that failed may have cost 0."""
        self._rewards[member].append(reward)
        if cost_usd:
            self._costs[member].append(cost_usd)
        self._priced &= cost_usd is not None

    def ranking(self, generation: int, agent: int, *, critique: bool = False) -> list[str]:
        """Order the members for a request, the first choice first.

        Members that have not answered yet come first, each for another agent. A ``critique`` earns nothing: there
        only the draw counts.
        """
        rng = np.random.default_rng([self._seed, generation, agent, int(critique)])
        costs = {name: fmean(paid) for name, paid in self._costs.items() if paid} if self._priced else {}
        usual = fmean(costs.values()) if costs else 1.0  # of a member that nothing was paid to yet
        draws = {}
        for name, rewards in self._rewards.items():
            earned = fsum(rewards)
            draws[name] = rng.beta(1 + earned, 1 + len(rewards) - earned) / costs.get(name, usual)
        ranked = sorted(draws, key=lambda name: -draws[name])
        untried = [name for name, rewards in self._rewards.items() if not rewards]
        if agent < len(untried) and not critique:
            ranked.sort(key=lambda name: name != untried[agent])
        return ranked
