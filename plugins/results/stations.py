"""Try designs on several arms and in several engines, in the scene as it is and perturbed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from omegaconf import DictConfig

from core.config.compose import part, read_parts, task_part, tool_part
from core.design import Candidate
from core.errors import UserError
from core.interfaces import Fitness, Robot, RolloutSettings, Simulator, Task
from core.plugins import EXECUTOR, FITNESS, ROBOT, PluginPart, installed
from core.robot.kinematics import arm_of
from core.search.trials import Trials
from core.support.progress import busy
from core.trial import Condition, Evaluation, Trial, summarise_rewards
from plugins.results.chosen import chosen_evaluations


@dataclass(frozen=True, eq=False)
class Bench:
    """Where designs are tried, beside the robot.

    Attributes:
        task: the task.
        sims: the engines, by the names under which they are shown.
        robust: perturbs the scene, which is tried as it is, too, and scores what came of it.
        layout: the seed of the layout.
        settings: how plans are executed.
    """

    task: PluginPart[Task]
    sims: Mapping[str, PluginPart[Simulator]]
    robust: Fitness
    layout: int
    settings: RolloutSettings

    def conditions(self, robot: PluginPart[Robot]) -> list[Condition]:
        """Return the conditions of a robot's trials."""
        task = replace(self.task, robot=robot)
        changes = [condition.change for condition in self.robust.conditions()]
        return [
            Condition(task, sim, self.layout, self.settings, change, engine)
            for engine, sim in self.sims.items()
            for change in (None, *changes)
        ]


def make_robust(cfg: DictConfig, condition: Condition) -> Fitness:
    """Make the fitness that perturbs the scene of a condition, and scores what came of it.

    Raises:
        UserError: a seed or a range can't be used.
    """
    settings = {
        "sims": [condition.sim.name],
        "seeds": list(cfg.seeds),
        "perturbation": dict(cfg.perturbation),
    }
    return installed().create(FITNESS, "robust", settings, condition=condition)


def make_robots(
    entries: Sequence[str | Mapping[str, Any]], chosen: PluginPart[Robot]
) -> dict[str, PluginPart[Robot]]:
    """Make the robots, by the names under which they are shown: entries as those of `engines`; none: ``chosen`` alone.

    Raises:
        UserError: a robot does not exist or can't be made, or is repeated.
    """
    robots = read_parts(ROBOT, entries or [chosen.name], chosen)
    for robot in robots.values():
        robot.create()  # so that a fault is reported once

    return robots


def read_on_each(
    cfg: DictConfig, task: PluginPart[Task], robots: Mapping[str, PluginPart[Robot]]
) -> dict[str, list[Candidate]]:
    """Read the designs for each robot, by its rules and with the names of mounts that ``cfg.robot`` has.

    On a robot that can't even start the task, each design has that as its problem.

    Raises:
        UserError: no robot can start it, or the designs can't be read; one line.
    """
    aliases = task_part(cfg).create().robot.aliases
    read: dict[str, list[Candidate]] = {}
    problems: dict[str, str] = {}
    for name, robot in robots.items():
        try:
            read[name] = _read_on(cfg, replace(task, robot=robot), aliases)
        except UserError as error:
            problems[name] = str(error)

    if not read:
        raise UserError("; ".join(dict.fromkeys(problems.values())))

    some = next(iter(read.values()))
    for name, problem in problems.items():
        read[name] = [replace(candidate, problem=problem) for candidate in some]

    return {name: read[name] for name in robots}


def _read_on(
    cfg: DictConfig, task: PluginPart[Task], aliases: tuple[tuple[str, str], ...]
) -> list[Candidate]:
    """Read the designs for the robot of a task; ``aliases`` are names of mounts.

    Raises:
        UserError: the robot can't start the task, or the designs can't be read.
    """
    arm = task.create().robot
    if not {*aliases} <= {*arm.aliases}:
        arm = replace(arm, aliases=(*arm.aliases, *aliases))

    stage = task.create(robot=arm)
    arm_of(arm).home_for(stage.home)  # an arm that can't start is reported once
    chosen = chosen_evaluations(cfg, tool_part(cfg).create(robot=arm), stage)
    return [evaluation.candidate.of(stage.name) for evaluation in chosen]


def try_on_each(
    cfg: DictConfig,
    bench: Bench,
    robots: Mapping[str, PluginPart[Robot]],
    candidates: Mapping[str, Sequence[Candidate]],
) -> list[dict[str, Any]]:
    """Try each robot's candidates, and return an entry for each, in the order of the designs and the robots."""
    designs: list[dict[str, Any]] = []
    with part(EXECUTOR, cfg.executor).create() as executor, busy("trials") as step:
        for name, robot in robots.items():
            conditions = bench.conditions(robot)
            tools = candidates[name]
            trials = Trials(executor)  # a robot's own: trials don't say which it is
            for count, (candidate, tried) in enumerate(
                trials.try_in(conditions, tools)
            ):
                step.what = f"trials on {name}  {count + 1}/{len(tools)}"
                all_tried = tried or _reject(candidate, conditions)
                designs.append(record(candidate, name, all_tried, bench.robust))

    some = next(iter(candidates.values()))
    order = {candidate.id: number for number, candidate in enumerate(some)}
    return sorted(designs, key=lambda design: order[design["design"]])


def _reject(candidate: Candidate, conditions: Sequence[Condition]) -> tuple[Trial, ...]:
    """Make the trials of a candidate that breaks a rule in any condition."""
    reason = candidate.problem or ""
    return tuple(
        Trial(condition.where, candidate.id, "rejected", reason=reason)
        for condition in conditions
    )


def record(
    candidate: Candidate, robot: str, tried: Sequence[Trial], fitness: Fitness
) -> dict[str, Any]:
    """Make the entry of one design on one robot in the output file."""
    nominal = {
        trial.engine: trial.reward for trial in tried if trial.where.change is None
    }
    changed = tuple(trial for trial in tried if trial.where.change is not None)
    robust = Evaluation(candidate, changed, fitness.score(candidate, changed))
    missed_m = changed[robust.score.shown].figure("ik_error_m")
    return {
        "design": candidate.id,
        "robot": robot,
        "name": candidate.design_name,
        "robust": robust.reward,
        "status": robust.status,
        "reason": robust.reason,
        "ik_error_m": None if math.isnan(missed_m) else missed_m,
        "engines": {
            engine: {"nominal": nominal[engine], **summarise_rewards(rewards)}
            for engine, rewards in robust.by_engine.items()
        },
        "warnings": list(robust.warnings),
    }
