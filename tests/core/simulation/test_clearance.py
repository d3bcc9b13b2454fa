"""What is foreseen without physics, against what the engine makes of it."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import Candidate, Component, Tool, ToolJoint
from core.geometry import Box, Pose
from core.interfaces import Outcome, Rollout, RolloutSettings, Waypoints
from core.plugins import installed
from core.robot.trajectory import at_home
from core.simulation.clearance import find_idle
from core.simulation.rollout import Evaluator, PluginPart

QUICK = RolloutSettings(settle_s=0.1, hold_s=0.1)
USUAL = Evaluator(PluginPart("task", "BringCube"), PluginPart("sim", "mujoco"), 0, QUICK)
FORESEEING = replace(USUAL, clearance=0.05)
STICK = Tool((Component("stick", "tool_mount", Pose(np.array([0.0, 0.0, -0.1])), Box((0.02, 0.02, 0.2)), 0.005),))

BAR = Tool((Component("bar", "tool_mount", Pose(np.array([0.2, 0.0, 0.0])), Box((0.4, 0.02, 0.02)), 0.005),))


def to(x, y, z, tool=STICK):
    return Candidate(tool, Waypoints(np.array([[x, y, z, 0.0, 0.0, 0.0]])))


def test_a_motion_far_from_all_that_moves_is_not_simulated_and_earns_the_same():
    far, near = to(0.5, 0.1, 0.45), to(0.55, 0.0, 0.12, BAR)  # whose end is 4 cm above the cube's edge
    in_table = to(0.5, 0.1, 0.05)  # which pushes the arm off its way
    found, usual = FORESEEING([far, near, in_table]), USUAL([far, near, in_table])
    assert [e.unneeded == 1 and e.saved_s > 0 for e in found] == [True, False, False]
    for one, other in zip(found, usual, strict=True):
        assert (one.status, one.reward, one.distance_m) == (other.status, other.reward, other.distance_m)
    assert found[0].warnings[-1] == "not simulated: it keeps 0.05 m or more from all that can move"
    assert max(usual[0].moved_m.values()) < 1e-4
    assert [e.warnings for e in found[1:]] == [e.warnings for e in usual[1:]]


def test_a_larger_clearance_foresees_less():
    cube = installed().create("task", "BringCube").scene(0)["cube"].pose.position
    beside = to(*np.add(cube, (-0.2, 0.0, 0.3)))
    saved = [replace(USUAL, clearance=margin)([beside])[0].unneeded == 1 for margin in (0.02, 0.5)]
    assert saved == [True, False]


def test_it_is_observed_like_others():
    settings = replace(QUICK, observe=True)
    found, usual = (replace(of, settings=settings)([to(0.5, 0.1, 0.45)])[0] for of in (FORESEEING, USUAL))
    one, other = found.observation, usual.observation
    assert found.unneeded == 1
    assert (one.result, one.left, one.moved) == (other.result, other.left, other.moved)
    assert one.clearances == pytest.approx(other.clearances, abs=0.02)


def test_where_a_tools_joints_go_is_not_foreseen():
    hinge = ToolJoint("hinge", (1.0, 0.0, 0.0), -1.0, 1.0)
    loose = Component("flap", "stick", Pose(np.array([0.0, 0.0, -0.12])), Box((0.02, 0.02, 0.03)), 0.005, joint=hinge)
    (found,) = FORESEEING([to(0.5, 0.1, 0.45, Tool((*STICK.components, loose)))])
    assert found.unneeded == 0


@pytest.mark.parametrize("name", ["StopCart", "PourGrains"])
def test_nothing_is_foreseen_where_bodies_move_or_a_reward_reads_a_trace(name):
    assert find_idle(installed().create("task", name), installed().create("sim", "mujoco"), 0, QUICK) is None


class Engine:
    """Plays nothing: gives the same end to each job."""

    def __init__(self, by=0.0, error=None):
        self.by, self.error = by, error

    def rollout(self, task, jobs):
        start = task.scene(jobs[0].seed).state()
        end = replace(start, positions=start.positions + self.by)
        return [Outcome(None, None, error=self.error) if self.error else Outcome(start, end) for _ in jobs]


def test_nothing_is_foreseen_where_bodies_do_not_rest_or_the_reward_is_not_0():
    task = installed().create("task", "BringCube")
    assert find_idle(task, Engine(), 0, QUICK) is not None
    assert find_idle(task, Engine(by=0.01), 0, QUICK) is None
    assert find_idle(task, Engine(error="it broke"), 0, QUICK) is None
    task.reward = lambda start, end: np.full(start.positions.shape[:-2], 0.1)
    assert find_idle(task, Engine(), 0, QUICK) is None


def test_the_arm_at_home_is_foreseen():
    task = installed().create("task", "BringCube")
    idle = find_idle(task, Engine(), 0, QUICK)
    job = Rollout(Tool(), at_home(task), 0, 0.1, 0.1)
    assert idle is not None
    assert idle.foresee(task.robot, job, 0.05) is idle.outcome
    assert len(idle.film(task.robot, job).times) == 1
