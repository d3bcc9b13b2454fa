"""A trial that goes on from an earlier one is the trial that is played from the start, to the bit."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from core.design import Candidate, Fork, Tool
from core.interfaces import Perception, RolloutSettings, Tempo
from core.plugins import installed
from core.simulation.play import play
from plugins.actions.anchored import AnchoredActions
from plugins.conformance.sample_tools import box
from tests.support.playing import condition
from tests.support.solutions import literal

OBSERVED = RolloutSettings(observe=True)
NOISY = replace(OBSERVED, perception=Perception(position=0.01, yaw=0.05))


@cache
def engine(name):
    return installed().factory("sim", name)()


def try_both(task, sim, before, candidate, waypoint, settings=OBSERVED):
    """Play a candidate from the start, and from a waypoint of the one before."""
    where = condition(installed().create("task", task), engine(sim), settings=settings)
    (whole,) = play(where, [candidate])
    fork = Fork(before, waypoint)
    forked, again = (play(where, [replace(candidate, fork=fork)])[0] for _ in range(2))
    assert forked == again
    return whole, forked


def assert_same(whole, forked):
    """Torques are interpolated over blocks of steps, and a fork has one more; all else is equal to the bit."""
    measured = dict(forked.measured)
    begins_s = measured.pop("begins_s", 0.0)
    assert replace(forked, measured=measured, torques=whole.torques) == whole
    assert forked.torques == pytest.approx(whole.torques, abs=1e-3)
    return begins_s


def other_end(candidate):
    """A plan that ends elsewhere."""
    poses = candidate.plan.poses.copy()
    poses[-1, :3] += [0.0, 0.03, 0.0]
    return replace(candidate, plan=replace(candidate.plan, poses=poses))


SLOW = ("GatherSpheres", "OpenLatch", "LidAndBall", "PullRope")


@pytest.mark.parametrize(
    "task",
    ["BringCube", *(pytest.param(t, marks=pytest.mark.thorough) for t in SLOW)],
)
def test_the_rest_of_a_plan_goes_on_from_a_waypoint(task):
    before = literal(task)
    candidate = other_end(before)
    tempo = before.plan.tempo or Tempo.usual(len(before.plan))
    rests = np.flatnonzero(~tempo.through[:-1]) + 1
    whole, forked = try_both(task, "mujoco", before, candidate, int(rests[-1]))
    assert whole.status == "ok"
    assert 0 < assert_same(whole, forked) < whole.motion_s


@pytest.mark.parametrize("sim", ["pybullet", "sapien"])
def test_an_engine_that_can_not_go_on_plays_from_the_start(sim):
    before = literal("BringCube")
    whole, forked = try_both("BringCube", sim, before, other_end(before), 1)
    assert assert_same(whole, forked) == 0


def test_a_plan_that_begins_otherwise_is_played_from_the_start():
    before = literal("BringCube")
    poses = before.plan.poses.copy()
    poses[0, 1] += 0.01
    candidate = replace(before, plan=replace(before.plan, poses=poses))
    whole, forked = try_both("BringCube", "mujoco", before, candidate, 1)
    assert assert_same(whole, forked) == 0


def test_a_waypoint_that_is_not_there_is_played_from_the_start():
    before = literal("BringCube")
    whole, forked = try_both("BringCube", "mujoco", before, other_end(before), 9)
    assert assert_same(whole, forked) == 0


BEGIN = [
    {"offset": [0.45, 0.1, 0.5]},
    {"offset": [0.45, 0.1, 0.2], "until": "touch", "speed": 0.2},
    {"anchor": "here", "offset": [0.0, 0.0, 0.05]},
    {"look": True},
    {"anchor": "cube", "offset": [-0.35, 0.1, 0.35]},
]
STICK = (box("stick", (0.02, 0.02, 0.24), (0.0, 0.0, -0.12)),)


def feeling(*rest, begin=BEGIN):
    plan = AnchoredActions().parse([*begin, *rest], gripper=False)
    return Candidate(Tool(STICK), plan)


@pytest.mark.parametrize("waypoint", [2, 3, 4])
def test_guards_and_looks_go_on_as_if_they_had_been_there(waypoint):
    before = feeling({"anchor": "cube", "offset": [-0.2, 0.0, 0.4]})
    down = {"anchor": "cube", "offset": [-0.25, 0.1, 0.1], "until": "touch"}
    candidate = feeling(down, {"anchor": "here", "offset": [0.05, 0.0, 0.1]})
    whole, forked = try_both("BringCube", "mujoco", before, candidate, waypoint, NOISY)
    assert whole.status == "ok"
    assert assert_same(whole, forked) > 1.0


def test_a_guard_that_the_earlier_plan_had_not_is_felt_from_the_start():
    unguarded = [{**step} for step in BEGIN]
    unguarded[1] = {"offset": [0.45, 0.1, 0.3], "speed": 0.2}
    unguarded[2] = {"offset": [0.45, 0.1, 0.35]}
    guarded = [{**step} for step in unguarded]
    guarded[1]["until"] = "touch"
    before = feeling(begin=unguarded)
    whole, forked = try_both(
        "BringCube", "mujoco", before, feeling(begin=guarded), 3, NOISY
    )
    assert assert_same(whole, forked) == 0
