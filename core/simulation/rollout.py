"""Evaluate candidates: from waypoints to a reward. Engines only play what is prepared here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from core.design import SAVED, Candidate, DesignError, Evaluation, Tool
from core.designs.planning import resolve
from core.errors import UserError
from core.geometry import Array
from core.interfaces import Outcome, Recording, Robot, Rollout, RolloutSettings, Simulator, Task
from core.plugins import PluginPart, describe_part, installed
from core.plugins.blame import PluginError, describe_failure
from core.robot.tempo import plan_task_motion
from core.robot.trajectory import Motion
from core.scene import Scene, State, Trace
from core.simulation.clearance import Idle, find_idle
from core.simulation.observing import observe
from core.solids.contacts import Contacts, find_contacts, make_trace
from core.solids.penetration import Explosion, Finding, findings_of_each
from core.solids.record_rate import is_finite, sample_hz, thinnest
from core.solids.self_collision import find_self_collision
from core.support.text import shorten
from core.task import reward_of
from core.values.observations import TRIAL
from core.values.traces import TRACE_HZ


@dataclass(frozen=True)
class Evaluator:
    """Evaluate candidates in one engine, with one layout of a task and one way to execute plans.

    Calling it with a batch of candidates returns their evaluations, in order. It is small, hashable and picklable. What
    keeps ``clearance`` metres from all that can move is not simulated, where the reward is then 0 (`find_idle`); None:
    all is simulated.

    Raises:
        PluginError: the code of the task or the simulator raised something; names the plugin.
    """

    task: PluginPart[Task]
    sim: PluginPart[Simulator]
    seed: int = 0
    settings: RolloutSettings = field(default_factory=RolloutSettings)
    clearance: float | None = None

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
            foresight = None
            if self.clearance is not None and any(candidate.problem is None for candidate in candidates):
                idle = _idle(self.task, self.sim, self.seed, self.settings.settle_s, self.settings.hold_s)
                foresight = None if idle is None else (idle, self.clearance)
            found = evaluate_batch(task, simulator, candidates, self.seed, self.settings, foresight)
        except (UserError, MemoryError):
            raise
        except Exception as error:  # a plugin's code may raise anything
            blamed = describe_failure(error)
            if blamed is None:
                raise
            raise PluginError(blamed) from error
        if self.settings.observe:
            found = [replace(e, details=e.details | {TRIAL: self.trial}) for e in found]
        return found

    @property
    def trial(self) -> dict[str, Any]:
        """Where its rollouts take place: the engine, the layout's number, and that of a perturbation."""
        return {"engine": self.sim.name, "layout": self.seed}


@lru_cache(maxsize=256)
def _task(part: PluginPart[Task]) -> Task:
    """Make a task once per process."""
    return part.create()


@lru_cache(maxsize=4)
def _simulator(part: PluginPart[Simulator]) -> Simulator:
    """Make a simulator once per process."""
    return part.create()


@lru_cache(maxsize=256)
def _idle(task: PluginPart[Task], sim: PluginPart[Simulator], seed: int, settle_s: float, hold_s: float) -> Idle | None:
    """Find out once per process what a layout is while the robot rests."""
    return find_idle(_task(task), _simulator(sim), seed, RolloutSettings(settle_s=settle_s, hold_s=hold_s))


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
    motion = plan_task_motion(resolve(candidate.plan, task, seed, settings, scene), task, settings)
    hold_s = max(settings.hold_s, task.hold_s)
    job = Rollout(candidate.tool, motion.trajectory, seed, settings.settle_s, hold_s, record_hz)
    return motion, job


