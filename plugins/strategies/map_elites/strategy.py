"""MAP-Elites: the best of each kind of tool and motion in an archive, and offspring of different kinds.

J.-B. Mouret and J. Clune, "Illuminating search spaces by mapping elites", 2015.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from core.design import Candidate
from core.hooks import Harmless
from core.interfaces import Budget, Designer, EvolutionStrategy, ToolRepresentation
from core.trial import Evaluation, best_first, best_tools
from plugins.strategies.map_elites.archive import (
    Archive,
    read_measures,
    save_archive,
)


class MapElites(EvolutionStrategy):
    """Show the model elites from different cells of an archive.

    Elites are drawn at random with the run's seed. The best one is always among them, and better ones come more often.

    Args:
        designer: asks the model for candidates.
        budget: ``k_top`` elites are shown, which it admits.
        measures: the axes of the archive (`plugins.strategies.map_elites.archive.read_measures`).

    Raises:
        UsageError: a measure can't be used.
    """

    def __init__(
        self,
        designer: Designer,
        budget: Budget,
        measures: Harmless[list[str | dict[str, Any]]] = ["extent", "distance"],  # noqa: B006
    ) -> None:
        super().__init__(designer, budget)
        self._archive = Archive(read_measures(measures))
        self._generation = 0

    def write_archive(
        self,
        ranking: Sequence[Evaluation],
        representation: ToolRepresentation,
        folder: Path,
    ) -> None:
        """Write the best of each cell, and a few more that a user may want."""
        archive = Archive(self._archive.measures)
        archive.add(ranking)
        save_archive(archive, ranking, representation, folder, self.tie)

    def ask(self) -> Iterator[Candidate]:
        rng = np.random.default_rng(
            [getattr(self.designer, "seed", 0), self._generation]
        )
        ranking = best_first(self._archive.best(self.tie).values(), self.tie)
        return self.designer.design(self._generation, self._elites(ranking, rng))

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self._generation += 1
        self._archive.add(evaluations)

    def _elites(
        self, ranking: Sequence[Evaluation], rng: np.random.Generator
    ) -> list[Evaluation]:
        ranked = enumerate(best_tools(ranking))
        tools = [e for place, e in ranked if self.budget.admits(place, e.reward)]
        count = min(len(tools), self.budget.k_top) - 1
        if count < 1:
            return tools[:1]
        weights = np.arange(len(tools) - 1, 0, -1.0)  # by rank
        others = rng.choice(
            len(tools) - 1, count, replace=False, p=weights / weights.sum()
        )
        return [tools[0], *(tools[1 + i] for i in sorted(others))]
