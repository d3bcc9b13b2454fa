from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.interfaces import RolloutSettings, Tempo, Waypoints
from core.robot.kinematics import arm_of
from core.robot.trajectory import plan_task_motion
from tasks.bring_cube import BringCube
from tests.support.panda import PANDA, on_panda

ARM = arm_of(PANDA)
TASK = on_panda(BringCube())
LINE = np.array([[0.5, y, 0.4, 0.0, 0.0, 0.0] for y in (-0.3, 0.0, 0.3)])


def tempo(count=3, **given):
    return replace(
        Tempo.usual(count), **{name: np.array(values) for name, values in given.items()}
    )


def motion_of(plan=LINE, **given):
    return plan_task_motion(
        Waypoints(plan, tempo(len(plan), **given)), TASK, RolloutSettings()
    )


def speeds(motion):
    """The end-effector's speed between samples, and the middle of each interval."""
    times, places = motion.trajectory.times, ARM.positions(motion.trajectory.arm)
    return np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times), (
        times[1:] + times[:-1]
    ) / 2


def between(motion, k):
    speed, at = speeds(motion)
    return speed[(at > motion.arrivals[k - 1]) & (at < motion.arrivals[k])]


def assert_within_limits(motion):
    times, arm = motion.trajectory.times, motion.trajectory.arm
    rates = np.diff(arm, axis=0) / np.diff(times)[:, None]
    assert (np.abs(rates) <= 1.001 * ARM.velocity_limits).all()
    assert (np.diff(times) > 0).all()


def test_the_usual_tempo_changes_nothing():
    usual, none = (
        motion_of(),
        plan_task_motion(Waypoints(LINE), TASK, RolloutSettings()),
    )
    np.testing.assert_allclose(usual.trajectory.arm, none.trajectory.arm, atol=1e-5)
    np.testing.assert_allclose(usual.trajectory.times, none.trajectory.times, atol=1e-5)


@pytest.mark.parametrize("through", [[False] * 3, [True, True, False]])
@pytest.mark.parametrize("seconds", [2.0, 3.5])
def test_seconds_are_kept_where_the_arm_can(through, seconds):
    motion = motion_of(seconds=[seconds] * 3, through=through)
    np.testing.assert_allclose(
        np.diff(motion.arrivals, prepend=0.0), seconds, atol=0.03
    )
    np.testing.assert_allclose(motion.slowed, 1.0, atol=0.02)
    assert_within_limits(motion)


def test_a_speed_is_reached_and_held_through_a_waypoint():
    motion = motion_of(speeds=[np.nan, 0.5, 0.5], through=[False, True, False])
    assert between(motion, 1).max() == pytest.approx(0.5, rel=0.03)
    speed, at = speeds(motion)
    assert speed[np.abs(at - motion.arrivals[1]).argmin()] == pytest.approx(
        0.5, rel=0.03
    )
    usual = motion_of()
    speed, at = speeds(usual)
    assert speed[np.abs(at - usual.arrivals[1]).argmin()] < 0.1  # it stops there
    assert motion.slowed[1] == pytest.approx(1.0, abs=0.03)
    assert_within_limits(motion)


def test_what_the_limits_do_not_allow_is_slowed_and_reported():
    motion = motion_of(speeds=[np.nan, 9.0, np.nan], seconds=[np.nan, np.nan, 0.01])
    assert motion.slowed[0] == 1.0
    assert motion.slowed[1] > 2.0
    assert motion.slowed[2] > 2.0
    assert_within_limits(motion)


@pytest.mark.parametrize("away", [0.0, 1e-6, 3e-6, 1e-5, 1e-4])
def test_a_way_of_next_to_nothing_has_a_time(away):
    motion = motion_of(
        np.array([LINE[0], LINE[0] + [away, 0, 0, 0, 0, 0], LINE[1]]),
        speeds=[0.1, 0.01, 0.1],
    )
    assert np.isfinite(motion.arrivals).all()
    assert_within_limits(motion)


