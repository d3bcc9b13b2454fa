"""How candidates become trials, with an engine that does what a test needs; real ones are in `tests/tasks`."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import Candidate, Tool
from core.errors import UsageError
from core.interfaces import Outcome, Recording, RolloutSettings, Waypoints
from core.plugins import installed
from core.plugins.blame import PluginError
from core.scene import State
from core.simulation.attempt import prepare
from core.simulation.play import play
from plugins.fitness.perturbation_range import PerturbationRange
from plugins.fitness.robustness import Perturbation
from tasks.bring_cube import BringCube
from tests.support.engines import simulator
from tests.support.faults import Crowded, Faulty, Slide, candidate
from tests.support.panda import ARM
from tests.support.playing import condition, evaluate_batch
from tests.support.refusing import fits

SETTINGS = RolloutSettings(settle_s=0, hold_s=0)


def evaluated(*candidates, task=None, engine=None, settings=SETTINGS):
    return evaluate_batch(
        task or Slide(), engine or Faulty(), candidates, settings=settings
    )


def test_what_breaks_a_rule_is_not_tried_and_the_order_is_kept():
    bad = Candidate(None, np.zeros((0, 6)), 0, 0, 9, 0, problem="no tool")
    first, rejected, last = evaluated(candidate(0), bad, candidate(1))
    assert (rejected.status, rejected.reason, rejected.reward) == (
        "rejected",
        "no tool",
        0.0,
    )
    assert [first.status, last.status] == ["ok", "ok"]
    assert [first.candidate.key, last.candidate.key] == [
        candidate(0).key,
        candidate(1).key,
    ]
    assert evaluated() == []
    with pytest.raises(ValueError, match="has no tool to try: no tool"):
        prepare(Slide(), bad, 0, SETTINGS)


def test_a_motion_that_takes_too_long_is_rejected():
    (evaluation,) = evaluated(candidate(0), settings=RolloutSettings(max_motion_s=0.1))
    assert evaluation.status == "rejected"
    (refusal,) = evaluation.refusals
    assert fits(refusal, "E_MOTION_TIME", {"most_s": 0.1})
    assert refusal.values["time_s"] > 0.1


class Lost(Faulty):
    def one(self, task, job):
        return Outcome(None, None, error=None)


def test_a_rollout_without_states_has_failed():
    (evaluation,) = evaluated(candidate(0), engine=Lost())
    assert (evaluation.status, evaluation.reason) == (
        "failed",
        "the simulator returned no state",
    )


class Generous(Slide):
    def reward(self, start, end):
        return 2 + super().reward(start, end)


def test_a_reward_outside_0_and_1_has_failed():
    (evaluation,) = evaluated(candidate(0), task=Generous())
    assert (evaluation.status, evaluation.reward) == ("failed", 0.0)
    assert evaluation.reason.startswith("task Slide: the reward 2.")


class Single(Slide):
    def reward(self, start, end):
        return 0.5


def test_a_reward_that_is_not_one_per_world_names_the_task():
    with pytest.raises(
        PluginError,
        match=r"reward gave .*; expected an array \(1,\)",
    ):
        evaluated(candidate(0), candidate(1), task=Single())


def test_rewards_and_shifts_are_those_of_each_candidate():
    together = evaluated(candidate(0), candidate(30))
    alone = [*evaluated(candidate(0)), *evaluated(candidate(30))]
    assert [e.reward for e in together] == [e.reward for e in alone]
    assert together[0].reward != together[1].reward
    for evaluation in together:
        assert evaluation.shown.moved_m["block"] == pytest.approx(evaluation.reward)


class Traced(Slide):
    """Counts the touches of its block."""

    hold_s = 0.4

    def reward(self, start, end, trace):
        assert trace.states.positions.shape == (
            *start.positions.shape[:-2],
            len(trace.times),
            1,
            3,
        )
        return (
            trace.touched("block", "robot") * 0.5 + (trace.force_n("block") > 4) * 0.25
        )


class Filming(Faulty):
    """Records a still arm and a block in the tool's way, or far from it, with forces if they are asked for."""

    def rollout(self, task, jobs):
        self.jobs = jobs
        return super().rollout(task, jobs)

    def one(self, task, job):
        outcome = super().one(task, job)
        count = round((job.trajectory.duration + job.hold_s) * 50) + 1
        tip = ARM.forward(job.trajectory.arm[0]).apply([0, 0, 0.1])
        x, y, z = tip if job.tool.components[0].shape.size[2] < 0.105 else (3, 0, 0)
        arrays = ([x, y, z], [1, 0, 0, 0], np.zeros(3), np.zeros(3))
        states = State(
            ("block",),
            *(np.tile(np.array(a, dtype=float), (count, 1, 1)) for a in arrays),
        )
        arms, forces = (
            np.repeat(job.trajectory.arm[:1], count, axis=0),
            np.full(count, 8.0),
        )
        forces[1::2] = 2.0
        pressed = {("tool", "block"): forces} if x < 3 else {}
        film = Recording(
            np.arange(count) / 50, arms, np.zeros((count, 2)), states, pressed
        )
        return replace(outcome, recording=film if job.record_hz else None)


