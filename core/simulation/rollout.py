"""Evaluate candidates: from waypoints to a reward. Engines only play what is prepared here."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from core.design import Candidate, DesignError, Evaluation, Tool, Trial
from core.designs.planning import resolve
from core.designs.rules import check_work
from core.errors import RAISED, UserError
from core.geometry import Array
from core.interfaces import Outcome, Rollout, RolloutSettings, Simulator, Task
from core.plugins import PluginPart, describe_part, installed
from core.plugins.blame import PluginError, describe_failure
from core.robot.tempo import plan_task_motion
from core.robot.trajectory import Motion
from core.scene import Scene, State, Trace
from core.simulation.guards import PlannedGuards
from core.simulation.observing import MISSED_M, MISSED_RAD, observe
from core.solids.contacts import Contacts, find_contacts, make_trace
from core.solids.penetration import Explosion, Finding, findings
from core.solids.record_rate import is_finite, sample_hz, thinnest
from core.solids.self_collision import find_self_collision
from core.support.text import shorten
from core.task import margins_of, reward_of, shares_of
from core.values.states import TRACE_HZ

_WARNINGS = 10  # findings of a rollout that are listed


@dataclass(frozen=True)
class Evaluator:
    """Evaluate candidates in one engine, with one layout of a task and one way to execute plans.

    Calling it with a batch of candidates returns their evaluations, in order. It is small, hashable and picklable.

    Raises:
        PluginError: the code of the task or the simulator raised something; names the plugin.
    """

    task: PluginPart[Task]
    sim: PluginPart[Simulator]
    seed: int = 0
    settings: RolloutSettings = field(default_factory=RolloutSettings)

    @property
    def batch(self) -> int:
        """The number of candidates that its simulator takes at once (`Simulator.batch`)."""
        return int(getattr(installed().factory(self.sim.kind, self.sim.name), "batch", 1))

    def prepare(self) -> None:
        """Make the task and the simulator, as the first call does: what fails here is no candidate's fault."""
        self.made()

    def made(self) -> tuple[Task, Simulator]:
        """Return the task and the simulator; a process makes each once."""
        return _task(self.task), _simulator(self.sim)

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        try:
            task, simulator = self.made()
            found = evaluate_batch(task, simulator, candidates, self.seed, self.settings)
        except (UserError, MemoryError):
            raise
        except RAISED as error:  # a plugin's code may raise anything
            blamed = describe_failure(error)
            if blamed is None:
                raise
            raise PluginError(blamed) from error
        return [replace(evaluation, trials=(self._trial(evaluation),)) for evaluation in found]

    @property
    def change(self) -> int | None:
        """The number of the scene's perturbation; None: the scene is as the task has it."""
        return None

    def _trial(self, evaluation: Evaluation) -> Trial:
        """Complete the trial of an evaluation: where it took place, and what came of it."""
        known = evaluation.trials[0] if evaluation.trials else Trial()
        earned = replace(known, status=evaluation.status, reward=evaluation.reward, reason=evaluation.reason)
        return replace(earned, engine=self.sim.name, layout=self.seed, change=self.change)


@lru_cache(maxsize=256)
def _task(part: PluginPart[Task]) -> Task:
    """Make a task once per process."""
    return part.create()


@lru_cache(maxsize=4)
def _simulator(part: PluginPart[Simulator]) -> Simulator:
    """Make a simulator once per process."""
    return part.create()


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
    if candidate.tool is None:
        raise ValueError(f"candidate {candidate.id} has no tool to try: {candidate.problem}")
    waypoints = resolve(candidate.plan, task, seed, settings, scene)
    motion = (_motion if isinstance(task, Hashable) else plan_task_motion)(waypoints, task, settings)
    guards = None
    if waypoints.guards:
        guards = PlannedGuards(candidate.plan, waypoints, motion, task, seed, settings, scene)
    hold_s = max(settings.hold_s, task.hold_s)
    job = Rollout(candidate.tool, motion.trajectory, seed, settings.settle_s, hold_s, record_hz, guards=guards)
    return motion, job


