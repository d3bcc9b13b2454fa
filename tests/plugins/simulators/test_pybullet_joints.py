"""Test what PyBullet alone does with joints between bodies. What every engine must do is in plugins.conformance."""

from dataclasses import replace

import numpy as np
import pytest

from core.errors import UsageError
from core.geometry import Box
from core.interfaces import Rollout
from core.plugins import installed
from core.scene import Body, Drive, Joint, Latch, Scene, table
from plugins.conformance.worlds import BARE, FAR, GRAVITY, GREY, Bodies, cube, film, motion, move, stick, still
from tests.plugins.simulators.test_pybullet import PLAN, THINGS, bits, hammer

pytest.importorskip("pybullet")


@pytest.fixture(scope="module")
def sim():
    return installed().create("sim", "pybullet")


def play(sim, bodies, joints=(), seconds=1.0, **more):
    """A recording of the arm that waits, or moves, and its states with joints."""
    scene = Scene(tuple(bodies), tuple(joints))
    job = {"tool": BARE, "trajectory": still(), "settle_s": 0.0, "hold_s": seconds, "record_hz": 100.0} | more
    (outcome,) = sim.rollout(Bodies(*bodies, joints=scene.joints), [Rollout(**job)])
    recording = film(outcome)
    return recording, scene.complete(recording.states)


def block(mass):
    return cube("block", FAR, mass=mass)


def bar(name, z):
    """A bar 0.4 m long, with its middle at a height."""
    return Body.of(name, Box((0.4, 0.02, 0.02)), (FAR[0], FAR[1], z), mass=0.5, color=GREY)


@pytest.mark.parametrize("mass", [0.01, 1.0])
@pytest.mark.parametrize("damping", [1.0, 300.0, 1e4])
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_dampers_of_any_strength_let_a_block_sink_at_their_speed(sim, mass, damping, friction):
    load = mass * GRAVITY
    joint = Joint("s", "slider", "block", damping=damping, friction=friction * load)
    _, states = play(sim, [block(mass)], [joint], seconds=1.0 + 8 * mass / damping)
    assert states.joint("s").speed[-1] == pytest.approx((friction - 1) * load / damping, rel=0.005)


def test_strong_dampers_in_a_row_turn_at_the_speeds_of_their_loads(sim):
    """Each turns as fast as the weights beyond it push, whatever the others do."""
    bars = [bar("near", 2.0), replace(bar("far", 2.0), pose=bar("far", 2.0).pose @ cube(at=(0.4, 0, 0)).pose)]
    hinges = [
        Joint(name, "hinge", name, parent, (0, 1, 0), (-0.2, 0, 0), damping=300.0)
        for name, parent in (("near", None), ("far", "near"))
    ]
    _, states = play(sim, bars, hinges)
    load = 0.5 * GRAVITY / 300.0
    assert states.joint("near").speed[-1] == pytest.approx(0.8 * load, rel=0.01)
    assert states.joint("far").speed[-1] == pytest.approx(0.2 * load, rel=0.01)


def test_a_latch_that_is_stiff_for_a_time_step_holds(sim):
    """At 2 ms an explicit force of this stiffness, 6e4 N/m on 20 g, would blow up."""
    joint = Joint("s", "slider", "block", axis=(0, 0, 1), damping=0.5, latches=(Latch(0.0, 20.0, 0.001),))
    _, states = play(sim, [block(0.02)], [joint])
    assert np.abs(states.joint("s").position).max() < 1e-4


def test_joints_that_are_far_too_stiff_are_refused(sim):
    joint = Joint("s", "slider", "block", stiffness=1e4)
    with pytest.raises(UsageError, match=r"set sim\.time_step to"):
        play(sim, [block(1e-5)], [joint])


