"""Judge candidates by another fitness, and give nothing for what can't be made, breaks, or comes too near."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from core.config.compose import listed, part
from core.design import Candidate, DesignError, Evaluation, Tool
from core.designs.planning import resolve
from core.designs.statics import mass_limit, moment_limit
from core.errors import UsageError, check_positive
from core.interfaces import Evaluate, Fitness, Material
from core.plugins import FITNESS
from core.robot.kinematics import arm_of
from core.robot.tempo import plan_task_motion
from core.simulation.rollout import Evaluator
from core.solids.self_collision import DEEP_M
from core.values.materials import PAPER
from plugins.results.workshop.clearance import clearance
from plugins.results.workshop.motion import RECORD_HZ, Unplayable, play, sample
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.strength import measured
from plugins.results.workshop.texts import filled
from plugins.results.workshop.tool import make_tool
from plugins.results.workshop.verdicts import BENT, SAFETY, carried, printable, strong, tolerance

NAME = "buildable"


class Buildable(Fitness):
    """The reward of the fitness ``of``, or 0 where a design breaks a rule of those who make and run it.

    Of one rollout the reward is at most that of the exported motion.

    What a printer and the arm can't bear is rejected before it costs a rollout. What earns something is played once
    more in the run's engine, with forces: then it must not break, and the arm must keep clear of itself and of all
    that is fixed.

    Args:
        evaluator: the task, the engine of that rollout, and how plans are executed.
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
        evaluator: Evaluator,
        of: str | dict[str, Any] = "nominal",
        material: Material = PAPER,
        plate_mm: list[float] = [250.0, 210.0, 220.0],  # noqa: B006 - read as a configuration's default
        min_wall_mm: float = 0.8,
        safety: float = SAFETY,
        margin_m: float = 0.005,
    ) -> None:
        (node,) = listed("fitness", "fitness", [of]).values()
        if node.name == NAME:
            raise UsageError("fitness.of: buildable can't judge for itself; name another fitness")
        check_positive("fitness.", safety=safety)
        if not 0 <= margin_m <= 0.2:
            raise UsageError(f"fitness.margin_m must be between 0 and 0.2 m, got {margin_m}")
        self._printer = Printer(list(plate_mm), min_wall_mm)
        self._inner = part(FITNESS, node).create(evaluator=evaluator)
        self._evaluator, self._material = evaluator, material
        self._safety, self._margin = safety, margin_m

    def instructions(self) -> str:
        task, material = self._evaluator.task.create(), self._material
        rules = filled(
            "buildable.md.j2",
            printer=self._printer,
            material=material,
            safety=self._safety,
            most_kg=mass_limit(task.robot, material)[0],
            most_nm=moment_limit(task.robot),
            bend_mm=1000 * BENT * tolerance(task),
            margin_mm=1000 * self._margin,
        )
        return f"{self._inner.instructions() or 'What counts is the reward of one rollout.'}\n\n{rules}".strip()

    @property
    def batch(self) -> int:
        return self._inner.batch

    def prepare(self) -> None:
        self._inner.prepare()
        self._evaluator.prepare()

    def final(self) -> Mapping[str, Sequence[Evaluate]]:
        return self._inner.final()

    def unseen(self) -> Mapping[str, Sequence[Evaluate]]:
        return self._inner.unseen()

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        tools = {id(candidate.tool): candidate.tool for candidate in candidates if candidate.problem is None}
        problems = {number: self._problem(tool) for number, tool in tools.items()}
        asked = [replace(c, problem=c.problem or problems[id(c.tool)]) for c in candidates]
        return [self._judged(evaluation) for evaluation in self._inner(asked)]

    def _problem(self, tool: Tool | None) -> str | None:
        """Say what speaks against making or carrying a tool, if anything does."""
        if tool is None or not tool.components:
            return None
        robot = self._evaluator.made()[0].robot
        verdicts = carried(tool, robot, self._material)
        if all(verdict.passed for verdict in verdicts):  # as an export makes and checks it
            made = make_tool(tool, robot, self._material, self._printer, Fit())
            verdicts = [*printable(made.parts), *printable((), made.checks)]
        failing = (of for of in verdicts if of.passed is False and of.name != "weight")  # that is the material's
        return next((f"not buildable: {verdict}" for verdict in failing), None)

    def _judged(self, evaluation: Evaluation) -> Evaluation:
        """Play what earned something once more, with forces."""
        candidate, tool = evaluation.candidate, evaluation.candidate.tool
        if evaluation.status != "ok" or evaluation.reward <= 0 or tool is None or not tool.components:
            return evaluation
        try:
            exported, found, problems = self._played(candidate, tool)
        except (Unplayable, DesignError) as error:
            exported, found, problems = 0.0, {}, [str(error)]
        figures = {**evaluation.figures, **found}
        if not problems:
            reward = evaluation.reward if evaluation.combined else min(evaluation.reward, exported)
            return replace(evaluation, reward=reward, figures=figures)
        reason = f"not buildable: {problems[0]}, so that its reward of {evaluation.reward:.2f} does not count"
        warnings = (*evaluation.warnings, *(f"not buildable: {problem}" for problem in problems))
        return replace(evaluation, reward=0.0, reason=reason, warnings=warnings, figures=figures)

    def _played(self, candidate: Candidate, tool: Tool) -> tuple[float, dict[str, float], list[str]]:
        """Play the motion as it is exported; return its reward, figures, and what speaks against the design."""
        (task, simulator), seed, settings = self._evaluator.made(), self._evaluator.seed, self._evaluator.settings
        scene, robot = task.scene(seed), task.robot
        waypoints = resolve(candidate.plan, task, seed, settings, scene)
        planned = plan_task_motion(waypoints, task, settings)
        motion = sample(planned.trajectory, arm_of(robot), RECORD_HZ)
        replay = play(task, simulator, tool, motion, scene, seed, settings)
        rows = measured(tool, robot, self._material, scene, motion, {self._evaluator.sim.name: replay})
        problems = [str(of) for of in strong(self._material, rows, task, self._safety) if of.passed is False]
        problems += ["exported programs have no guards"] if waypoints.guards else []
        near = clearance(scene, robot, tool, replay.recording)
        fixed = {"itself", *(body.name for body in scene.bodies if body.fixed)}
        least = {row.to: row.metres for row in near if row.what == "arm" and row.to in fixed}
        # Hulls of links are this deep in each other where nothing is wrong.
        to_spare = {name: of - self._margin + (DEEP_M if name == "itself" else 0.0) for name, of in least.items()}
        closest = min(to_spare, key=lambda name: to_spare[name])
        if to_spare[closest] < 0:
            problems.append(
                f"clearance: the arm comes as near as {1000 * least[closest]:.0f} mm to {closest}; at least "
                f"{1000 * self._margin:g} mm are asked for: move or turn waypoints, or lengthen the tool"
            )
        safety = min((row.safety for row in rows if row.safety is not None), default=math.inf)
        figures: dict[str, float] = {"safety_factor": round(safety, 3)} if safety < math.inf else {}
        return replay.reward, figures | {"clearance_m": round(least[closest], 4)}, problems