def played(motion: Motion, job: Rollout) -> Motion:
    """Return a job's motion as it was played: with guards it may differ from what was planned."""
    return job.guards.motion if isinstance(job.guards, PlannedGuards) else motion


@dataclass(eq=False)
class _Attempt:
    """A candidate that is tried, on its way through a batch.

    Attributes:
        contacts: those of its recording; None: they are not needed, or there is no recording of finite states.
    """

    candidate: Candidate  # what is tried
    tool: Tool  # the candidate's
    motion: Motion  # its plan in this layout
    job: Rollout  # what the simulator plays
    warnings: tuple[str, ...] = ()  # what is to be said of it so far
    outcome: Outcome | None = None  # what the simulator made of it
    findings: Sequence[Finding] = ()  # what was unphysical
    contacts: Contacts | None = None
    problem: str | None = None  # what came of its guards that is not allowed

    def failed(self, reason: str) -> Evaluation:
        return Evaluation(self.candidate, "failed", reason=reason, trials=(Trial(),))


def evaluate_batch(
    task: Task,
    simulator: Simulator,
    candidates: Sequence[Candidate],
    seed: int,
    settings: RolloutSettings,
) -> list[Evaluation]:
    """Try each candidate and return their evaluations, in order. One call of the task's reward covers all worlds."""
    batch = _Batch(task, task.scene(seed), seed, settings, simulator.feels)
    steps = [batch.planned(candidate) for candidate in candidates]
    attempts = [step for step in steps if isinstance(step, _Attempt)]
    outcomes = _outcomes(simulator, task, [attempt.job for attempt in attempts])
    for attempt, outcome in zip(attempts, outcomes, strict=True):
        attempt.outcome = outcome
        batch.follow(attempt)
    judged = iter(batch.judged(attempts))
    return [next(judged) if isinstance(step, _Attempt) else step for step in steps]


def check(task: Task, candidate: Candidate, seed: int, settings: RolloutSettings) -> list[str]:
    """Say what is wrong with a candidate in one layout, without playing it.

    That is why it would be rejected, or else which waypoints the arm misses or is late at, and where it meets itself.
    """
    planned = _Batch(task, task.scene(seed), seed, settings, feels=True).planned(candidate)
    if isinstance(planned, Evaluation):
        return [planned.reason]
    motion = planned.motion
    out_of_reach = [
        f"the arm misses the way to waypoint {k + 1} by {1000 * metres:.0f} mm, {radians:.2f} rad"
        for k, (metres, radians) in enumerate(motion.misses.tolist())
        if metres > MISSED_M or radians > MISSED_RAD
    ]
    return [*out_of_reach, *motion.slowdowns(), *planned.warnings]


