"""Plans that feel, from their text to the motion that was played; each engine's are checked by conformance."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from core.design import Candidate, DesignError, Tool
from core.geometry import Box
from core.interfaces import Feel, Guard, Perception, RolloutSettings, Waypoints
from core.robot.trajectory import plan_task_motion
from core.simulation.attempt import Stage, plan_attempt, prepare
from core.solids.record_rate import MAX_HZ
from core.solids.tracks import SAMPLE_HZ
from plugins.actions.anchored import AnchoredActions
from plugins.conformance.worlds import HOME, arm
from tests.support.engines import every_simulator, simulator
from tests.support.faults import Faulty
from tests.support.guarded_blocks import ABOVE, DOWN, TOOL, TOP, UP, Block
from tests.support.playing import condition, evaluate_batch


def candidate(*steps):
    return Candidate(
        TOOL, AnchoredActions().parse(list(steps), gripper=False), 0, 0, 0, 0
    )


def play(*steps, engine="mujoco", seed=0, **settings):
    """Play a plan: the outcome, its guards, and the motion that was planned."""
    task = Block()
    motion, job = prepare(
        task, candidate(*steps), seed, RolloutSettings(**settings), record_hz=100.0
    )
    (outcome,) = simulator(engine).rollout(task, [job])
    assert outcome.error is None
    return SimpleNamespace(
        outcome=outcome, reactions=job.reactions, motion=motion, job=job, task=task
    )


def mount(played):
    return arm().positions(played.outcome.recording.arm[-1:])[0]


@every_simulator
def test_what_follows_a_touch_begins_where_the_block_is_however_wrong_its_height_was(
    engine,
):
    ends = []
    for seed in (0, 1):
        played = play(
            ABOVE,
            DOWN,
            UP,
            engine=engine,
            seed=seed,
            perception=Perception(height=0.008),
        )
        assert [felt.fired for felt in played.outcome.felt] == ["touch"]
        ends.append(mount(played)[2])
    np.testing.assert_allclose(ends, TOP + 0.2 + 0.05, atol=0.002)
    blind = [ABOVE, {"anchor": "block", "offset": [0, 0, 0.25]}]
    task, settings = Block(), RolloutSettings(perception=Perception(height=0.008))
    missed = [
        prepare(task, candidate(*blind), seed, settings)[0].plan[-1, 2] - TOP - 0.2
        for seed in (0, 1)
    ]
    assert max(map(abs, missed)) > 0.003  # the error that the touch removed


@every_simulator
def test_a_motion_is_the_same_each_time_that_it_is_played(engine):
    played = play(ABOVE, DOWN, UP, engine=engine)
    (again,) = simulator(engine).rollout(played.task, [played.job])
    assert again.felt == played.outcome.felt
    np.testing.assert_array_equal(again.recording.arm, played.outcome.recording.arm)


def test_arrivals_and_distance_are_those_of_what_was_played():
    played = play(ABOVE, DOWN, UP)
    motion, planned = played.reactions.motion, played.motion
    assert motion.arrivals[0] == planned.arrivals[0]
    assert (motion.arrivals[1:] < planned.arrivals[1:]).all()
    assert motion.trajectory.duration == motion.arrivals[-1]
    steps = (
        np.abs(np.diff(motion.trajectory.arm, axis=0))
        / np.diff(motion.trajectory.times)[:, None]
    )
    assert (steps <= arm().velocity_limits * 1.001).all()
    assert motion.distance_m < planned.distance_m
    assert motion.plan[2, 2] == pytest.approx(TOP + 0.2 + 0.05, abs=0.002)


def test_a_wait_begins_at_the_touch():
    played = play(ABOVE, DOWN | {"wait": 0.5}, UP)
    (felt,) = played.outcome.felt
    waiting = (played.outcome.recording.times > felt.at_s + 0.2) & (
        played.outcome.recording.times < felt.at_s + 0.5
    )
    assert np.ptp(played.outcome.recording.arm[waiting], axis=0).max() < 1e-3


def test_stall_is_a_joint_that_is_held_back():
    (felt,) = play(ABOVE, DOWN | {"until": "stall"}).outcome.felt
    assert felt.fired == "stall"
    assert play(ABOVE, DOWN).outcome.felt[0].at_s < felt.at_s


def test_noise_above_the_threshold_is_taken_for_a_touch_and_below_it_is_not():
    far = [ABOVE, ABOVE | {"offset": [0, 0, 0.26], "until": "touch", "speed": 0.05}]
    assert play(*far, feel=Feel(noise=0.05)).outcome.felt[0].fired == ""
    assert play(*far, feel=Feel(noise=2.0)).outcome.felt[0].fired == "touch"


def test_the_evaluation_is_of_the_motion_as_it_was_played():
    settings = RolloutSettings(observe=True)
    plan = candidate(ABOVE, DOWN, UP)
    (evaluation,) = evaluate_batch(
        Block(), simulator("mujoco"), [plan], settings=settings
    )
    played = play(ABOVE, DOWN, UP)
    assert evaluation.distance_m == pytest.approx(
        played.reactions.motion.distance_m, abs=1e-3
    )
    assert evaluation.observation.felt[0].startswith("waypoint 2: touch at ")
    assert len(evaluation.observation.arrivals) == 3


def test_an_engine_that_plays_no_guards_says_so():
    (evaluation,) = evaluate_batch(Block(), Faulty(), [candidate(ABOVE, DOWN)])
    assert evaluation.status == "rejected"
    assert "Faulty does not support guards ('until') in a plan" in evaluation.reason


def test_guards_need_a_plan_that_makes_what_feels():
    literal = Waypoints(np.array([[0.5, 0, 0.45, 0, 0, 0]]), guards=(Guard("touch"),))
    with pytest.raises(DesignError, match=r"make_reactions raised .* nothing feels"):
        prepare(Block(), Candidate(TOOL, literal), 0, RolloutSettings())


def test_what_would_take_too_long_after_a_guard_ends_the_motion_there():
    """The block is 0.1 m higher than the plan takes it to be: a way of nothing becomes one of 25 s."""
    far = {"anchor": "block", "offset": [0, 0, 0.2], "speed": 0.004}
    played = play(ABOVE, DEEP, HERE, far, max_motion_s=20)
    assert "at most 20 s" in played.reactions.problem
    assert len(played.reactions.motion.arrivals) == 2
    assert played.outcome.recording.times[-1] < 10


DEEP = DOWN | {"offset": [0, 0, 0.1]}  # it expects the block 0.1 m lower
HERE = {"anchor": "here", "offset": [0, 0, 0.1], "speed": 0.05}
STROKES = [{"anchor": "block", "offset": [0, 0, 0.2], "speed": 1.0}, HERE] * 10


def test_what_would_be_too_much_work_after_a_guard_ends_the_motion_there(monkeypatch):
    """Strokes of nothing become strokes of 0.1 m, and the work of looking at them that of another plan."""
    monkeypatch.setattr("core.designs.plan_rules.MAX_POSES", 5000)
    task = Block()
    thin = Tool((replace(TOOL.components[0], shape=Box((0.02, 0.001, 0.2))),))
    striking = replace(
        candidate(ABOVE | {"speed": 0.05}, DEEP, HERE, *STROKES), tool=thin
    )
    stage = Stage(condition(task, simulator("mujoco")))
    attempt = plan_attempt(stage, striking)
    simulator("mujoco").rollout(task, [attempt.job])
    assert "1 parts would be looked at" in attempt.job.reactions.problem
    assert len(attempt.job.reactions.motion.arrivals) == 2


def test_what_guards_may_change_is_looked_at_in_each_step():
    stage = Stage(condition(Block(), simulator("mujoco")))
    assert plan_attempt(stage, candidate(ABOVE)).job.record_hz == SAMPLE_HZ
    assert plan_attempt(stage, candidate(ABOVE, DOWN)).job.record_hz == MAX_HZ


@every_simulator
@pytest.mark.parametrize(
    "way", [{"speed": 0.05}, {"offset": [0.1, 0, 0.05], "seconds": 0.001}]
)
def test_the_rest_follows_without_a_pause_where_a_guard_before_it_never_fires(
    engine, way, monkeypatch
):
    planned = []
    plan = "core.simulation.attempt.plan_task_motion"
    monkeypatch.setattr(
        plan,
        lambda points, *args: (
            planned.append(len(points)) or plan_task_motion(points, *args)
        ),
    )
    aside, up = UP | {"offset": [0.1, 0, 0.05]}, UP | {"offset": [0, 0, 0.08]}
    played = play(
        ABOVE,
        DOWN,
        UP,
        aside | {"until": "touch"} | way,
        up,
        aside,
        engine=engine,
        hold_s=0.5,
    )
    assert [felt.fired for felt in played.outcome.felt] == ["touch", ""]
    assert planned == [2, 2]  # each way once
    motion = played.reactions.motion
    assert len(motion.arrivals) == len(motion.misses) == len(motion.plan) == 6
    assert motion.trajectory.duration == motion.arrivals[-1]
    np.testing.assert_allclose(mount(played), motion.plan[-1, :3], atol=0.005)
    assert played.outcome.felt[1].at_s == pytest.approx(motion.arrivals[3], abs=0.02)


def test_nothing_is_felt_for_without_guards_and_after_the_last():
    assert prepare(Block(), candidate(ABOVE), 0, RolloutSettings())[1].reactions is None
    assert play(ABOVE, DOWN, UP).reactions.since == math.inf


def test_the_force_is_that_on_the_tool_less_what_was_felt_when_the_way_began():
    played = play(ABOVE, DOWN, feel=Feel(noise=0.0))
    guards, begin = played.reactions, played.motion.arrivals[0]
    joints, _ = guards.begin().sample(np.array([begin]))
    points, held, more = (
        HOME.position - [[0.0, 0.0, 0.2]],
        np.array([[0.0, 0.0, -9.0]]),
        np.array([[3.0, 0.0, 4.0]]),
    )
    readings = [
        guards.feel(begin + 0.01 * k, joints[0], points, held + more * (k > 1))
        for k in range(4)
    ]
    # Of three the middle one counts.
    assert [reading is None for reading in readings] == [True, True, True, False]
    assert guards.felt[0].force_n == pytest.approx(5.0, abs=0.01)


def test_mujoco_feels_the_same_however_many_readings_it_plays_in_a_row(monkeypatch):
    four = play(ABOVE, DOWN, UP).outcome
    monkeypatch.setattr("core.simulation.playback._AHEAD", 1)
    one = play(ABOVE, DOWN, UP).outcome
    assert one.felt == four.felt
    np.testing.assert_array_equal(one.recording.arm, four.recording.arm)
