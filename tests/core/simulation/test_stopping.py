"""Rollouts that end once their task is solved, in every engine."""

from dataclasses import replace

import numpy as np
import pytest

from core.interfaces import RolloutSettings
from core.plugins import installed
from core.simulation.attempt import prepare
from core.simulation.stopping import can_stop
from core.values.plans import Waypoints
from tests.support.engines import simulator
from tests.support.solutions import literal

SETTINGS = RolloutSettings(hold_s=3.0, penetration="ignore")


def retreating(rise_m):
    """Return the solution of BringCube, whose tool is lifted by so much at the end."""
    solution = literal("BringCube")
    poses = solution.plan.poses
    away = poses[-1].copy()
    away[2] += rise_m
    return replace(solution, plan=Waypoints(np.vstack([poses, away])))


def play(engine, candidate, stop_s, record_hz=0.0):
    task = installed().create("task", "BringCube")
    settings = replace(SETTINGS, stop_s=stop_s)
    _, job = prepare(task, candidate, 0, settings, record_hz)
    (outcome,) = simulator(engine).rollout(task, [job])
    assert outcome.error is None
    scene = job.scene
    reward = task.reward(scene.complete(outcome.start), scene.complete(outcome.end))
    return float(reward), outcome, job.trajectory.duration + job.hold_s


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_a_rollout_ends_once_all_has_been_solved_at_rest_and_away(engine):
    kept, whole, seconds = play(engine, retreating(0.2), 0.0)
    earned, outcome, _ = play(engine, retreating(0.2), 1.0, record_hz=50)
    assert whole.stopped_s is None
    assert kept >= 0.95
    assert earned == pytest.approx(kept, abs=0.001)
    assert 1.0 < outcome.stopped_s < seconds - 0.5
    assert outcome.recording.times[-1] == pytest.approx(outcome.stopped_s, abs=0.01)
    # The time without a change is the one that was asked for: half a second less, half a second earlier.
    _, earlier, _ = play(engine, retreating(0.2), 0.5)
    assert outcome.stopped_s - earlier.stopped_s == pytest.approx(0.5, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_a_tool_that_stays_near_a_body_does_not_end_it(engine):
    reward, outcome, _ = play(engine, retreating(0.0), 1.0)
    assert reward >= 0.95
    assert outcome.stopped_s is None


def test_what_is_not_solved_plays_to_its_end():
    candidate = retreating(0.2)
    early = replace(candidate, plan=Waypoints(candidate.plan.poses[[0, -1]]))
    reward, outcome, _ = play("mujoco", early, 0.25)
    assert reward < 0.95
    assert outcome.stopped_s is None


def test_tasks_whose_reward_reads_what_happened_play_to_their_end():
    task = installed().create("task", "LidAndBall")
    assert task.reads_trace
    assert not can_stop(task, task.scene(0))
    assert can_stop(
        installed().create("task", "BringCube"),
        installed().create("task", "BringCube").scene(0),
    )