@dataclass(frozen=True, eq=False)
class _Batch:
    """One layout of a task, and how candidates are tried in it; see `evaluate_batch`."""

    task: Task
    scene: Scene
    seed: int
    settings: RolloutSettings
    feels: bool

    @property
    def _checks(self) -> bool:
        return self.settings.penetration != "ignore"

    @property
    def _forbids(self) -> bool:
        return self.settings.penetration == "forbid"

    def planned(self, candidate: Candidate) -> _Attempt | Evaluation:
        """Plan a candidate's motion; an evaluation: it is rejected."""
        robot, problem, warnings = self.task.robot, candidate.problem, tuple[str, ...]()
        if problem is None:
            try:
                motion, job = self._prepared(candidate)
            except DesignError as error:
                problem = str(error)
        if problem is None and self._checks and (met := _self_collision(robot, job.tool, motion.trajectory)):
            warnings = (met.describe(motion.arrivals),)
            problem = f"{warnings[0]}; {met.mend}" if self._forbids else None
        if problem is not None:
            return Evaluation(candidate, "rejected", reason=problem)
        if self.task.reads_trace:
            job = replace(job, record_hz=job.record_hz or TRACE_HZ, forces=True)
        return _Attempt(candidate, job.tool, motion, job, warnings)

    def _prepared(self, candidate: Candidate) -> tuple[Motion, Rollout]:
        """Plan a candidate's motion, and make the job that plays it.

        Raises:
            DesignError: the plan means nothing in this layout, or costs too much time.
        """
        motion, job = prepare(self.task, candidate, self.seed, self.settings, scene=self.scene)
        if job.guards is not None and not self.feels:
            raise DesignError("the plan has guards ('until'), and this engine can't play them")
        duration, most_s = motion.trajectory.duration, self.settings.max_motion_s
        if duration > most_s:
            took = f"the motion takes {duration:.0f} s under the arm's limits, more than {most_s:.0f} s"
            raise DesignError(f"{took}; use fewer waypoints")
        if self._checks or self.settings.observe:
            hz = sample_hz(self.task.robot, job.tool, job.trajectory, thinnest(self.scene))
            check_work(job.tool, duration, hz)
            job = replace(job, record_hz=hz, forces=bool(self.scene.softs))
        return motion, job

    def follow(self, attempt: _Attempt) -> None:
        """Take the motion as it was played, and check what guards changed."""
        guards = attempt.job.guards
        if not isinstance(guards, PlannedGuards) or guards.motion is attempt.motion:
            return
        attempt.motion = guards.motion
        if guards.problem:
            attempt.warnings += (guards.problem,)
        met = find_self_collision(self.task.robot, attempt.tool, attempt.motion.trajectory) if self._checks else None
        if met:
            attempt.warnings += (met.describe(attempt.motion.arrivals),)
            attempt.problem = f"{attempt.warnings[-1]}; {met.mend}" if self._forbids else None

    def judged(self, attempts: Sequence[_Attempt]) -> list[Evaluation]:
        """Check what was played, and reward it."""
        failures = [self._failure(attempt) for attempt in attempts]
        finished = [attempt for attempt, failure in zip(attempts, failures, strict=True) if failure is None]
        rewarded = iter(self._rewarded(finished) if finished else [])
        return [attempt.failed(why) if why else next(rewarded) for attempt, why in zip(attempts, failures, strict=True)]

    def _failure(self, attempt: _Attempt) -> str | None:
        """Find what was unphysical and what touched; say why a rollout failed; None: it did not."""
        outcome, wanted = attempt.outcome, self.task.reads_trace or self.settings.observe
        if outcome is not None and (recording := outcome.recording) is not None:
            try:
                if self._checks:
                    attempt.findings = findings(self.scene, self.task.robot, attempt.tool, recording)
            except Explosion as explosion:
                return attempt.problem or f"the simulation blew up: {explosion}"
            if wanted and outcome.error is None and is_finite(recording):
                attempt.contacts = find_contacts(self.scene, self.task.robot, attempt.tool, recording)
        if attempt.problem is not None:
            return attempt.problem
        if outcome is None or outcome.error is not None or outcome.start is None or outcome.end is None:
            return (outcome and outcome.error) or "the simulator returned no state"
        if self.task.reads_trace and attempt.contacts is None:
            return "the reward reads a trace, and the simulator returned no recording of finite states"
        return None

    def _rewarded(self, finished: Sequence[_Attempt]) -> Iterator[Evaluation]:
        """Yield the evaluations of what came to its end."""
        scene, outcomes = self.scene, [attempt.outcome for attempt in finished]
        starts, ends = (
            scene.complete(State.stack([getattr(outcome, end) for outcome in outcomes])) for end in ("start", "end")
        )
        shifts = np.linalg.norm(ends.positions - starts.positions, axis=-1)
        contacts = [attempt.contacts for attempt in finished if attempt.contacts is not None]
        trace = make_trace(scene, contacts) if self.task.reads_trace else None
        rewards = _rewards(self.task, starts, ends, trace)
        for number, (attempt, reward, moved) in enumerate(
            zip(finished, rewards.tolist(), shifts.tolist(), strict=True)
        ):
            film = trace[number] if trace is not None else None
            margins = margins_of(self.task, starts[number], ends[number], film, reward)
            motion, outcome = attempt.motion, attempt.outcome
            assert outcome is not None
            evaluation = Evaluation(
                attempt.candidate,
                "ok",
                reward=reward,
                distance_m=motion.distance_m,
                ik_error_m=motion.ik_error_m,
                ik_error_rad=motion.ik_error_rad,
                tracking_error_rad=outcome.tracking_error_rad,
                moved_m=dict(zip(starts.names, moved, strict=True)),
                warnings=(*attempt.warnings, *motion.slowdowns(), *outcome.warnings),
                trials=(
                    replace(
                        self._trial(attempt, reward),
                        margins=margins,
                        motion_s=float(motion.trajectory.duration),
                        goals=shares_of(self.task, starts[number], ends[number], film),
                    ),
                ),
            )
            if not 0.0 <= reward <= 1.0:
                reason = f"task {self.task.name}: the reward {reward} is not in [0, 1]"
                evaluation = replace(evaluation, status="failed", reward=0.0, reason=reason)
            yield judged(evaluation, attempt.findings, forbid=self._forbids)

    def _trial(self, attempt: _Attempt, reward: float) -> Trial:
        if not self.settings.observe or attempt.contacts is None or attempt.outcome is None:
            return Trial()
        earned = reward if 0.0 <= reward <= 1.0 else 0.0
        seen = observe(self.task, self.scene, attempt.motion, attempt.outcome, earned, attempt.contacts)
        outcome = f"{seen.result} {seen.what}".strip()
        return Trial(touch_m=seen.touch_m, outcome=outcome, observation=seen)