LOOSE = RolloutSettings(settle_s=0, hold_s=0, penetration="ignore")


def test_a_reward_may_read_a_trace_of_many_worlds():
    simulator = Filming()
    near, far = evaluated(
        candidate(0), candidate(30), task=Traced(), engine=simulator, settings=LOOSE
    )
    assert [(job.record_hz, job.forces, job.hold_s) for job in simulator.jobs] == [
        (25, True, 0.4)
    ] * 2
    # 5 N on average since the sample before.
    assert (near.status, near.reward) == ("ok", 0.75)
    assert (far.status, far.reward) == ("ok", 0.0)
    (alone,) = evaluated(candidate(30), task=Traced(), engine=simulator, settings=LOOSE)
    assert alone.reward == far.reward


def test_who_reads_no_trace_pays_nothing():
    simulator = Filming()
    evaluated(candidate(0), engine=simulator, settings=LOOSE)
    assert [(job.record_hz, job.forces, job.hold_s) for job in simulator.jobs] == [
        (0, False, 0)
    ]


def test_a_trace_needs_a_recording():
    (evaluation,) = evaluated(candidate(0), task=Traced(), settings=LOOSE)
    assert evaluation.status == "failed"
    assert evaluation.reason.startswith(
        "the reward reads a trace, and the simulator returned no recording"
    )


def test_in_a_perturbed_scene_the_reward_reads_the_trace_too():
    perturbed = replace(
        condition(Traced(), Filming(), settings=LOOSE),
        change=Perturbation(PerturbationRange(), 0),
    )
    (trial,) = play(perturbed, [candidate(0)])
    assert (trial.where.change, trial.reward) == (0, 0.75)


def test_a_tool_that_starts_inside_something_is_rejected_in_that_layout_alone():
    clear, inside = (
        play(condition(Crowded(), Faulty(), seed, SETTINGS), [candidate(0)])[0]
        for seed in range(2)
    )
    assert (clear.status, clear.layout) == ("ok", 0)
    assert (inside.status, inside.reward, inside.layout) == ("rejected", 0.0, 1)
    assert "component 'rod' starts" in inside.reason


class Shifting:
    """A change that puts the block in the tool's way."""

    number = 3

    def __call__(self, scene):
        return Crowded().scene(1)

    def perturb_tool(self, tool):
        return tool


def test_in_a_perturbed_scene_a_rejection_says_so():
    (trial,) = play(
        replace(condition(Slide(), Faulty(), settings=SETTINGS), change=Shifting()),
        [candidate(0)],
    )
    assert (trial.status, trial.where.change) == ("rejected", 3)
    assert trial.reason.startswith("in the perturbed scene, component 'rod' starts")


class Ruler:
    """Refuses the first plan of a tool, and measures what was played."""

    def refuse(self, where, tried):
        return f"not in layout {where.layout}" if tried.action == 0 else None

    def examine(self, where, tried, trial):
        return replace(trial, figures={"layout": where.layout, "plan": tried.action})


def test_an_examiner_may_refuse_a_candidate_and_adds_what_it_measured():
    examined = replace(condition(Slide(), Faulty(), 2, SETTINGS), examiner=Ruler())
    refused, measured = play(examined, [candidate(0), candidate(1)])
    assert (refused.status, refused.reason, refused.reward) == (
        "rejected",
        "not in layout 2",
        0.0,
    )
    assert (measured.status, measured.figures) == ("ok", {"layout": 2, "plan": 1})


class Confused(Slide):
    def reward(self, start, end, film):
        return 1.0


def test_a_reward_of_another_signature_names_the_task():
    with pytest.raises(
        UsageError,
        match=r"task Slide: reward\(self, start, end, film\) must be reward\(self, start",
    ):
        evaluated(candidate(0), task=Confused())


def test_a_condition_makes_its_scene_once_for_all_candidates(monkeypatch):
    build = BringCube.scene
    seeds = []

    def scene(task, seed):
        seeds.append(seed)
        return build(task, seed)

    monkeypatch.setattr(BringCube, "scene", scene)
    plan = Waypoints(np.array([[0.5, 0, 0.45, 0, 0, 0]]))
    tried = [Candidate(Tool(), plan, action=number) for number in range(2)]
    settings = replace(SETTINGS, observe=True)
    task = installed().create("task", "BringCube")
    where = condition(task, simulator("mujoco"), 5, settings)
    assert [trial.status for trial in play(where, tried)] == ["ok", "ok"]
    assert seeds == [5]
