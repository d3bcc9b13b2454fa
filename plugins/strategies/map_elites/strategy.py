"""MAP-Elites: the best of each kind of tool and motion in an archive, and offspring of different kinds.

J.-B. Mouret and J. Clune, "Illuminating search spaces by mapping elites", 2015. Numbers are varied as V. Vassiliades
and J.-B. Mouret do it, "Discovering the elite hypervolume by leveraging interspecies correlation", GECCO 2018.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from core.design import TIE, Candidate, Evaluation, best_first, best_tools
from core.errors import UsageError
from core.geometry import Array
from core.interfaces import Budget, Designer, EvolutionStrategy, ToolRepresentation
from core.search.refinement import TRIES, Varies
from plugins.strategies.map_elites.archive import Archive, observes, read_measures, save_archive

ISO = 0.5  # the standard deviation of each number, in its steps
LINE = 0.2  # that along the way to another elite, as a share of it


class MapElites(EvolutionStrategy):
    """Show the model elites from different cells of an archive, and vary the numbers of others without it.

    Elites are drawn at random with the run's seed. The best one is always among them, and better ones come more often.

    Args:
        designer: asks the model for candidates; with ``varied`` it is a `core.search.refinement.Varies`.
        budget: ``k_top`` elites, which earned more than ``reward_save``, are shown.
        measures: the axes of the archive (`plugins.strategies.map_elites.archive.read_measures`).
        varied: the number of candidates in each later generation that are varied without the model.
        tie: see `core.interfaces.EvolutionStrategy`.

    Raises:
        UsageError: a measure can't be used, or ``varied`` is negative.
    """

    def __init__(
        self,
        designer: Designer,
        budget: Budget,
        measures: list[str | dict[str, Any]] = ["extent", "distance"],  # noqa: B006
        varied: int = 0,
        tie: float = TIE,
    ) -> None:
        super().__init__(designer, budget, tie)
        if varied < 0:
            raise UsageError(f"evolution.varied must be 0 or greater, got {varied}")
        self._archive = Archive(read_measures(measures), tie)
        self._varied, self._generation = varied, 0

    @classmethod
    def observes(cls, settings: Mapping[str, Any]) -> bool:
        return observes(settings.get("measures"))

    def hand_over(self, ranking: Sequence[Evaluation], representation: ToolRepresentation, folder: Path) -> None:
        """Write the best of each cell, and a few more that a user may want."""
        archive = Archive(self._archive.measures, self.tie)
        archive.add(ranking)
        save_archive(archive, ranking, representation, folder)

    def ask(self) -> Iterator[Candidate]:
        """Yield the model's candidates, then the varied ones."""
        rng = np.random.default_rng([getattr(self.designer, "seed", 0), self._generation])
        ranking = best_first(self._archive.best.values(), self.tie)
        yield from self.designer.design(self._generation, self._elites(ranking, rng))
        if self._varied:
            yield from self._variations(ranking, cast(Varies, self.designer), rng)

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self._generation += 1
        self._archive.add(evaluations)

    def _elites(self, ranking: Sequence[Evaluation], rng: np.random.Generator) -> list[Evaluation]:
        tools = best_tools(e for e in ranking if e.reward > self.budget.reward_save)
        count = min(len(tools), self.budget.k_top) - 1
        if count < 1:
            return tools[:1]
        others = rng.choice(len(tools) - 1, count, replace=False, p=_chances(len(tools) - 1))
        return [tools[0], *(tools[1 + i] for i in sorted(others))]

    def _variations(
        self, ranking: Sequence[Evaluation], designer: Varies, rng: np.random.Generator
    ) -> Iterator[Candidate]:
        """Vary members of the archive, better ones more often; what breaks a rule is drawn again."""
        members = [e.candidate for e in ranking if e.reward > 0 and len(designer.parameters(e.candidate))]
        for number in range(self._varied if members else 0):
            for _ in range(TRIES):
                parent = int(rng.choice(len(members), p=_chances(len(members))))
                values = _drawn(parent, members, designer, rng)
                key = (self._generation, self.budget.n_agent, number, 0)  # as of one more agent
                candidate = designer.vary(members[parent], values, key)
                if candidate.problem is None:
                    break
            yield candidate


def _chances(count: int) -> Array:
    """The probabilities (``count``,) of ranks: they fall linearly."""
    weights = np.arange(count, 0, -1.0)
    chances: Array = weights / weights.sum()
    return chances


def _drawn(parent: int, members: Sequence[Candidate], designer: Varies, rng: np.random.Generator) -> Array:
    """Draw numbers (N,) about those of a parent, and along the way to a random member that differs in numbers alone."""
    numbers = designer.parameters(members[parent])
    values = numbers.values + ISO * numbers.steps * rng.standard_normal(len(numbers))
    ways = (designer.toward(members[parent], members[i]) for i in rng.permutation(len(members)) if i != parent)
    if (way := next((way for way in ways if way is not None), None)) is not None:
        values += LINE * rng.standard_normal() * (way - numbers.values)
    return np.clip(values, numbers.lower, numbers.upper)