def _outcomes(simulator: Simulator, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
    """Play the jobs, one outcome for each.

    Raises:
        PluginError: the simulator returned something else; names it.
    """
    outcomes = simulator.rollout(task, jobs)
    if not isinstance(outcomes, list) or not all(isinstance(outcome, Outcome) for outcome in outcomes):
        raise PluginError(
            f"{describe_part(simulator)}: rollout gave {shorten(repr(outcomes))}; expected a list of Outcome"
        )
    if len(outcomes) != len(jobs):
        raise PluginError(f"{describe_part(simulator)}: rollout gave {len(outcomes)} outcomes for {len(jobs)} jobs")
    return outcomes


def judged(evaluation: Evaluation, found: Sequence[Finding], *, forbid: bool) -> Evaluation:
    """Add findings to the evaluation's warnings; with ``forbid``, penetration sets its reward to 0."""
    texts = [finding.text for finding in found]
    more = [f"{len(texts) - _WARNINGS} more such findings"] if len(texts) > _WARNINGS else []
    warnings = (*evaluation.warnings, *texts[:_WARNINGS], *more)
    penetrations = [finding.text for finding in found if finding.penetration]
    if not (forbid and penetrations and evaluation.reward > 0):
        return replace(evaluation, warnings=warnings)
    reason = f"{penetrations[0]}, so that its reward of {evaluation.reward:.2f} does not count"
    return replace(evaluation, warnings=warnings, reward=0.0, reason=evaluation.reason or reason)


def _rewards(task: Task, starts: State, ends: State, trace: Trace | None) -> Array:
    """Compute the rewards of many worlds.

    Raises:
        PluginError: the task returned something else; names it.
    """
    count, rewards = len(ends.positions), np.asarray(reward_of(task, starts, ends, trace), dtype=np.float64)
    if rewards.shape != (count,):
        raise PluginError(
            f"{describe_part(task)}: reward gave an array of shape {rewards.shape} for {count} worlds; "
            f"expected ({count},)"
        )
    return rewards
