"""Prepare what an engine plays: plan a candidate's motion in one condition, and check it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial

from core.design import Candidate, DesignError, Tool
from core.designs.plan_rules import check_motion, find_turn_warnings
from core.designs.planning import resolve
from core.designs.start import SpawnRules
from core.errors import Refusal
from core.interfaces import (
    Begin,
    Motion,
    Outcome,
    PlannedMotion,
    Reactions,
    Rollout,
    RolloutSettings,
    Simulator,
    Task,
    Waypoints,
)
from core.plugins.blame import call_part
from core.robot.trajectory import plan_task_motion
from core.scene import Scene
from core.simulation.engines import check_support
from core.simulation.looking import Lookout
from core.solids.contacts import Contacts
from core.solids.penetration import Finding
from core.solids.record_rate import MAX_HZ
from core.solids.self_collision import find_self_collision
from core.trial import Condition, Status, Trial
from core.values.refusals import DesignReason
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
    scene = scene.furnished(tool)

    most_s = plan.most_seconds(settings.perception.look_s)
    if most_s > settings.max_motion_s:
        raise DesignError.because(
            DesignReason.LOOP_TIME, time_s=most_s, most_s=settings.max_motion_s
        )

    waypoints = resolve(plan, task, seed, settings, scene)
    plan_motion = _motion if isinstance(task, Hashable) else plan_task_motion
    motion = plan_motion(waypoints, task, settings)
    reactions = None

    if waypoints.guards or waypoints.looks:
        lookout = Lookout(task, scene, tool, seed, settings)
        planned = PlannedMotion(
            waypoints,
            motion,
            task.robot,
            seed,
            settings,
            resolve=partial(resolve, plan, task, seed, settings, scene),
            perceive=lookout.look,
            report=lookout.report,
            go_on=partial(plan_on, task, tool, settings),
            check=partial(check_motion, task, tool, scene, settings),
        )
        reactions = call_part(plan, "make_reactions", Reactions, planned)

    job = Rollout(
        tool,
        motion.trajectory,
        seed,
        settings.settle_s,
        max(settings.hold_s, task.hold_s),
        record_hz,
        reactions=reactions,
        scene=scene,
    )
    return motion, job


def plan_on(
    task: Task,
    tool: Tool,
    settings: RolloutSettings,
    waypoints: Waypoints,
    begin: Begin | None,
) -> Motion:
    """Plan the motion of a task's robot through waypoints, from where it stopped.

    Raises:
        DesignError: there is none, or it drives the arm through itself, and that is forbidden.
    """
    motion = plan_task_motion(waypoints, task, settings, begin)
    if settings.penetration == "forbid":
        collision = find_self_collision(task.robot, tool, motion.trajectory)
        if collision is not None:
            where = collision.describe(motion.arrivals)
            raise DesignError.because(
                DesignReason.ARM_IN_ITSELF,
                where=f"on from there, {where}",
                mend=collision.mend,
            )

    return motion


class Stage:
    """A condition with its parts made, in which candidates are tried."""

    def __init__(self, condition: Condition) -> None:
        self.condition = condition
        self.where = condition.where
        self.settings = condition.settings

    @property
    def task(self) -> Task:
        return self.condition.task.shared()

    @property
    def simulator(self) -> Simulator:
        simulator: Simulator = self.condition.sim.shared()
        return simulator

    @cached_property
    def scene(self) -> Scene:
        return self.condition.scene()

    @cached_property
    def spawn_rules(self) -> SpawnRules:
        return SpawnRules(self.task, self.condition.layout, self.scene)


_MOST_HIDDEN = 3  # looks whose hidden bodies are warned of

stage_of = lru_cache(maxsize=64)(Stage)  # a process makes a condition's scene once


@dataclass(eq=False)
class Attempt:
    """A candidate that is tried, on its way through a batch.

    Attributes:
        candidate: what is tried.
        motion: its plan in this layout.
        job: what the simulator plays.
        outcome: what the simulator made of it.
        warnings: what is to be said of it so far.
        findings: what was unphysical.
        contacts: those of its recording; None: they are not needed, or there is no recording of finite states.
        problem: why its motion, as guards and looks changed it, is refused.
        trial: what came of it; None: it is still on its way.
    """

    candidate: Candidate
    motion: Motion = field(init=False)
    job: Rollout = field(init=False)
    outcome: Outcome = field(init=False)
    warnings: tuple[str, ...] = ()
    findings: Sequence[Finding] = ()
    contacts: Contacts | None = None
    problem: str | None = None
    trial: Trial | None = None

    @property
    def scene(self) -> Scene:
        """What its job spawns."""
        assert self.job.scene is not None  # `prepare` gives one to each job
        return self.job.scene

    def end(
        self,
        stage: Stage,
        status: Status,
        reason: str,
        refusals: tuple[Refusal, ...] = (),
    ) -> None:
        """Let it earn nothing."""
        self.trial = Trial(
            stage.where, self.candidate.id, status, reason=reason, refusals=refusals
        )


def plan_attempt(stage: Stage, candidate: Candidate) -> Attempt:
    """Plan a candidate's motion, or reject the candidate."""
    attempt = Attempt(stage.condition.perturb(candidate))

    try:
        _prepare_job(stage, attempt)
        _check_self_collision(stage, attempt)
    except DesignError as error:
        attempt.end(stage, "rejected", str(error), error.refusals)

    return attempt


