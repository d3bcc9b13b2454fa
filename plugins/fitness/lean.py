"""Judge candidates in several layouts, and those that hold by the effort that they save."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from core.design import Candidate, Evaluation
from core.errors import UsageError
from core.simulation.rollout import Evaluator
from core.support.templates import fill
from core.values.efforts import HOLDS, Effort
from plugins.fitness.layouts import Layouts


class Lean(Layouts):
    """The rewards over layouts, and of designs that hold the effort saved (`core.values.efforts.Effort.saved`).

    A design holds if its mean reward is at least `HOLDS` in each engine. Its score s becomes a reward of
    0.5 + 0.5 s / (1 + s), so that the reference earns 0.75, and no design 1. What does not hold earns half its mean.

    Args:
        evaluator: see `Layouts`, as for ``layouts``, ``sims``, ``final``, ``unseen`` and ``unseen_sims``.
        references: of each task the effort of its reference: time of the motion, s; mass, kg; margin, or null.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        references: dict[str, list[float | None]] = {},  # noqa: B006 - read as a configuration's default
        layouts: int = 5,
        sims: list[str | dict[str, Any]] = [],  # noqa: B006
        final: int = 8,
        unseen: int = 20,
        unseen_sims: list[str | dict[str, Any]] = [],  # noqa: B006
    ) -> None:
        super().__init__(evaluator, layouts, "mean", sims, final, unseen, unseen_sims)
        task = evaluator.task.create().name
        form = f"[SECONDS, KILOGRAMS, MARGIN], as in +fitness.references.{task}=[8,0.2,0.5]"
        if task not in references:
            raise UsageError(f"fitness=lean has no reference for {task}; add {form}")
        try:
            self._reference = Effort(*references[task])  # type: ignore[arg-type]
        except (TypeError, ValueError) as error:
            raise UsageError(f"fitness.references.{task} must be {form}: {error}") from error

    def instructions(self) -> str:
        return fill("plugins.fitness", "lean", layouts=super().instructions(), known=self._reference, holds=HOLDS)

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        return [self._weighed(evaluation) for evaluation in super().__call__(candidates)]

    def _weighed(self, evaluation: Evaluation) -> Evaluation:
        effort = evaluation.effort
        if effort is None or not evaluation.holds:
            return replace(evaluation, reward=evaluation.reward / 2)
        score = effort.saved(self._reference)
        figures = {"lean": round(score, 4), "motion_s": round(effort.motion_s, 3), "mass_kg": round(effort.mass_kg, 4)}
        return replace(evaluation, reward=0.5 + 0.5 * score / (1 + score), figures={**evaluation.figures, **figures})
