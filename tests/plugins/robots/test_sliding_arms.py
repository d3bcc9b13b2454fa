"""Arms of which a joint slides move in kinematics, in timing and in every engine."""

import numpy as np
import pytest

from core.design import Tool
from core.errors import UserError
from core.interfaces import JointTrajectory, Waypoints
from core.robot.kinematics import arm_of, robot_model
from core.robot.trajectory import plan_motion
from core.solids.record_rate import detours
from core.solids.self_collision import STEP, _choose_rows
from core.values.jobs import Recording
from core.values.states import State
from plugins.conformance import robots
from plugins.conformance.robots import (
    check_limits_are_there,
    check_straight_lines_are_reached,
    follow,
    hold,
)
from plugins.robots.own_arm import read_robot
from tests.support import scara
from tests.support.engines import every_simulator, simulator

pytestmark = pytest.mark.usefixtures("in_this_process")
GRAVITY = 9.81


@pytest.fixture
def read(tmp_path):
    """Read the arm, with changes."""

    def make(effort=300.0, **options):
        file = scara.write(tmp_path / "scara.urdf", effort)
        return read_robot(file, scara.HOME, "tool0", **options)

    return make


def test_its_slide_is_a_joint_like_the_others(read):
    robot = read()
    assert robot.slides == (False, False, True, False)
    assert robot.motor_inertia[2] == 0.0
    assert robot.acceleration_limits == (8.0, 10.0, 2.0, 16.0)
    check_limits_are_there(robot)
    assert "lines reached" in check_straight_lines_are_reached(robot)
    arm = arm_of(robot)
    lowered = np.add(robot.home, [0.0, 0.0, 0.2, 0.0])
    way = arm.forward(lowered).position - arm.forward(arm.home).position
    np.testing.assert_allclose(way, (0.0, 0.0, -0.2), atol=1e-9)
    solution = arm.inverse(arm.forward(lowered), arm.home)
    np.testing.assert_allclose(solution.joints, lowered, atol=1e-4)
    assert robot_model(robot, Tool()).reach > 0.45 + 0.4


def test_a_motion_keeps_the_slides_limits(read):
    robot = read()
    arm = arm_of(robot)
    home = arm.forward(arm.home)
    down = Waypoints(np.array([[*home.position[:2], home.position[2] - 0.35, 0, 0, 0]]))
    trajectory = plan_motion(down, home, arm, speed=1.0).trajectory
    times = np.arange(0.0, trajectory.duration, 0.004)
    slide = trajectory.sample(times)[0][:, 2]
    assert np.ptp(slide) == pytest.approx(0.35, abs=1e-3)
    speeds = np.diff(slide) / 0.004
    assert speeds.max() <= 1.0 + 1e-6
    # 2 m/s^2: 0.35 m from rest to rest take 2 (0.35 / 2)^(1/2) s at least.
    assert trajectory.duration >= 2 * (0.35 / 2) ** 0.5 - 1e-3


def test_a_slide_is_looked_at_as_often_as_its_way_asks(read):
    robot = read()
    ends = np.array([scara.HOME, scara.HOME])
    ends[1, 2] += 0.1
    still = np.zeros(2)
    slid = JointTrajectory(np.array([0.0, 1.0]), ends, still)
    ends = np.array([scara.HOME, scara.HOME])
    ends[1, 0] += 0.1
    turned = JointTrajectory(np.array([0.0, 1.0]), ends, still)
    assert len(_choose_rows(robot, turned)) == pytest.approx(0.1 / STEP + 2, abs=1)
    assert len(_choose_rows(robot, slid)) == pytest.approx(20 * 0.1 / STEP + 2, abs=1)


def test_between_two_looks_a_slide_strays_by_metres(read):
    """And a joint that turns by an angle, whatever is far from it."""
    robot = read()
    times = np.arange(3) / 2
    arm = np.array([scara.HOME] * 3)
    arm[1] += [0.01, 0.0, 0.02, 0.0]
    empty = np.zeros((3, 0))
    nothing = np.zeros((3, 0, 3))
    states = State((), nothing, np.zeros((3, 0, 4)), nothing, nothing)
    recording = Recording(times, arm, empty, states)
    strayed = detours(recording, np.array([0, 2]), robot.slides)
    assert strayed.moved[0, 0] == pytest.approx(0.02)
    assert strayed.turned[0, 0] == pytest.approx(0.01)


@every_simulator
def test_every_engine_follows_it(engine, read):
    assert follow(simulator(engine), read()) < 0.01


@every_simulator
@pytest.mark.parametrize(("share", "held"), [(1.05, True), (0.95, False)])
def test_its_slide_bears_what_its_force_allows(engine, read, share, held):
    """It bears itself with a little more than its weight, and sinks with a little less."""
    robot = read(effort=share * scara.QUILL_KG * GRAVITY)
    if held:
        hold(simulator(engine), robot, Tool(), "the bare arm")
        return

    with pytest.raises(AssertionError, match="sags at home"):
        hold(simulator(engine), robot, Tool(), "the bare arm")


@every_simulator
def test_what_its_motor_bears_is_its_weight(engine, read):
    robot = read()
    home = arm_of(robot).home[None]
    still = JointTrajectory(np.zeros(1), home, np.array([robot.opening_m]))
    played = robots._play(simulator(engine), robot, Tool(), still, 1.0).outcome
    weight = scara.QUILL_KG * GRAVITY
    assert played.torques[2] == pytest.approx(weight, rel=0.05)
    assert np.abs(played.torques[[0, 1, 3]]).max() < 0.5  # about the vertical


def test_a_sliding_motor_with_inertia_is_refused_by_the_engine_that_has_none(read):
    robot = read(motor_inertia=[0.1, 0.1, 1.0, 0.1])
    follow(simulator("mujoco"), robot)
    with pytest.raises(UserError, match=r"no inertia of a motor that slides, .*'j3'"):
        follow(simulator("pybullet"), robot)


def test_a_small_one_is_enlarged_in_all_its_units(read):
    small = read()
    large = read(reach=0.4)
    k = 2.0
    np.testing.assert_allclose(
        large.home, np.array(small.home) * [1, 1, k, 1], atol=1e-5
    )
    np.testing.assert_allclose(
        large.acceleration_limits, np.array(small.acceleration_limits) / [k, k, 1, k]
    )
    limits = large.description.named["j3"].limits
    assert (limits.lower, limits.upper) == pytest.approx((-0.1, 0.9))
    assert limits.effort == pytest.approx(300 * k**3)
    assert limits.velocity == pytest.approx(k**0.5)
    near = arm_of(small).forward(np.array(small.home)).position
    far = arm_of(large).forward(np.array(large.home)).position
    np.testing.assert_allclose(far, k * near, atol=1e-4)
