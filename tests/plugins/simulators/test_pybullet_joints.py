"""Test what PyBullet alone does with joints between bodies. What every engine must do is in plugins.conformance."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import RIGID_MOUNT, Component, Tool, ToolJoint
from core.designs.springs import measure_lightness
from core.errors import UsageError
from core.geometry import Box, Pose
from core.interfaces import Rollout
from core.plugins import installed
from core.scene import Body, Drive, Joint, Latch, Scene, table
from plugins.conformance.worlds import BARE, FAR, GRAVITY, GREY, Bodies, cube, still
from tests.support.tongs import hammer
from tests.support.worlds import film

pytest.importorskip("pybullet")
SMALL = Box((0.1, 0.02, 0.02))


@pytest.fixture(scope="module")
def sim():
    return installed().create("sim", "pybullet")


def play(sim, bodies, joints=(), seconds=1.0, **more):
    """A recording of the arm that waits, or moves, and its states with joints."""
    scene = Scene(tuple(bodies), tuple(joints))
    job = {
        "tool": BARE,
        "trajectory": still(),
        "settle_s": 0.0,
        "hold_s": seconds,
        "record_hz": 100.0,
    } | more
    (outcome,) = sim.rollout(Bodies(*bodies, joints=scene.joints), [Rollout(**job)])
    recording = film(outcome)
    return recording, scene.complete(recording.states)


def block(mass):
    return cube("block", FAR, mass=mass)


@pytest.mark.parametrize(
    ("mass", "damping"), [(0.01, 1.0), (1.0, 1.0), (1.0, 300.0), (1.0, 3000.0)]
)
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_dampers_let_a_block_sink_at_their_speed(sim, mass, damping, friction):
    load = mass * GRAVITY
    joint = Joint("s", "slider", "block", damping=damping, friction=friction * load)
    _, states = play(sim, [block(mass)], [joint], seconds=1.0 + 8 * mass / damping)
    assert states.joint("s").speed[-1] == pytest.approx(
        (friction - 1) * load / damping, rel=0.005
    )


def test_a_latch_that_is_stiff_for_a_time_step_holds(sim):
    """At 2 ms an explicit force of this stiffness, 6e4 N/m on 20 g, would blow up."""
    joint = Joint(
        "s",
        "slider",
        "block",
        axis=(0, 0, 1),
        damping=0.5,
        latches=(Latch(0.0, 20.0, 0.001),),
    )
    _, states = play(sim, [block(0.02)], [joint])
    assert np.abs(states.joint("s").position).max() < 1e-4


def test_joints_that_are_far_too_stiff_are_refused(sim):
    for strong in ({"stiffness": 1e4}, {"damping": 1.0}):
        with pytest.raises(UsageError, match=r"set sim\.time_step to"):
            play(sim, [block(1e-5)], [Joint("s", "slider", "block", **strong)])


def test_a_wheel_whose_schedule_repeats_goes_on_turning(sim):
    joint = Joint(
        "axle",
        "hinge",
        "block",
        drive=Drive((0.0, 1.0), (0.0, 2 * np.pi), 50.0, repeats=True),
    )
    recording, states = play(sim, [block(1.0)], [joint], seconds=2.5, settle_s=0.1)
    speeds = states.joint("axle").speed
    assert np.abs(speeds[recording.times < 0]).max() < 1e-9
    assert speeds[recording.times > 0.2] == pytest.approx(2 * np.pi, rel=1e-3)


def test_a_launched_body_gets_the_velocity_of_its_origin(sim):
    thrown = replace(hammer("hammer", FAR), velocity=(1, 2, 3), spin=(0, 5, 2))
    recording, states = play(sim, [thrown], seconds=0.1, settle_s=0.1)
    begins = int(np.searchsorted(recording.times, -1e-9))
    assert np.abs(states.angular_velocities[:begins]).max() == 0
    assert states.linear_velocity("hammer")[begins + 1] == pytest.approx(
        [1, 2, 3], abs=0.4
    )
    (outcome,) = sim.rollout(Bodies(thrown), [Rollout(BARE, still(), settle_s=0.0)])
    assert outcome.start.linear_velocity("hammer") == pytest.approx([1, 2, 3], abs=1e-9)


def test_bodies_that_hang_from_a_free_one_stop_at_each_other(sim):
    base = cube("base", at=(0.6, 0, 0.05), mass=2.0)
    flaps = [
        Body.of(
            name, Box((0.02, 0.02, 0.3)), (0.6, 0.03 * side, 0.25), mass=0.1, color=GREY
        )
        for name, side in (("left", 1), ("right", -1))
    ]
    hinges = [
        Joint(
            name,
            "hinge",
            name,
            "base",
            (1, 0, 0),
            (0, 0, -0.15),
            stiffness=2.0,
            rest=0.6 * side,
            damping=0.02,
        )
        for name, side in (("left", 1), ("right", -1))
    ]
    recording, states = play(
        sim, [table(), base, *flaps], hinges, seconds=2.0, forces=True
    )
    turned = sum(abs(states.joint(name).position[-1]) for name in ("left", "right"))
    assert 0.3 * turned == pytest.approx(0.04, abs=0.002)  # they began so far apart
    assert recording.forces["left", "right"][-1] > 1
    assert not any(
        {"base", name} == set(pair)
        for pair in recording.forces
        for name in ("left", "right")
    )


def test_forces_are_left_out_where_none_are_asked_for(sim):
    recording, _ = play(sim, [table(), cube(at=(0.6, 0, 0.05))], seconds=0.1)
    assert recording.forces == {}


def test_a_spring_between_a_hammer_and_what_weighs_next_to_nothing_gives_its_energy_alone(
    sim,
):
    """It turns 65 g against a gram, on one axis: at 2 ms PyBullet made 100 rad/s of half a millijoule."""
    axis = {"axis": (0.0, 0.0, 1.0), "origin": (-0.05, 0.0, 0.0)}
    turns = ToolJoint("hinge", lower=-3.0, upper=3.0, **axis)
    sprung = replace(turns, stiffness=10.0, rest=0.01)
    low = Pose.xyz_rpy((0.0, 0.0, -0.021))
    post = Component("post", RIGID_MOUNT, low, SMALL, 0.05)
    aside = Pose.xyz_rpy((0.05, 0.0, 0.0)) @ low
    bearer = Component("bearer", "post", aside, SMALL, 0.001, joint=turns)
    hammer = Component("hammer", "bearer", low, SMALL, 0.065, joint=sprung)
    job = Rollout(Tool((post, bearer, hammer)), still(), 0, 0.1, 0.5, record_hz=1e4)
    (outcome,) = sim.rollout(Bodies(), [job])
    recording = film(outcome)
    values = recording.fingers[:, -2:]
    speeds = np.diff(values, axis=0) / np.diff(recording.times)[:, None]
    inertias = 1 / measure_lightness(job.tool)
    most = np.sqrt(sprung.stiffness * sprung.rest**2 / inertias)
    assert (np.abs(speeds).max(axis=0) < 1.1 * most).all()
