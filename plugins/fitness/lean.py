"""Judge candidates in several layouts, and those that hold by the effort that they save."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

from pydantic import NonNegativeInt, PositiveInt

from core.design import Candidate
from core.errors import UsageError
from core.hooks import PartsOf
from core.interfaces import Condition, Score, Trial
from core.support.templates import fill
from core.trial import Evaluation
from core.values.efforts import HOLDS, Effort
from plugins.fitness.layouts import Layouts


class Lean(Layouts):
    """The rewards over layouts, and of designs that hold the effort saved (`core.values.efforts.Effort.saved`).

    A design holds if a share of `HOLDS` of its trials is solved in each engine. Its score s becomes a reward of
    0.5 + 0.5 s / (1 + s), so that the reference earns 0.75, and no design 1. What does not hold earns half its mean.

    Args:
        condition: see `Layouts`, as for ``layouts``, ``sims``, ``unseen`` and ``unseen_sims``.
        references: of each task the effort of its reference: time of the motion, s; mass, kg; margin, or null.
    """

    def __init__(
        self,
        condition: Condition,
        references: dict[str, list[float | None]] = {},  # noqa: B006 - read as a configuration's default
        layouts: PositiveInt = 5,
        sims: Annotated[list[str | dict[str, Any]], PartsOf("sim")] = [],  # noqa: B006
        unseen: NonNegativeInt = 20,
        unseen_sims: Annotated[list[str | dict[str, Any]], PartsOf("sim")] = [],  # noqa: B006
    ) -> None:
        super().__init__(condition, layouts, "mean", sims, unseen, unseen_sims)
        self.races = False  # the effort counts too
        task = condition.task.shared().name
        form = f"[SECONDS, KILOGRAMS, MARGIN], as in +fitness.references.{task}=[8,0.2,0.5]"
        if task not in references:
            raise UsageError(f"fitness=lean has no reference for {task}; add {form}")

        try:
            self._reference = Effort(*references[task])  # type: ignore[arg-type]
        except (TypeError, ValueError) as error:
            raise UsageError(
                f"fitness.references.{task} must be {form}: {error}"
            ) from error

    def instructions(self) -> str:
        return fill(
            "plugins.fitness",
            "lean",
            layouts=super().instructions(),
            known=self._reference,
            holds=HOLDS,
        )

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        score = super().score(candidate, trials)
        tried = Evaluation(candidate, tuple(trials))
        effort = tried.effort
        if effort is None or not tried.holds:
            return replace(score, reward=score.reward / 2)

        saved = effort.saved(self._reference)
        figures = {
            "lean": round(saved, 4),
            "motion_s": round(effort.motion_s, 3),
            "mass_kg": round(effort.mass_kg, 4),
        }
        return replace(score, reward=0.5 + 0.5 * saved / (1 + saved), figures=figures)
