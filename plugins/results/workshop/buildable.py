"""Judge candidates by another fitness, and give nothing for what can't be made, breaks, or comes too near."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from core.config.compose import listed, part
from core.design import Candidate, DesignError, Tool
from core.designs.planning import resolve
from core.designs.statics import mass_limit, moment_limit
from core.errors import UsageError, check_positive
from core.interfaces import Condition, Fitness, Material, Robot, Score, Trial
from core.plugins import FITNESS
from core.robot.kinematics import arm_of
from core.robot.trajectory import plan_task_motion
from core.solids.self_collision import DEEP_M
from core.values.materials import PAPER
from plugins.results.workshop.clearance import clearance
from plugins.results.workshop.motion import RECORD_HZ, Unplayable, play, sample
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.strength import measured
from plugins.results.workshop.texts import filled
from plugins.results.workshop.tool import make_tool
from plugins.results.workshop.verdicts import (
    BENT,
    SAFETY,
    carried,
    printable,
    strong,
    tolerance,
)

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
        plate_mm: the printer's build volume (x, y, z).
        min_wall_mm: the thinnest wall that it prints.
        safety: the least safety factor.
        margin_m: the least distance of the arm from itself and from what is fixed, metres.

    Raises:
        UserError: a setting or the other fitness can't be used.
    """

    def __init__(
        self,
        condition: Condition,
        of: str | dict[str, Any] = "nominal",
        material: Material = PAPER,
        plate_mm: list[float] = [250.0, 210.0, 220.0],  # noqa: B006 - read as a configuration's default
        min_wall_mm: float = 0.8,
        safety: float = SAFETY,
        margin_m: float = 0.005,
    ) -> None:
        (node,) = listed("fitness", "fitness", [of]).values()
        if node.name == NAME:
            raise UsageError(
                "fitness.of: buildable can't judge for itself; name another fitness"
            )
        check_positive("fitness.", safety=safety)
        if not 0 <= margin_m <= 0.2:
            raise UsageError(
                f"fitness.margin_m must be between 0 and 0.2 m, got {margin_m}"
            )
        printer = Printer(list(plate_mm), min_wall_mm)
        self._inner = part(FITNESS, node).create(condition=condition)
        self._condition = condition
        self._material = material
        self._examination = Examination(
            material, tuple(printer.plate_mm), min_wall_mm, safety, margin_m
        )

    def instructions(self) -> str:
        task = self._condition.task.shared()
        material = self._material
        rules = filled(
            "buildable.md.j2",
            printer=Printer(
                list(self._examination.plate_mm), self._examination.min_wall_mm
            ),
            material=material,
            safety=self._examination.safety,
            most_kg=mass_limit(task.robot, material)[0],
            most_nm=moment_limit(task.robot),
            bend_mm=1000 * BENT * tolerance(task),
            margin_mm=1000 * self._examination.margin_m,
        )
        return f"{self._inner.instructions() or 'What counts is the reward of one rollout.'}\n\n{rules}".strip()

    def conditions(self) -> list[Condition]:
        first, *others = self._inner.conditions()
        builder = replace(self._examination, plays=False)
        return [
            replace(first, examiner=self._examination),
            *(replace(condition, examiner=builder) for condition in others),
        ]

    def finals(self) -> Iterator[Sequence[Condition]]:
        return self._inner.finals()

    def unseen(self) -> Sequence[Condition]:
        return self._inner.unseen()

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        """Take the inner score, unless the first trial, which was examined, speaks against the design."""
        score = self._inner.score(candidate, trials)
        examined = trials[0].figures
        figures = {
            name: number for name, number in examined.items() if name != _EXPORTED
        }
        score = replace(score, figures={**score.figures, **figures})
        problems = [line for line in trials[0].warnings if line.startswith(_PROBLEM)]
        if score.reward <= 0 or not problems:
            exported = examined.get(_EXPORTED, score.reward)
            return (
                score
                if len(trials) > 1
                else replace(score, reward=min(score.reward, exported))
            )
        reason = (
            f"{problems[0]}, so that its reward of {score.reward:.2f} does not count"
        )
        return replace(score, reward=0.0, reason=reason)


_PROBLEM = "not buildable: "
_EXPORTED = "exported"  # the reward of the exported motion


