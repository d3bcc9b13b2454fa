"""A job in a world that follows its targets exactly; every engine is played in `tests/plugins/simulators`."""

import numpy as np
import pytest

from core.design import Tool
from core.interfaces import JointTrajectory, Rollout, World
from core.scene import State
from core.simulation.playback import Schedule, play

DT = 0.01


class Exact(World):
    """Reach each target at once, but ``lag`` radians behind; one body moves 1 mm with each step."""

    time_step = DT

    def __init__(self, lag=0.0):
        self.lag = lag
        self.taken = []

    def step(self, order):
        self.taken.append(order)

    def joints(self):
        arm = np.array(self.taken[-1][0]) if self.taken else np.zeros(7)
        return arm - self.lag, np.zeros(2)

    def state(self):
        position = np.array([[0.001 * len(self.taken), 0.0, 0.0]])
        return State(
            ("cube",),
            position,
            np.array([[1.0, 0.0, 0.0, 0.0]]),
            np.zeros((1, 3)),
            np.zeros((1, 3)),
        )


def job(**settings):
    arm = np.outer([0.0, 0.5], np.ones(7))
    trajectory = JointTrajectory(np.array([0.0, 0.5]), arm, np.array([0.04, 0.0]))
    return Rollout(Tool(), trajectory, settle_s=0.1, hold_s=0.2, **settings)


def test_it_settles_moves_and_holds():
    schedule = Schedule(job(), DT)
    times = schedule.instants[:-1]
    assert schedule.settle == 10
    assert schedule.count == 80
    np.testing.assert_allclose(times[[0, 10, -1]], [-0.1, 0.0, 0.69])
    world = Exact()
    outcome = play(world, job())
    assert len(world.taken) == len(times) == 80
    assert outcome.start.position("cube")[0] == pytest.approx(0.010)
    assert outcome.end.position("cube")[0] == pytest.approx(0.080)
    assert outcome.error is None
    assert outcome.recording is None


def test_targets_are_those_at_the_end_of_a_step_with_the_speeds_that_lead_there():
    block = Schedule(job(), DT).block(0, 80)
    arm, fingers = block.arm[1:], block.fingers[1:]
    speeds, finger_speeds = block.speeds, block.finger_speeds
    moving, still = slice(10, 60), np.r_[0:10, 60:80]
    np.testing.assert_allclose(arm[moving, 0], 0.01 * np.arange(1, 51))
    np.testing.assert_allclose(speeds[moving], 1.0)
    np.testing.assert_allclose(finger_speeds[moving], -0.08)
    assert not speeds[still].any()
    assert fingers[-1] == 0


class Straining(Exact):
    """Its motors apply as many newton metres as steps are done."""

    tells_torques = True

    def note_torques(self):
        return np.full(7, -len(self.taken), dtype=float)


def test_the_greatest_torques_are_those_of_the_steps_of_the_motion():
    assert play(Straining(), job()).torques.tolist() == [80.0] * 7
    assert play(Exact(), job()).torques is None


class Rewinding(Straining):
    """Goes back to how often it was stepped."""

    rewinds = True

    def save(self):
        return list(self.taken)

    def restore(self, saved):
        self.taken = list(saved)

    def pushes(self):
        return np.zeros((0, 3)), np.zeros((0, 3))


class Stops:
    """A guard that ends the motion at its third reading."""

    since = 0.095
    looks_at = np.inf
    felt = ()
    looked = ()

    def begin(self):
        self.readings = []
        return job().trajectory

    def feel(self, time, arm, points, forces):
        self.readings.append((time, arm[0]))
        if len(self.readings) != 3:
            return None

        self.since = np.inf
        arm = np.tile(arm, (2, 1))
        return JointTrajectory(np.array([0.0, time]), arm, np.zeros(2))


@pytest.mark.parametrize("world", [Straining, Rewinding])
def test_what_was_played_ahead_of_a_guard_did_not_happen(world):
    """Steps after the reading at which it ends are taken back, with their torques and notes."""

    class Feeling(world):
        pushes = Rewinding.pushes

    made = Feeling()
    guards = Stops()
    outcome = play(made, job(reactions=guards, record_hz=25))
    assert [time for time, _ in guards.readings] == pytest.approx([0.1, 0.11, 0.12])
    # 0.1 s of settling, 0.12 s of the motion, 0.2 s of holding.
    assert len(made.taken) == 42
    assert outcome.torques.tolist() == [40.0] * 7  # each tenth step is measured
    assert outcome.recording.times[-1] == pytest.approx(0.32)
    np.testing.assert_allclose(outcome.recording.arm[-1], guards.readings[-1][1])


def test_the_largest_lag_is_reported():
    assert play(Exact(lag=0.03), job()).tracking_error_rad == pytest.approx(0.03)


def test_a_recording_has_its_rate_and_both_ends():
    outcome = play(Exact(), job(record_hz=25))
    assert Schedule(job(record_hz=25), DT).samples.tolist() == [*range(0, 80, 4), 80]
    assert not Schedule(job(), DT).samples.size
    times = outcome.recording.times
    assert (times[0], times[-1]) == (pytest.approx(-0.1), pytest.approx(0.7))
    np.testing.assert_allclose(np.diff(times), 0.04)
    assert (
        outcome.recording.states.position("cube")[-1, 0]
        == outcome.end.position("cube")[0]
    )


def test_what_is_not_finite_is_an_error():
    broken = job()
    broken.trajectory.arm[1, 3] = np.nan
    assert play(Exact(), broken).error == "the trajectory's targets are not finite"

    class Explodes(Exact):
        def state(self):
            state = super().state()
            return State(state.names, state.positions + np.inf, *vars_of(state))

    def vars_of(state):
        return state.quaternions, state.linear_velocities, state.angular_velocities

    assert (
        play(Explodes(), job()).error
        == "the simulation blew up: a body's state is not finite"
    )