def test_it_waits_where_it_is_told_to():
    motion = motion_of(waits=[0.0, 1.5, 0.25])
    usual = motion_of()
    np.testing.assert_allclose(
        motion.arrivals - usual.arrivals, [0.0, 0.0, 1.5], atol=1e-9
    )
    assert motion.trajectory.duration == pytest.approx(usual.trajectory.duration + 1.75)
    during = motion.trajectory.sample(motion.arrivals[1] + np.linspace(0, 1.5, 5))[0]
    np.testing.assert_allclose(during, during[:1].repeat(5, axis=0), atol=1e-12)


def test_the_fingers_close_on_their_own_leg_of_a_motion_without_stops():
    plan = np.column_stack([LINE, [0.0, 1.0, 0.0]])
    motion = motion_of(plan, through=[True, True, False])
    opening = PANDA.opening_m
    for grip, arrival in zip((0.0, 1.0, 0.0), motion.arrivals, strict=True):
        finger = motion.trajectory.sample(np.array([arrival]))[1][0]
        assert finger == pytest.approx(opening * (1 - grip), abs=0.03 * opening)


def test_waypoints_passed_through_lie_on_a_smooth_curve():
    """A swing about the base: fast on the arc, and slow if it had to stop at each waypoint."""
    turns = np.radians(np.linspace(-70, 70, 9))
    arc = np.array(
        [[0.6 * np.cos(turn), 0.6 * np.sin(turn), 0.4, 0, 0, turn] for turn in turns]
    )
    fast = [False, *[True] * 7, False]
    swing, stopping = (
        motion_of(arc, through=fast, speeds=[np.nan, *[5.0] * 8]),
        motion_of(arc),
    )
    after = swing.trajectory.times > swing.arrivals[0]
    places = ARM.positions(swing.trajectory.arm)[after]
    np.testing.assert_allclose(np.hypot(places[:, 0], places[:, 1]), 0.6, atol=0.001)
    np.testing.assert_allclose(places[:, 2], 0.4, atol=0.001)
    assert between(swing, 4).max() > 2.0
    assert max(between(stopping, k).max() for k in range(1, 9)) < 0.6
    assert_within_limits(swing)


@given(
    seconds=st.lists(
        st.one_of(st.just(np.nan), st.floats(0.01, 5)), min_size=3, max_size=3
    ),
    speed=st.lists(
        st.one_of(st.just(np.nan), st.floats(0.01, 5)), min_size=3, max_size=3
    ),
    through=st.lists(st.booleans(), min_size=3, max_size=3),
)
def test_any_tempo_keeps_the_limits(seconds, speed, through):
    motion = motion_of(
        seconds=seconds, speeds=speed, through=[*through[:2], through[2]]
    )
    assert_within_limits(motion)
    assert np.isfinite(motion.trajectory.arm).all()
    assert (np.diff(motion.arrivals) > 0).all()
    assert (motion.slowed >= 1).all()


def test_what_is_level_stays_level_before_a_waypoint_that_dips():
    """A long stroke, passed through into a short dip: a blade must not leave the board on its way."""
    stroke = np.array(
        [
            [0.65, 0.0, 0.4, 0, 0, 0.0],
            [0.35, 0.0, 0.4, 0, 0, 0.0],
            [0.34, 0.0, 0.386, 0, 0, 0.3],
        ]
    )
    motion = motion_of(stroke, through=[False, True, False])
    times = motion.trajectory.times
    stroking = (times > motion.arrivals[0]) & (times < motion.arrivals[1])
    joints = motion.trajectory.arm[stroking]
    assert len(joints) > 10
    np.testing.assert_allclose(ARM.positions(joints)[:, 2], 0.4, atol=0.0005)
    turns = [ARM.forward(row).matrix[1, 0] for row in joints]
    np.testing.assert_allclose(turns, 0, atol=0.003)