def _check_self_collision(stage: Stage, attempt: Attempt) -> None:
    """Warn of where the motion drives the arm through itself.

    Raises:
        DesignError: it does, and that is forbidden.
    """
    penetration = stage.settings.penetration
    if penetration == "ignore":
        return

    motion = attempt.motion
    collision = _self_collision(stage.task.robot, attempt.job.tool, motion.trajectory)
    if collision is None:
        return

    warning = collision.describe(motion.arrivals)
    attempt.warnings += (warning,)
    if penetration == "forbid":
        raise DesignError.because(
            DesignReason.ARM_IN_ITSELF, where=warning, mend=collision.mend
        )


def _prepare_job(stage: Stage, attempt: Attempt) -> None:
    """Plan a candidate's motion, and make the job that plays it.

    Raises:
        DesignError: the candidate breaks a rule, its tool starts inside something, or the plan means nothing in
            this layout, or costs too much time.
    """
    candidate = attempt.candidate
    condition = stage.condition
    settings = stage.settings

    if candidate.problem is not None or candidate.tool is None:
        error = DesignError(candidate.problem or "there is no tool")
        raise error.coded(*candidate.refusals)
    if condition.examiner is not None:
        refusal = condition.examiner.refuse(condition, candidate)
        if refusal is not None:
            raise DesignError(refusal)

    fault = _find_start_fault(stage, candidate.tool)
    if fault is not None:
        raise fault.placed("")  # a new one: this one is kept

    motion, job = prepare(
        stage.task, candidate, condition.layout, settings, scene=stage.scene
    )
    attempt.motion = motion
    attempt.job = job
    hz = check_motion(stage.task, job.tool, attempt.scene, settings, job.trajectory)
    if hz > 0:
        if job.tool.bearers or job.reactions:  # what they will do is not known yet
            hz = MAX_HZ
        job = replace(job, record_hz=hz, forces=bool(stage.scene.softs))

    if stage.task.reads_trace:
        hz = job.record_hz or TRACE_HZ
        if any(goal.needs_peaks for goal in stage.task.goals):
            hz = MAX_HZ
        job = replace(job, record_hz=hz, forces=True)

    check_support(stage.simulator, stage.task.name, attempt.scene, job)
    attempt.job = job
    attempt.warnings += tuple(find_turn_warnings(candidate.plan.turns))


@lru_cache(maxsize=64)  # the candidates of a chunk share their tool
def _find_start_fault(stage: Stage, tool: Tool) -> DesignError | None:
    """Say what a tool does not start clear of in this scene; None: it is clear."""
    try:
        stage.spawn_rules.check(tool)
    except DesignError as error:
        place = "" if stage.condition.change is None else "in the perturbed scene, "
        return error.placed(place)
    return None


def follow_reactions(stage: Stage, attempt: Attempt) -> None:
    """Take the motion as it was played, and check what guards and looks changed."""
    reactions = attempt.job.reactions
    if reactions is None or reactions.motion is attempt.motion:
        return

    attempt.motion = reactions.motion
    if reactions.problem:
        attempt.warnings += (reactions.problem,)

    hidden = [looked for looked in reactions.looked if looked.hidden]
    attempt.warnings += tuple(map(str, hidden[:_MOST_HIDDEN]))

    try:
        _check_self_collision(stage, attempt)
    except DesignError as error:
        attempt.problem = str(error)
