"""Prepare what an engine plays: plan a candidate's motion in one condition, and check it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from core.design import Candidate, DesignError, Tool
from core.designs.plan_rules import check_work
from core.designs.planning import resolve
from core.designs.start import SpawnRules
from core.interfaces import Outcome, Rollout, RolloutSettings, Simulator, Task
from core.robot.trajectory import Motion, plan_task_motion
from core.scene import Scene
from core.simulation.guards import PlannedGuards
from core.solids.contacts import Contacts
from core.solids.penetration import Finding
from core.solids.record_rate import sample_hz, thinnest
from core.solids.self_collision import find_self_collision
from core.trial import Condition, Trial, Where
from core.values.traces import TRACE_HZ

# Layouts and engines share what is made of one plan. A task of a third party may not be hashable.
_motion = lru_cache(maxsize=64)(plan_task_motion)
_self_collision = lru_cache(maxsize=64)(find_self_collision)


def prepare(
    task: Task,
    candidate: Candidate,
    seed: int,
    settings: RolloutSettings,
    record_hz: float = 0.0,
    scene: Scene | None = None,
) -> tuple[Motion, Rollout]:
    """Plan a candidate's motion, and make the job that plays it; ``scene`` is the layout, if it is there already.

    Raises:
        ValueError: the candidate has no tool (it was rejected), or its plan means nothing in this layout.
    """
    tool = candidate.tool
    plan = candidate.plan

    if tool is None:
        raise ValueError(
            f"candidate {candidate.id} has no tool to try: {candidate.problem}"
        )

    if scene is None:
        scene = task.scene(seed)
    waypoints = resolve(plan, task, seed, settings, scene)
    plan_motion = _motion if isinstance(task, Hashable) else plan_task_motion
    motion = plan_motion(waypoints, task, settings)
    guards = None
    if waypoints.guards:
        guards = PlannedGuards(plan, waypoints, motion, task, seed, settings, scene)
    job = Rollout(
        tool,
        motion.trajectory,
        seed,
        settings.settle_s,
        max(settings.hold_s, task.hold_s),
        record_hz,
        guards=guards,
        scene=scene,
    )
    return motion, job


def played(motion: Motion, job: Rollout) -> Motion:
    """Return a job's motion as it was played: with guards it may differ from what was planned."""
    return job.guards.motion if isinstance(job.guards, PlannedGuards) else motion


@lru_cache(maxsize=64)
def scene_of(condition: Condition) -> Scene:
    """Return the scene of a condition; a process makes it once."""
    return condition.scene()


@lru_cache(maxsize=64)
def _spawn_rules(condition: Condition) -> SpawnRules:
    return SpawnRules(condition.task.shared(), condition.layout, scene_of(condition))


class Stage:
    """A condition with its parts made, in which candidates are tried."""

    def __init__(self, condition: Condition) -> None:
        self.condition = condition
        self.where: Where = condition.where
        self.settings = condition.settings
        self.task: Task = condition.task.shared()
        self.simulator: Simulator = condition.sim.shared()
        self.scene = scene_of(condition)

    @property
    def checks(self) -> bool:
        """Whether passing through something is looked for."""
        return self.settings.penetration != "ignore"

    @property
    def forbids(self) -> bool:
        """Whether what passes through something earns nothing."""
        return self.settings.penetration == "forbid"


@dataclass(eq=False)
class Attempt:
    """A candidate that is tried, on its way through a batch.

    Attributes:
        candidate: what is tried; ``tool`` is the candidate's.
        motion: its plan in this layout.
        job: what the simulator plays.
        warnings: what is to be said of it so far.
        outcome: what the simulator made of it.
        findings: what was unphysical.
        contacts: those of its recording; None: they are not needed, or there is no recording of finite states.
        problem: why its motion, as planned or as guards changed it, is refused.
    """

    candidate: Candidate
    tool: Tool
    motion: Motion
    job: Rollout
    warnings: tuple[str, ...] = ()
    outcome: Outcome | None = None
    findings: Sequence[Finding] = ()
    contacts: Contacts | None = None
    problem: str | None = None


def plan_attempt(stage: Stage, candidate: Candidate) -> Attempt | Trial:
    """Plan a candidate's motion; a trial: it is rejected."""
    planned = candidate.of(stage.task.name)
    try:
        motion, job = _prepare_job(stage, planned)
    except DesignError as error:
        return _reject(stage, planned, str(error))

    if stage.task.reads_trace:
        job = replace(job, record_hz=job.record_hz or TRACE_HZ, forces=True)
    attempt = Attempt(planned, job.tool, motion, job, tuple(motion.doubts()))
    _check_self_collision(stage, attempt)
    if attempt.problem is not None:
        return _reject(stage, planned, attempt.problem)
    return attempt


def _check_self_collision(stage: Stage, attempt: Attempt) -> None:
    """Warn of where the motion drives the arm through itself, and refuse it, if that is forbidden."""
    if not stage.checks:
        return
    motion = attempt.motion
    robot = stage.task.robot
    collision = _self_collision(robot, attempt.tool, motion.trajectory)
    if collision is None:
        return
    warning = collision.describe(motion.arrivals)
    attempt.warnings += (warning,)
    if stage.forbids:
        attempt.problem = f"{warning}; {collision.mend}"


def _reject(stage: Stage, candidate: Candidate, reason: str) -> Trial:
    return Trial(stage.where, candidate.id, "rejected", reason=reason)


def _prepare_job(stage: Stage, candidate: Candidate) -> tuple[Motion, Rollout]:
    """Plan a candidate's motion, and make the job that plays it.

    Raises:
        DesignError: the candidate breaks a rule, its tool starts inside something, or the plan means nothing in
            this layout, or costs too much time.
    """
    if candidate.problem is not None or candidate.tool is None:
        raise DesignError(candidate.problem or "there is no tool")
    examiner = stage.condition.examiner
    refusal = None if examiner is None else examiner.refuse(stage.condition, candidate)
    if refusal is not None:
        raise DesignError(refusal)
    _check_start(stage, candidate.tool)
    motion, job = prepare(
        stage.task, candidate, stage.condition.layout, stage.settings, scene=stage.scene
    )
    if job.guards is not None and not stage.simulator.supports_guards:
        raise DesignError(
            "the plan has guards ('until'), and this engine can't play them"
        )

    duration = motion.trajectory.duration
    most = stage.settings.max_motion_s
    if duration > most:
        took = f"the motion takes {duration:.0f} s under the arm's limits, more than {most:.0f} s"
        raise DesignError(f"{took}; use fewer waypoints")

    if stage.checks or stage.settings.observe:
        thin = thinnest(stage.scene)
        hz = sample_hz(stage.task.robot, job.tool, job.trajectory, thin)
        check_work(job.tool, duration, hz)
        job = replace(job, record_hz=hz, forces=bool(stage.scene.softs))

    return motion, job


def _check_start(stage: Stage, tool: Tool) -> None:
    """Refuse a tool that does not start clear of everything in this scene."""
    try:
        _spawn_rules(stage.condition).check(tool)
    except DesignError as error:
        place = "" if stage.condition.change is None else "in the perturbed scene, "
        raise DesignError(f"{place}{error}") from error


def follow_guards(stage: Stage, attempt: Attempt) -> None:
    """Take the motion as it was played, and check what guards changed."""
    guards = attempt.job.guards
    if not isinstance(guards, PlannedGuards) or guards.motion is attempt.motion:
        return
    attempt.motion = guards.motion
    if guards.problem:
        attempt.warnings += (guards.problem,)
    _check_self_collision(stage, attempt)