def test_scenes_with_joints_change_nothing_in_those_after(sim):
    def plain():
        return bits(move(sim, PLAN, *THINGS, tool=stick(0.25), record_hz=25))

    before = plain()
    play(sim, [block(1.0)], [Joint("s", "ball", "block", stiffness=5.0, friction=0.1)], seconds=0.2)
    assert plain() == before


def test_a_wheel_whose_schedule_repeats_goes_on_turning(sim):
    joint = Joint("axle", "hinge", "block", drive=Drive((0.0, 1.0), (0.0, 2 * np.pi), 50.0, repeats=True))
    recording, states = play(sim, [block(1.0)], [joint], seconds=2.5, settle_s=0.1)
    speeds = states.joint("axle").speed
    assert np.abs(speeds[recording.times < 0]).max() < 1e-9
    assert speeds[recording.times > 0.2] == pytest.approx(2 * np.pi, rel=1e-3)


def test_a_launched_body_gets_the_velocity_of_its_origin(sim):
    thrown = replace(hammer("hammer", FAR), velocity=(1, 2, 3), spin=(0, 5, 2))
    recording, states = play(sim, [thrown], seconds=0.1, settle_s=0.1)
    begins = int(np.searchsorted(recording.times, -1e-9))
    assert np.abs(states.angular_velocities[:begins]).max() == 0
    assert states.linear_velocity("hammer")[begins + 1] == pytest.approx([1, 2, 3], abs=0.4)
    (outcome,) = sim.rollout(Bodies(thrown), [Rollout(BARE, still(), settle_s=0.0)])
    assert outcome.start.linear_velocity("hammer") == pytest.approx([1, 2, 3], abs=1e-9)


def test_bodies_that_hang_from_a_free_one_stop_at_each_other(sim):
    base = cube("base", at=(0.6, 0, 0.05), mass=2.0)
    flaps = [
        Body.of(name, Box((0.02, 0.02, 0.3)), (0.6, 0.03 * side, 0.25), mass=0.1, color=GREY)
        for name, side in (("left", 1), ("right", -1))
    ]
    hinges = [
        Joint(name, "hinge", name, "base", (1, 0, 0), (0, 0, -0.15), stiffness=2.0, rest=0.6 * side, damping=0.02)
        for name, side in (("left", 1), ("right", -1))
    ]
    recording, states = play(sim, [table(), base, *flaps], hinges, seconds=2.0, forces=True)
    turned = sum(abs(states.joint(name).position[-1]) for name in ("left", "right"))
    assert 0.3 * turned == pytest.approx(0.04, abs=0.002)  # they began so far apart
    assert recording.forces["left", "right"][-1] > 1
    assert not any({"base", name} == set(pair) for pair in recording.forces for name in ("left", "right"))


def test_forces_are_the_weights_that_rest_and_name_what_pushes(sim):
    stack = [table(), cube("low", at=(0.62, 0, 0.05)), cube("high", at=(0.62, 0, 0.15), mass=2.0)]
    recording, _ = play(sim, stack, forces=True)
    assert set(recording.forces) == {("table", "low"), ("low", "high")}
    for pair, mass in ((("table", "low"), 3.0), (("low", "high"), 2.0)):
        force = recording.forces[pair]
        assert force[0] == 0
        assert force[-1] == pytest.approx(mass * GRAVITY, rel=0.01)
    pushing = motion([[0.5, 0, 0.3, 0, 0, 0], [0.58, 0, 0.3, 0, 0, 0]])
    recording, states = play(sim, stack[:2], trajectory=pushing, tool=stick(0.25), record_hz=20.0, forces=True)
    moved = states.position("low")[-1, 0] - 0.62
    assert moved > 0.01
    assert recording.forces["tool", "low"].max() > 3
    assert set(recording.forces) == {("table", "low"), ("tool", "low")}


def test_forces_are_left_out_where_none_are_asked_for(sim):
    recording, _ = play(sim, [table(), cube(at=(0.6, 0, 0.05))], seconds=0.1)
    assert recording.forces == {}
