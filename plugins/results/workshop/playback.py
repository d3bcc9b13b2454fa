"""Make what is exported of a task: sample the motion of a design, and play it in each engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from omegaconf import DictConfig, OmegaConf

from core.config.compose import engines, node
from core.design import Candidate, Tool
from core.designs.planning import resolve
from core.errors import UserError
from core.geometry import Array
from core.interfaces import (
    Condition,
    Evaluation,
    Motion,
    RolloutSettings,
    Task,
    Waypoints,
)
from core.plugins import PluginPart
from core.robot.trajectory import plan_task_motion
from core.scene import Scene
from core.simulation.play import play
from core.support.text import count_words, number
from plugins.results.workshop.carrying import dump_settings
from plugins.results.workshop.dry_run import DryRun
from plugins.results.workshop.export import Export
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.parting import describe_parting
from plugins.results.workshop.printing import Check
from plugins.results.workshop.replay import PlayedMotion, play_in_all
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.strength import measured
from plugins.results.workshop.tolerance import check_tolerance
from plugins.results.workshop.tool import PrintedTool
from plugins.results.workshop.ways import close_ways, sample_before, sample_moves

SAME_REWARD = 0.02
LEAST_REWARD = 1e-3
SAME_TIME = 1e-3  # of a motion's, that counts as none
OFF_RAD = 1e-4  # by which a real arm's joints are off
OFF_TRIES = 3

TRUST = "search in each of these engines with fitness=robust, or name in sims those that you trust"
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
    settings = node(cfg.rollout, RolloutSettings)
    conditions = _list_conditions(cfg, task_part, settings)
    task = task_part.shared()
    scene = task.scene(cfg.seed)
    best = chosen.in_task(task.name)
    candidate = best.candidate
    if candidate.tool is None or candidate.problem is not None:
        raise UserError(f"the design can't be used in {task.name}: {candidate.problem}")

    scene = scene.furnished(candidate.tool)
    waypoints = resolve(candidate.plan, task, cfg.seed, settings, scene)
    dry_run = _make_dry_run(cfg, task, candidate, waypoints)
    planned, moves, replays = _play_moves(
        cfg, conditions, scene, candidate.tool, waypoints, dry_run
    )
    motion = moves["trajectory"]
    contact_s = _find_contact(replays)
    if contact_s is not None and dry_run is None:
        moves |= sample_before(cfg, task, planned, contact_s / motion.slower)

    part = "" if candidate.plan is chosen.candidate.plan else task.name
    rewards = _rewards(replays)
    searched = {name: _earned(where, best) for name, where in conditions.items()}
    check = compare_rewards("as exported", rewards, searched)
    check = check._replace(name="motion", mend=TRUST, part=part)
    checks = [check]
    if dry_run is not None:
        checks.append(_check_reactions(conditions, candidate, scene, replays))
    elif check.passed is False:
        lost = find_loss(conditions, scene, candidate.tool, planned, searched, motion)
        checks = [check._replace(found=f"{check.found}; {lost}")]

    mounted: dict[str, float] = {}
    held = candidate.tool
    strengths = measured(held, task.robot, tool.material, scene, motion, replays)
    if tool.parts:
        playable = dry_run or motion
        mounted = _rewards(play_in_all(conditions, scene, tool.printed, playable))
        check = compare_rewards("with its mount", mounted, rewards)
        checks.append(check._replace(name="mounted", mend=ROOM, part=part))

    export = Export(
        task=task,
        scene=scene,
        candidate=candidate,
        planned=planned,
        moves=moves,
        replays=replays,
        contact_s=contact_s,
        printed=tool,
        mounted=mounted,
        strengths=strengths,
        checks=checks,
        dry_run=dry_run,
        settings=dump_settings(cfg, task_part),
    )
    if tool.parts:
        where = next(iter(conditions.values()))
        off_m = node(cfg.fit, Fit).tolerance_mm / 1000
        export.checks.extend(check_tolerance(export, where, off_m))

    return close_ways(export)


def _rewards(replays: Mapping[str, PlayedMotion]) -> dict[str, float]:
    return {name: replay.reward for name, replay in replays.items()}


def _find_contact(replays: Mapping[str, PlayedMotion]) -> float | None:
    """Find when the robot first touches a body in any engine, seconds; None: never."""
    instants = [replay.contact_s for replay in replays.values()]
    return min((s for s in instants if s is not None), default=None)


def find_loss(
    conditions: Mapping[str, Condition],
    scene: Scene,
    tool: Tool,
    planned: Motion,
    searched: Mapping[str, float],
    motion: Sampled,
) -> str:
    """Say which step loses what a motion earned in the search: the engine, luck, its time, or its smoothed path.

    The motion is played as it was searched; then with all joints off by as little as a real arm is.
    """

    def play_off(off: Array) -> dict[str, float]:
        course = planned.trajectory
        moved = replace(course, arm=course.arm + off)
        return _rewards(play_in_all(conditions, scene, tool, moved))

    joints = planned.trajectory.arm.shape[1]
    same = play_off(np.zeros(joints))
    lost = [name for name in same if same[name] < searched[name] - SAME_REWARD]
    if lost:
        rows = _list_rewards([same[name] for name in lost])
        return f"played as it was searched it earns {rows} too: the run was played with other settings"

    rng = np.random.default_rng(0)
    signs = rng.choice((-1.0, 1.0), (OFF_TRIES, joints))
    tried = [min(play_off(OFF_RAD * sign).values()) for sign in signs]
    if min(tried) < min(searched.values()) - SAME_REWARD:
        return (
            f"the export does not lose it, it was luck: played as it was searched, with joints off by "
            f"{1000 * OFF_RAD:g} mrad, it earns {_list_rewards(tried)}"
        )
    if motion.slower > 1 + SAME_TIME:
        return f"its time loses it: an arm's limits make it {motion.slower:.3f} times as long"

    return "its path loses it: corners are rounded for a real arm; move more slowly where it touches"


def _list_rewards(rewards: Sequence[float]) -> str:
    return ", ".join(number(reward, 3) for reward in rewards)


def _list_conditions(
    cfg: DictConfig, task_part: PluginPart[Task], settings: RolloutSettings
) -> dict[str, Condition]:
    """List where the motion is played: the task in each engine."""
    sims = engines(OmegaConf.to_container(cfg.sims))  # type: ignore[arg-type]
    return {
        name: Condition(task_part, sim, cfg.seed, settings, engine=name)
        for name, sim in sims.items()
    }


def _make_dry_run(
    cfg: DictConfig, task: Task, candidate: Candidate, waypoints: Waypoints
) -> DryRun | None:
    """Make what plays a plan that feels or looks; None: it does neither."""
    if not (waypoints.guards or waypoints.looks):
        return None

    settings = node(cfg.rollout, RolloutSettings)
    return DryRun(
        task,
        candidate,
        cfg.seed,
        settings,
        cfg.rate_hz,
        cfg.speed,
    )


def _play_moves(
    cfg: DictConfig,
    conditions: Mapping[str, Condition],
    scene: Scene,
    tool: Tool,
    waypoints: Waypoints,
    dry_run: DryRun | None,
) -> tuple[Motion, dict[str, Sampled], dict[str, PlayedMotion]]:
    """Sample the motion of a plan, and play it in each engine.

    Args:
        cfg: the settings of the command.
        conditions: the task in each engine.
        scene: of the layout.
        tool: what the arm holds.
        waypoints: what the plan means in the layout.
        dry_run: of a plan that feels or looks; its motion is what came of it in the first engine.

    Returns:
        The motion as it is planned, as it is sampled with the ways there and back, and what it earned by engine.
    """
    task = next(iter(conditions.values())).task.shared()
    if dry_run is None:
        planned = plan_task_motion(waypoints, task, node(cfg.rollout, RolloutSettings))
        moves = sample_moves(cfg, task, planned)
        replays = play_in_all(conditions, scene, tool, moves["trajectory"])
        return planned, moves, replays

    replays = play_in_all(conditions, scene, tool, dry_run)
    planned = _find_played(replays)
    moves = sample_moves(cfg, task, planned)
    del moves["trajectory_slow"]
    return planned, moves, replays


def _find_played(replays: Mapping[str, PlayedMotion]) -> Motion:
    """Return how a plan that feels or looks moved the arm in the first engine."""
    first = next(iter(replays.values()))
    assert first.reactions is not None
    return first.reactions.motion


def _check_reactions(
    conditions: Mapping[str, Condition],
    candidate: Candidate,
    scene: Scene,
    replays: Mapping[str, PlayedMotion],
) -> Check:
    """Say what the dry run of a plan felt and saw; it fails where the plan did not come to its end.

    Args:
        conditions: the task in each engine.
        candidate: has the plan.
        scene: of the layout.
        replays: what came of the dry run in each engine.
    """
    rows = []
    passed = True
    for engine, replay in replays.items():
        reactions = replay.reactions
        assert reactions is not None
        fired = [felt for felt in reactions.felt if felt.fired]
        guards = f"{len(fired)} of {count_words(len(reactions.felt), 'guard')} fired"
        row = f"{guards}, {count_words(len(reactions.looked), 'look')} in {engine}"
        if reactions.problem:
            passed = False
            row += f" ({reactions.problem})"

        parting = describe_parting(conditions[engine], candidate, scene, reactions)
        if parting:
            row += f" ({parting})"

        rows.append(row)

    return Check("dry run", passed, f"move by move: {'; '.join(rows)}")


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
    passed = True
    rows = []
    for engine, reward in earned.items():
        least = max(asked[engine] - SAME_REWARD, LEAST_REWARD)
        passed = passed and reward >= least
        wanted = number(asked[engine], 3)
        rows.append(f"{number(reward, 3)} for {wanted} in {engine}")

    return Check("rewards", passed, f"{how} it earns {', '.join(rows)}")
