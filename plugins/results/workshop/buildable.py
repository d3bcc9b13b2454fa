"""Judge candidates by another fitness, and give nothing for what can't be made, breaks, or comes too near."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any

from core.config.compose import read_parts
from core.design import Candidate
from core.designs.statics import mass_limit, moment_limit
from core.errors import UsageError, check_positive
from core.hooks import PartsOf
from core.interfaces import Condition, Fitness, Material, Score, Trial
from core.plugins import FITNESS
from core.support.text import number
from core.values.materials import PAPER
from core.values.printers import MK4, Printer
from plugins.results.workshop.examination import EXPORTED, MARGIN_M, Examination
from plugins.results.workshop.texts import filled
from plugins.results.workshop.verdicts import BENT, SAFETY, tolerance

NAME = "buildable"


class Buildable(Fitness):
    """The reward of the fitness ``of``, or 0 where a design breaks a rule of those who make and run it.

    Of one rollout the reward is at most that of the exported motion.

    What a printer and the arm can't bear is rejected before it costs a rollout. What earns something is played once
    more in the run's engine, with forces: then it must not break, and the arm must keep clear of itself and of all
    that is fixed.

    Args:
        condition: the task, the engine of that rollout, and how plans are executed.
        of: the fitness that judges what is buildable: a name, or a mapping of a ``name`` and settings.
        material: of the tools; ``paper`` has no strength, which is then not judged.
        printer: whose plate and thinnest wall count.
        safety: the least safety factor.
        margin_m: the least distance of the arm from itself and from what is fixed, metres.

    Raises:
        UserError: a setting or the other fitness can't be used.
    """

    def __init__(
        self,
        condition: Condition,
        of: Annotated[str | dict[str, Any], PartsOf("fitness")] = "nominal",
        material: Material = PAPER,
        printer: Printer = MK4,
        safety: float = SAFETY,
        margin_m: float = MARGIN_M,
    ) -> None:
        (inner,) = read_parts(FITNESS, [of]).values()
        if inner.name == NAME:
            raise UsageError(
                "fitness.of: buildable can't judge for itself; name another fitness"
            )

        check_positive("fitness.", safety=safety)

        if not 0 <= margin_m <= 0.2:
            raise UsageError(
                f"fitness.margin_m must be between 0 and 0.2 m, got {margin_m}"
            )

        self._inner = inner.create(condition=condition)
        self.finals_check = self._inner.finals_check
        self._condition = condition
        self._examination = Examination(material, printer, safety, margin_m)

    def instructions(self) -> str:
        """Return what the inner fitness says, and the rules."""
        task = self._condition.task.shared()
        examination = self._examination
        material = examination.material
        # A design is written in the size in which the arm is simulated.
        large = task.robot.enlarged
        plate_mm = tuple(large * side for side in examination.printer.plate_mm)
        wall_mm = large * examination.printer.min_wall_mm
        rules = filled(
            "buildable.md.j2",
            printer=Printer(plate_mm, wall_mm),
            material=material,
            safety=examination.safety,
            most_kg=mass_limit(task.robot, material)[0],
            most_nm=moment_limit(task.robot),
            bend_mm=1000 * BENT * large * tolerance(task),
            margin_mm=1000 * large * examination.margin_m,
        )
        inner = self._inner.instructions()
        if not inner:
            inner = "What counts is the reward of one rollout."

        return f"{inner}\n\n{rules}".strip()

    def conditions(self) -> list[Condition]:
        """Return those of the inner fitness; in the first one the exported motion is played, too."""
        first, *others = self._inner.conditions()
        builder = replace(self._examination, plays=False)

        return [
            replace(first, examiner=self._examination),
            *(replace(condition, examiner=builder) for condition in others),
        ]

    def finals(self) -> Iterator[Sequence[Condition]]:
        return self._inner.finals()

    def perturbed(self, conditions: Sequence[Condition]) -> Sequence[Condition]:
        return self._inner.perturbed(conditions)

    def unseen(self) -> Sequence[Condition]:
        return self._inner.unseen()

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        """Take the inner score, unless the first trial, which was examined, speaks against the design."""
        inner = self._inner.score(candidate, trials)
        figures = dict(trials[0].figures)
        exported = figures.pop(EXPORTED, inner.reward)
        score = replace(inner, figures={**inner.figures, **figures})

        objections = trials[0].objections
        if objections and score.reward > 0:
            lost = f"its reward of {number(score.reward, 2)} does not count"
            return replace(score, reward=0.0, reason=f"{objections[0]}, so that {lost}")

        if len(trials) > 1:
            return score

        return replace(score, reward=min(score.reward, exported))
