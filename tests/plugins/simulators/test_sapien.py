"""Test what SAPIEN alone has: its world, surfaces and links. Settings are in test_settings.py."""

import math
from dataclasses import replace

import numpy as np
import pytest

from core.errors import UsageError
from core.geometry import Box
from core.interfaces import Order, Rollout
from core.plugins import installed
from core.scene import Body, Joint, table
from plugins.conformance.worlds import BARE, GRAVITY, GREY, Bodies, cube, slope, still
from tests.support.worlds import end, film, wait

pytest.importorskip("sapien", exc_type=ImportError)


def sapien(**settings):
    return installed().create("sim", "sapien", settings)


# --- surfaces ---------------------------------------------------------------------------------------------------


def test_many_coefficients_of_friction_are_their_pairs_geometric_means():
    """Nine blocks on a slope, each with a friction of its own: those of one kind differ too."""
    tilt = 0.45
    frictions = np.geomspace(0.1, 1.2, 9)
    hill = replace(slope(tilt, 0.3), mass=0.0)
    at = [hill.pose.apply([-1.8, 0.11 * (i - 4), 0.05 + 0.02]) for i in range(9)]
    blocks = [
        Body.of(
            f"b{i}",
            Box((0.1, 0.1, 0.04)),
            at[i],
            mass=1,
            color=GREY,
            rpy=(0, tilt, 0),
            friction=friction,
        )
        for i, friction in enumerate(frictions)
    ]
    state = end(wait(sapien(), hill, *blocks))
    slid = [float(np.linalg.norm(state.position(f"b{i}") - at[i])) for i in range(9)]
    due = GRAVITY * (math.sin(tilt) - np.sqrt(0.3 * frictions) * math.cos(tilt)) / 2
    np.testing.assert_allclose(slid, np.maximum(due, 0), atol=0.02)
    assert max(slid) > 1


# --- joints of the scene ----------------------------------------------------------------------------------------


def post_and_flaps(count):
    flaps = [
        cube(f"flap{i}", (3.0, 0.0, 1.0 + 0.1 * i), side=0.05) for i in range(count)
    ]
    return (cube("post", (3.0, 0.0, 1.0), mass=0.0), *flaps), [f.name for f in flaps]


def test_mechanism_with_too_many_joints_is_refused():
    bodies, names = post_and_flaps(33)
    joints = tuple(Joint(name, "slider", name, "post") for name in names)
    job = Rollout(BARE, still(), hold_s=0.1)
    with pytest.raises(UsageError, match="33 joints lead to the body 'post'"):
        sapien().rollout(Bodies(*bodies, joints=joints), [job])
    apart = tuple(replace(joint, parent=None) for joint in joints)
    assert sapien().rollout(Bodies(*bodies, joints=apart), [job])[0].error is None


def test_bodies_of_two_mechanisms_collide():
    """Two sliders overlap their own fixed bodies, and one of them falls onto the other."""
    shelf = Body.of(
        "shelf", Box((0.4, 0.1, 0.1)), (3.0, 0.0, 1.0), mass=0.0, color=GREY
    )
    bodies = (
        shelf,
        cube("low", (3.0, 0.0, 1.0)),
        cube("rail", (3.0, 0.0, 1.6), mass=0.0),
        cube("high", (3.0, 0, 1.5)),
    )
    tight = Joint("low", "slider", "low", "shelf", friction=200.0)
    loose = Joint("high", "slider", "high", "rail")
    (outcome,) = sapien().rollout(
        Bodies(*bodies, joints=(tight, loose)), [Rollout(BARE, still(), hold_s=1.5)]
    )
    state = end(outcome)
    assert state.position("low")[2] == pytest.approx(1.0, abs=0.005)
    assert state.position("high")[2] == pytest.approx(1.1, abs=0.005)


@pytest.mark.parametrize("kind", ["hinge", "ball"])
@pytest.mark.parametrize("stiffness", [0.1, 2.0])
def test_spring_stays_linear_at_large_angles(kind, stiffness):
    """PhysX's own gives way: it takes twice the sine of half the angle."""
    joint = Joint(
        "h",
        kind,
        "block",
        axis=(0.0, 0.0, 1.0),
        stiffness=stiffness,
        damping=0.3 * stiffness,
    )
    scenery = Bodies(cube("block", (3.0, 0.0, 1.0)), joints=(joint,))
    world = sapien().world(scenery, BARE)
    block = world._bodies.components["block"]
    arm, _ = world.joints()
    for _ in range(800):
        block.add_force_torque(np.zeros(3), np.array([0.0, 0.0, 2.8 * stiffness]))
        world.step(Order(arm.tolist(), 0.04, [0.0] * len(arm), 0.0))
    state = scenery.scene(0).complete(world.state())
    assert state.joint("h").position == pytest.approx(2.8, rel=0.015)


# --- contact forces ---------------------------------------------------------------------------------------------


def test_what_sleeps_presses_with_its_weight_and_what_lands_on_it():
    bodies = (
        table(),
        cube("low", (0.6, 0, 0.05)),
        cube("high", (0.6, 0, 0.15)),
        cube("falls", (0.6, 0, 2.5), mass=0.05),
    )
    job = Rollout(BARE, still(), hold_s=2.5, record_hz=30.0, forces=True)
    taken = film(sapien().rollout(Bodies(*bodies), [job])[0])
    assert taken.forces.keys() == {("table", "low"), ("low", "high"), ("high", "falls")}
    pressed = taken.forces["table", "low"]
    np.testing.assert_allclose(
        pressed[(taken.times > 0.0) & (taken.times < 0.15)], 2 * GRAVITY, rtol=0.03
    )
    np.testing.assert_allclose(pressed[taken.times > 1.5], 2.05 * GRAVITY, rtol=0.03)