@dataclass(frozen=True)
class Examination:
    """Looks at designs as those who make and run them do; see `core.trial.Examiner`.

    Attributes:
        material: of the tools.
        plate_mm: the printer's build volume (x, y, z).
        min_wall_mm: the thinnest wall that it prints.
        safety: the least safety factor.
        margin_m: the least distance of the arm from itself and from what is fixed, metres.
        plays: play the motion once more as it is exported, with forces. What speaks against the design then becomes
            warnings of the trial. The figures are the least safety factor, the least distance in metres, and the
            reward of the exported motion.
    """

    material: Material
    plate_mm: tuple[float, ...]
    min_wall_mm: float
    safety: float
    margin_m: float
    plays: bool = True

    def refuse(self, condition: Condition, candidate: Candidate) -> str | None:
        """Say what speaks against making or carrying a tool, if anything does."""
        tool = candidate.tool
        if tool is None or not tool.components:
            return None
        return _problem(
            tool,
            condition.task.shared().robot,
            self.material,
            self.plate_mm,
            self.min_wall_mm,
        )

    def examine(
        self, condition: Condition, candidate: Candidate, trial: Trial
    ) -> Trial:
        tool = candidate.tool
        if (
            not self.plays
            or trial.status != "ok"
            or trial.reward <= 0
            or tool is None
            or not tool.components
        ):
            return trial
        try:
            figures, problems = self._play(condition, candidate.of(trial.task), tool)
        except (Unplayable, DesignError) as error:
            figures = {_EXPORTED: 0.0}
            problems = [str(error)]
        warnings = (*trial.warnings, *(f"{_PROBLEM}{problem}" for problem in problems))
        return replace(trial, figures=figures, warnings=warnings)

    def _play(
        self, condition: Condition, candidate: Candidate, tool: Tool
    ) -> tuple[dict[str, float], list[str]]:
        """Play the motion as it is exported; return figures, and what speaks against the design."""
        task = condition.task.shared()
        simulator = condition.sim.shared()
        seed = condition.layout
        settings = condition.settings
        scene = condition.scene()
        robot = task.robot
        waypoints = resolve(candidate.plan, task, seed, settings, scene)
        planned = plan_task_motion(waypoints, task, settings)
        motion = sample(planned.trajectory, arm_of(robot), RECORD_HZ)
        replay = play(task, simulator, tool, motion, scene, seed, settings)
        rows = measured(
            tool, robot, self.material, scene, motion, {condition.sim.name: replay}
        )
        problems = [
            str(verdict)
            for verdict in strong(self.material, rows, task, self.safety)
            if verdict.passed is False
        ]
        if waypoints.guards:
            problems.append("exported programs have no guards")

        near = clearance(scene, robot, tool, replay.recording)
        fixed = {"itself", *(body.name for body in scene.bodies if body.fixed)}
        least = {
            row.to: row.metres for row in near if row.what == "arm" and row.to in fixed
        }
        # Hulls of links are this deep in each other where nothing is wrong.
        to_spare = {
            name: metres - self.margin_m + (DEEP_M if name == "itself" else 0.0)
            for name, metres in least.items()
        }
        closest = min(to_spare, key=lambda name: to_spare[name])
        if to_spare[closest] < 0:
            problems.append(
                f"clearance: the arm comes as near as {1000 * least[closest]:.0f} mm to {closest}; at least "
                f"{1000 * self.margin_m:g} mm are asked for: move or turn waypoints, or lengthen the tool"
            )
        figures = {_EXPORTED: replay.reward, "clearance_m": round(least[closest], 4)}
        safety = min(
            (row.safety for row in rows if row.safety is not None), default=math.inf
        )
        if safety < math.inf:
            figures["safety_factor"] = round(safety, 3)
        return figures, problems


@lru_cache(maxsize=16)
def _problem(
    tool: Tool,
    robot: Robot,
    material: Material,
    plate_mm: tuple[float, ...],
    min_wall_mm: float,
) -> str | None:
    verdicts = carried(tool, robot, material)
    if all(verdict.passed for verdict in verdicts):  # as an export makes and checks it
        made = make_tool(
            tool, robot, material, Printer(list(plate_mm), min_wall_mm), Fit()
        )
        verdicts = [*printable(made.parts), *printable((), made.checks)]
    for verdict in verdicts:
        if (
            verdict.passed is False and verdict.name != "weight"
        ):  # that is the material's
            return f"{_PROBLEM}{verdict}"
    return None