def evaluate_batch(
    task: Task,
    simulator: Simulator,
    candidates: Sequence[Candidate],
    seed: int,
    settings: RolloutSettings,
    foresight: tuple[Idle, float] | None = None,
) -> list[Evaluation]:
    """Try each candidate and return their evaluations, in order. One call of the task's reward covers all worlds.

    What touches nothing is not simulated, if there is ``foresight``: what the layout is while the robot rests, and the
    least clearance in metres.
    """
    evaluations: dict[int, Evaluation] = {}
    motions: dict[int, Motion] = {}
    jobs: dict[int, Rollout] = {}
    foreseen: dict[int, Outcome] = {}
    saved: dict[int, dict[str, Any]] = {}
    crossed: dict[int, tuple[str]] = {}
    scene = task.scene(seed)
    thin, traced = thinnest(scene), task.reads_trace
    for i, candidate in enumerate(candidates):
        if candidate.problem is not None:
            evaluations[i] = Evaluation(candidate, "rejected", reason=candidate.problem)
            continue
        try:
            motion, job = prepare(task, candidate, seed, settings, scene=scene)
        except DesignError as error:
            evaluations[i] = Evaluation(candidate, "rejected", reason=str(error))
            continue
        if (duration := motion.trajectory.duration) > settings.max_motion_s:
            took = f"the motion takes {duration:.0f} s under the arm's limits, more than {settings.max_motion_s:.0f} s"
            evaluations[i] = Evaluation(candidate, "rejected", reason=f"{took}; use fewer waypoints")
            continue
        if settings.penetration != "ignore" and (met := find_self_collision(task.robot, job.tool, motion.trajectory)):
            where = met.describe(motion.arrivals)
            if settings.penetration == "forbid":
                evaluations[i] = Evaluation(candidate, "rejected", reason=f"{where}; {met.mend}")
                continue
            crossed[i] = (where,)
        motions[i] = motion
        if foresight is not None and (untouched := foresight[0].foresee(task.robot, job, foresight[1])) is not None:
            film = foresight[0].film(task.robot, job) if settings.observe else None
            said = f"not simulated: it keeps {foresight[1]:g} m or more from all that can move"
            foreseen[i] = replace(untouched, tracking_error_rad=float("nan"), recording=film, warnings=(said,))
            seconds = job.settle_s + job.trajectory.duration + job.hold_s
            saved[i] = {SAVED: {"rollouts": 1, "seconds": foresight[0].share * seconds}}
            continue
        if settings.penetration != "ignore" or settings.observe:
            job = replace(job, record_hz=sample_hz(task.robot, job.tool, job.trajectory, thin))
        if traced:
            job = replace(job, record_hz=job.record_hz or TRACE_HZ, forces=True)
        jobs[i] = job
    outcomes = foreseen | dict(zip(jobs, _outcomes(simulator, task, list(jobs.values())), strict=True))
    finished: dict[int, tuple[State, State]] = {}
    found: dict[int, list[Finding] | Explosion] = {}
    warned: dict[int, list[Finding]] = {}
    contacts: dict[int, Contacts] = {}
    if settings.penetration != "ignore":
        recorded = {i: (jobs[i].tool, film) for i in jobs if (film := outcomes[i].recording) is not None}
        found = findings(scene, task.robot, recorded)
    for i, outcome in outcomes.items():
        tool = candidates[i].tool
        if isinstance(unphysical := found.get(i, []), Explosion):
            evaluations[i] = Evaluation(candidates[i], "failed", reason=f"the simulation blew up: {unphysical}")
            continue
        warned[i] = unphysical
        recording = outcome.recording if outcome.error is None and (traced or settings.observe) else None
        if recording is not None and tool is not None and is_finite(recording):
            contacts[i] = find_contacts(scene, task.robot, tool, recording)
        if outcome.error is not None or outcome.start is None or outcome.end is None:
            reason = outcome.error or "the simulator returned no state"
            evaluations[i] = Evaluation(candidates[i], "failed", reason=reason)
        elif traced and i not in contacts:
            reason = "the reward reads a trace, and the simulator returned no recording of finite states"
            evaluations[i] = Evaluation(candidates[i], "failed", reason=reason)
        else:
            finished[i] = outcome.start, outcome.end
    if finished:
        starts, ends = (scene.complete(State.stack(states)) for states in zip(*finished.values(), strict=True))
        shifts = np.linalg.norm(ends.positions - starts.positions, axis=-1)
        trace = make_trace(scene, [contacts[i] for i in finished]) if traced else None
        for i, reward, moved in zip(finished, _rewards(task, starts, ends, trace), shifts, strict=True):
            evaluation = Evaluation(
                candidates[i],
                "ok",
                reward=float(reward),
                distance_m=motions[i].distance_m,
                ik_error_m=motions[i].ik_error_m,
                ik_error_rad=motions[i].ik_error_rad,
                tracking_error_rad=outcomes[i].tracking_error_rad,
                moved_m={name: float(shift) for name, shift in zip(starts.names, moved, strict=True)},
                warnings=(*crossed.get(i, ()), *motions[i].slowdowns(), *outcomes[i].warnings),
            )
            if not 0.0 <= reward <= 1.0:
                reason = f"task {task.name}: the reward {reward} is not in [0, 1]"
                evaluation = replace(evaluation, status="failed", reward=0.0, reason=reason)
            if settings.observe and i in contacts:
                seen = observe(task, scene, motions[i], outcomes[i], evaluation.reward, contacts[i])
                evaluation = replace(evaluation, details=seen.details())
            evaluation = replace(evaluation, details=evaluation.details | saved.get(i, {}))
            evaluations[i] = judged(evaluation, warned[i], forbid=settings.penetration == "forbid")
    return [evaluations[i] for i in range(len(candidates))]


def findings(
    scene: Scene, robot: Robot, recorded: Mapping[int, tuple[Tool, Recording]]
) -> dict[int, list[Finding] | Explosion]:
    """Find what is unphysical in recorded rollouts, those with one tool together."""
    found: dict[int, list[Finding] | Explosion] = {}
    for tool in dict.fromkeys(tool for tool, _ in recorded.values()):
        films = {i: recording for i, (with_tool, recording) in recorded.items() if with_tool == tool}
        found |= zip(films, findings_of_each(scene, robot, tool, [*films.values()]), strict=True)
    return found


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
    warnings = (*evaluation.warnings, *(finding.text for finding in found))
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
