"""Plans that feel and look, carried out move by move as they are exported."""

from types import SimpleNamespace

import numpy as np
import pytest

from core.design import Candidate
from core.interfaces import Perception, RolloutSettings
from core.simulation.attempt import prepare
from plugins.actions.anchored import AnchoredActions
from plugins.results.workshop import policy
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.policy import ExportedPlan
from plugins.results.workshop.replay import play_motion
from tests.support.engines import every_simulator, simulator
from tests.support.guarded_blocks import ABOVE, DOWN, TOOL, UP, Block
from tests.support.playing import Made, condition
from tests.support.seen_cubes import HIGH, LOOK, OVER, Cubes

LOOP = {"repeat": [LOOK, OVER], "until_seen": {"goal": 0}, "at_most": 2}


def candidate(*steps):
    plan = AnchoredActions().parse(list(steps), gripper=False)
    return Candidate(TOOL, plan, 0, 0, 0, 0)


def carry_out(task, *steps, engine="mujoco", speed=1.0, **settings):
    """Carry a plan out move by move, and return what came of it."""
    settings = RolloutSettings(**settings)
    plan = ExportedPlan(Made(task), candidate(*steps), 0, settings, 100.0, speed)
    where = condition(task, simulator(engine), settings=settings)
    replay = play_motion(where, task.scene(0), TOOL, plan)
    return SimpleNamespace(replay=replay, reactions=replay.reactions)


def search(task, *steps, engine="mujoco", **settings):
    """Play a plan as a search does, and return what it felt and saw."""
    settings = RolloutSettings(**settings)
    _, job = prepare(task, candidate(*steps), 0, settings)
    (outcome,) = simulator(engine).rollout(task, [job])
    return SimpleNamespace(outcome=outcome, reactions=job.reactions)


@every_simulator
def test_a_guard_ends_a_move_where_it_ended_the_way_in_the_search(engine):
    exported = carry_out(Block(), ABOVE, DOWN, UP, engine=engine)
    searched = search(Block(), ABOVE, DOWN, UP, engine=engine)
    (felt,) = exported.reactions.felt
    (was,) = searched.reactions.felt
    assert (felt.waypoint, felt.fired) == (was.waypoint, was.fired) == (2, "touch")
    plan = exported.reactions.motion.plan
    np.testing.assert_allclose(plan, searched.reactions.motion.plan, atol=0.002)
    assert exported.reactions.problem is None


def test_looks_and_rounds_are_those_of_the_search():
    noise = {"perception": Perception(position=0.01)}
    exported = carry_out(Cubes(), HIGH, LOOP, LOOK, **noise)
    searched = search(Cubes(), HIGH, LOOP, LOOK, **noise)
    assert len(exported.reactions.looked) == len(searched.reactions.looked) == 3
    for seen, was in zip(
        exported.reactions.looked, searched.reactions.looked, strict=True
    ):
        assert (seen.waypoint, seen.where, seen.left) == (
            was.waypoint,
            was.where,
            was.left,
        )
    plan = exported.reactions.motion.plan
    np.testing.assert_allclose(plan, searched.reactions.motion.plan, atol=1e-6)


def play_unsmoothed(trajectory, arm, rate_hz, speed):
    still = np.zeros_like(trajectory.arm)
    return Sampled(trajectory.times, trajectory.arm, still, still, trajectory.fingers)


def test_along_the_planned_path_it_is_equal_to_the_search(monkeypatch):
    monkeypatch.setattr(policy, "sample", play_unsmoothed)
    monkeypatch.setattr(policy, "STEP_S", 0.0)
    noise = {"perception": Perception(position=0.01)}
    exported = carry_out(Cubes(), HIGH, LOOP, LOOK, **noise).reactions
    searched = search(Cubes(), HIGH, LOOP, LOOK, **noise).reactions
    assert exported.looked == searched.looked
    trajectory = exported.motion.trajectory
    np.testing.assert_array_equal(trajectory.arm, searched.motion.trajectory.arm)
    np.testing.assert_array_equal(trajectory.times, searched.motion.trajectory.times)


def test_a_guard_that_never_fires_ends_the_plan_or_goes_on():
    near = {"anchor": "block", "offset": [0, 0, 0.28], "until": "touch"}
    on = carry_out(Block(), ABOVE, near, UP)
    assert [felt.fired for felt in on.reactions.felt] == [""]
    assert len(on.reactions.motion.plan) == 3
    ended = carry_out(Block(), ABOVE, near | {"otherwise": "end"}, UP)
    assert len(ended.reactions.motion.plan) == 2


def test_a_wait_begins_where_the_guard_ended_the_move():
    played = carry_out(Block(), ABOVE, DOWN | {"wait": 0.5}, UP)
    (felt,) = played.reactions.felt
    taken = played.replay.recording
    waiting = (taken.times > felt.at_s + 0.2) & (taken.times < felt.at_s + 0.5)
    assert np.ptp(taken.arm[waiting], axis=0).max() < 1e-3


def test_moves_are_slower_where_that_is_asked_for():
    usual = carry_out(Cubes(), HIGH, LOOK, OVER).reactions.motion.trajectory
    slow = carry_out(Cubes(), HIGH, LOOK, OVER, speed=0.5).reactions.motion.trajectory
    assert slow.duration - 0.5 == pytest.approx(2 * (usual.duration - 0.5), rel=0.01)


def test_what_can_t_be_planned_on_is_said():
    steps = [HIGH, LOOK, {"offset": [0.4, 0, 0.5], "wait": 30}]
    played = carry_out(Cubes(), *steps, max_motion_s=20.0)
    assert played.reactions.problem.startswith("after waypoint 1: ")
    assert len(played.reactions.motion.plan) == 1
