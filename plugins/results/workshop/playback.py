"""Make what is exported of a task: sample the motion of a design, and play it in each engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.config.compose import engines, node
from core.errors import UserError
from core.interfaces import (
    Condition,
    Evaluation,
    RolloutSettings,
    Task,
)
from core.plugins import PluginPart
from core.simulation.play import play
from core.support.templates import macros
from core.support.text import number
from plugins.results.workshop.carrying import dump_settings
from plugins.results.workshop.export import Export
from plugins.results.workshop.printing import Check
from plugins.results.workshop.replay import PlayedMotion
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.stage import Stage
from plugins.results.workshop.strength import measured
from plugins.results.workshop.tolerance import check_tolerance
from plugins.results.workshop.tool import PrintedTool
from plugins.results.workshop.ways import close_ways, sample_moves

SAME_REWARD = 0.02
LEAST_REWARD = 1e-3
SAME_TIME = 1e-3  # of a motion's, that counts as none

TRUST = "search in each of these engines with fitness=robust, or name in sims those that you trust"
NOTHING = "vlmgineer evaluate says why; export a design that earns something, or name other engines in sims"
ROOM = (
    "move components away from the mount, and leave more room where the motion is tight"
)


def make_export(
    cfg: DictConfig, task_part: PluginPart[Task], chosen: Evaluation, tool: PrintedTool
) -> Export:
    """Sample the motion of a task, and play it in each engine, without and with what fixes the tool to the arm.

    Args:
        cfg: the settings of the command.
        task_part: makes the task.
        chosen: the design, and what it earned in the search; of several tasks those of all.
        tool: as parts.

    Raises:
        UserError: the design or a setting can't be used, or the motion can't be played.
    """
    task = task_part.shared()
    best = chosen.in_task(task.name)
    candidate = best.candidate
    if candidate.tool is None or candidate.problem is not None:
        raise UserError(f"the design can't be used in {task.name}: {candidate.problem}")

    settings = node(cfg.rollout, RolloutSettings)
    sims: Any = OmegaConf.to_container(cfg.sims)
    conditions = {
        name: Condition(task_part, sim, cfg.seed, settings, engine=name)
        for name, sim in engines(sims).items()
    }
    scene = task.scene(cfg.seed).furnished(candidate.tool)
    stage = Stage(conditions, scene)
    robot = task.robot.life_size
    played = stage.play_design(candidate, tool.tool, cfg.rate_hz, cfg.speed)
    replays = played.replays
    instants = [replay.contact_s for replay in replays.values()]
    contact_s = min((s for s in instants if s is not None), default=None)
    own_scene = stage.to_life.scene(scene)
    strengths = measured(tool, robot, own_scene, played.motion, replays)
    export = Export(
        task=task,
        robot=robot,
        scene=own_scene,
        candidate=candidate,
        planned=played.planned,
        moves=sample_moves(cfg, robot, played, contact_s),
        replays=replays,
        contact_s=contact_s,
        printed=tool,
        strengths=strengths,
        dry_run=played.dry_run,
        settings=dump_settings(cfg, task_part),
    )
    part = "" if candidate.plan is chosen.candidate.plan else task.name
    checks = _check_motion(export, stage, best, part)
    if tool.parts:
        mounted = stage.rewards(tool.printed, export.playable)
        check = compare_rewards("with its mount", mounted, list_rewards(replays))
        checks.append(check._replace(name="mounted", mend=ROOM, part=part))
        off_m = node(cfg.fit, Fit).tolerance_mm / 1000
        export = replace(export, mounted=mounted)
        checks += check_tolerance(export, stage, off_m)

    return close_ways(replace(export, checks=checks))


def _check_motion(
    export: Export, stage: Stage, best: Evaluation, part: str
) -> list[Check]:
    """Check that a motion earns what it earned in the search, and that a plan that feels or looks comes to its end.

    Args:
        export: the motion, and what it earned.
        stage: where.
        best: the design, and what it earned in the search.
        part: the name of the task, if it is one of several.
    """
    searched = {name: _earned(where, best) for name, where in stage.conditions.items()}
    check = compare_rewards("as exported", list_rewards(export.replays), searched)
    check = check._replace(name="motion", mend=TRUST, part=part)
    if export.dry_run is not None:
        return [check, _check_reactions(export.replays)]
    if check.passed is not False:
        return [check]

    nothing = [name for name, reward in searched.items() if reward < LEAST_REWARD]
    if nothing:
        lost = f"before its export it earned nothing in {', '.join(nothing)}"
        return [check._replace(found=f"{check.found}; {lost}", mend=NOTHING)]

    lost = find_loss(stage, export, searched)
    return [check._replace(found=f"{check.found}; {lost}")]


def list_rewards(replays: Mapping[str, PlayedMotion]) -> dict[str, float]:
    """Return what was earned in each engine."""
    return {name: replay.reward for name, replay in replays.items()}


def find_loss(stage: Stage, export: Export, searched: Mapping[str, float]) -> str:
    """Say which step loses what a motion earned in the search: the engine, its time, or its smoothed path."""
    same = stage.rewards(export.printed.tool, export.planned.trajectory)
    lost = [name for name in same if same[name] < searched[name] - SAME_REWARD]
    if lost:
        rows = ", ".join(number(same[name], 3) for name in lost)
        return f"played as it was searched it earns {rows} too: the run was played with other settings"

    if export.motion.slower > 1 + SAME_TIME:
        return f"its time loses it: an arm's limits make it {export.motion.slower:.3f} times as long"
    return "its path loses it: corners are rounded for a real arm, by up to 0.6 mrad; move more slowly where it touches"


def _check_reactions(replays: Mapping[str, PlayedMotion]) -> Check:
    """Say what the dry run of a plan felt and saw; it fails where the plan did not come to its end."""
    found = macros("plugins.results.workshop", "words").reacted(replays)
    reactions = [replay.reactions for replay in replays.values()]
    ended = all(one is None or not one.problem for one in reactions)
    return Check("dry run", ended, found)


def _earned(condition: Condition, best: Evaluation) -> float:
    """Return what the search says that a design earns: in this engine, and in a run that tried it once."""
    (trial,) = play(condition, [best.candidate])
    if trial.status != "ok":
        raise UserError(
            f"the design is {trial.status} in {condition.engine}: {trial.reason}"
        )

    if best.combined:
        return trial.reward

    return max(trial.reward, best.reward)


def compare_rewards(
    how: str, earned: Mapping[str, float], asked: Mapping[str, float]
) -> Check:
    """Check that a motion earns in each engine what is asked of it, and anything at all.

    Args:
        how: it was played, in words.
        earned: rewards by engine.
        asked: the rewards that are asked for, by engine.
    """
    passed = all(
        reward >= max(asked[engine] - SAME_REWARD, LEAST_REWARD)
        for engine, reward in earned.items()
    )
    found = macros("plugins.results.workshop", "words").earns(how, earned, asked)
    return Check("rewards", passed, found)
