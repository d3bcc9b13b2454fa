"""The graph of designs and the designs that they derive from."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import rerun as rr

from core.design import Evaluation

_COLUMN, _ROW = 190.0, 46.0  # of the picture: a generation's, and a rank's


@dataclass
class Lineage:
    """Designs by id, each with its place (generation, rank) and its reward, and edges from parent to child: the first
    ranks of each generation, and the designs that they derive from.
    """

    places: dict[str, tuple[int, int]] = field(default_factory=dict)
    rewards: dict[str, float] = field(default_factory=dict)
    edges: list[tuple[str, str]] = field(default_factory=list)

    def add(self, generation: int, ranked: Sequence[Evaluation]) -> None:
        """Add the best designs of a generation, the best first."""
        for evaluation in ranked:
            candidate = evaluation.candidate
            self._place(candidate.id, generation)
            self.rewards[candidate.id] = evaluation.reward
            for parent in candidate.parents:
                if parent not in self.places:  # it was not in the first ranks of its generation
                    self._place(parent, int(re.findall(r"\d+", parent)[0]))
                self.edges.append((parent, candidate.id))

    def _place(self, name: str, generation: int) -> None:
        self.places[name] = (generation, sum(g == generation for g, _ in self.places.values()))

    def graph(self) -> tuple[rr.GraphNodes, rr.GraphEdges]:
        rewards = [self.rewards.get(name) for name in self.places]
        nodes = rr.GraphNodes(
            node_ids=list(self.places),
            positions=[(_COLUMN * generation, _ROW * rank) for generation, rank in self.places.values()],
            labels=[name if r is None else f"{name}  {r:.2f}" for name, r in zip(self.places, rewards, strict=True)],
            colors=[_shade(r or 0.0) for r in rewards],
        )
        return nodes, rr.GraphEdges(self.edges, graph_type="directed")


def _shade(reward: float) -> tuple[int, int, int]:
    """From grey to green."""
    return (round(110 - 90 * reward), round(110 + 10 * reward), round(110 - 50 * reward))
