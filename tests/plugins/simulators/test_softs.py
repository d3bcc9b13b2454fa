"""Requirements for soft bodies in engines: MuJoCo plays and draws them, the others refuse them in a line."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from core.errors import UserError
from core.interfaces import Rollout
from core.plugins import installed
from core.scene import (
    Body,
    Box,
    Camera,
    Cloth,
    Cylinder,
    Elastic,
    Filling,
    Joint,
    Rope,
    Sphere,
)
from core.solids.contacts import find_contacts, make_trace
from plugins.conformance.softs import soft
from plugins.conformance.worlds import BARE, FAR, GREY, Bodies, cube, still
from plugins.simulators.mujoco.simulator import MuJoCoSimulator
from tests.support.worlds import end, film

X, Y, _ = FAR
BAR = Body.of(
    "bar",
    Cylinder(0.015, 0.4),
    (X, Y, 0.3),
    mass=0.0,
    color=GREY,
    rpy=(np.pi / 2, 0.0, 0.0),
)
TOWEL = soft(Cloth((0.3, 0.2), (11, 8)), Elastic(300, 1e5), 0.33)
LOAD = cube("load", (X + 1.0, Y, 0.05), 0.1, 1.0)


def played(task, seconds=2.0):
    (outcome,) = MuJoCoSimulator().rollout(
        task, [Rollout(BARE, still(), 0, 0.0, seconds, 25.0, forces=True)]
    )
    assert outcome.error is None
    return outcome


def test_a_cloth_hangs_over_a_bar_at_rest_and_presses_it():
    task = Bodies(BAR, TOWEL, LOAD)
    outcome = played(task)
    state = end(outcome)
    weight = 9.81 * TOWEL.mass
    assert state.extent("soft")[2] > 0.12
    assert state.nodes("soft")[:, 2].max() > 0.31
    assert np.abs(state.linear_velocity("soft")).max() < 0.02
    # Around half of the bar: pi / 2.
    assert weight < film(outcome).forces["bar", "soft"][-10:].mean() < 1.6 * weight
    scene = task.scene(0)
    contacts = find_contacts(scene, task.robot, BARE, film(outcome))
    trace = make_trace(scene, contacts)
    assert trace.touching_at_end("soft", "bar")
    assert not trace.touched("soft", "robot")
    assert trace.states.nodes("soft").shape == (len(trace.times), 88, 3)
    assert not trace.touched("load", "soft")


def test_a_soft_body_at_rest_stays_where_it_is():
    slab = soft(Filling(Box((0.12, 0.12, 0.04)), (5, 5, 3)), Elastic(300, 2e4), 0.021)
    ground = Body.of(
        "ground", Box((1.0, 1.0, 0.1)), (X, Y, -0.05), mass=0.0, color=GREY
    )
    outcome = played(Bodies(ground, slab))
    assert film(outcome).forces["ground", "soft"][-10:].mean() == pytest.approx(
        9.81 * slab.mass, rel=0.02
    )
    assert (
        np.abs(end(outcome).position("soft") - outcome.start.position("soft")).max()
        < 0.002
    )


def test_a_slab_that_is_pressed_hard_pushes_back_as_rubber_does():
    """Less would fold up: by Saint Venant and Kirchhoff's law a third of the load presses it to 0.39 of its height."""
    side = 0.1
    high = 0.045
    load = 3.0
    elastic = Elastic(400, 5e3, 0.45, 0.05, friction=0.0)
    plate = Body.of(
        "plate", Box((0.2, 0.2, 0.02)), (X, Y, high + 0.0125), mass=load, color=GREY
    )
    ground = Body.of(
        "ground", Box((1.0, 1.0, 0.1)), (X, Y, -0.05), mass=0.0, color=GREY
    )
    slab = soft(Filling(Box((side, side, high))), elastic, high / 2 + 0.001)
    guide = Joint("guide", "slider", "plate")
    found = end(played(Bodies(slab, ground, plate, joints=(guide,)), 3.0)).nodes("soft")
    # Neo-Hookean, incompressible.
    due = brentq(
        lambda part: 5e3 * side**2 / 3 * (part**-2 - part) - 9.81 * load, 0.1, 1.0
    )
    assert np.ptp(found[:, 2]) / high == pytest.approx(due, rel=0.05)


def test_a_long_edge_between_the_nodes_of_a_cloth_bears_it():
    edges = [
        Body.of(
            f"edge{y}", Box((0.4, 0.01, 0.02)), (X, Y + y, 0.29), mass=0.0, color=GREY
        )
        for y in (-0.06, 0.06)
    ]
    state = end(
        played(
            Bodies(*edges, soft(Cloth((0.2, 0.25), (5, 6)), Elastic(300, 1e5), 0.302)),
            1.0,
        )
    )
    assert state.nodes("soft")[:, 2].max() > 0.29


def test_a_thin_rope_that_falls_does_not_go_through_the_ground():
    ground = Body.of(
        "ground", Box((1.0, 1.0, 0.04)), (X, Y, -0.02), mass=0.0, color=GREY
    )
    rope = soft(
        Rope(((0, 0, 0), (0.223, 0, 0)), 4, thickness=0.0038),
        Elastic(1408, 1e6, damping=0),
        0.052,
    )
    assert end(played(Bodies(ground, rope), 1.0)).nodes("soft")[
        :, 2
    ].min() == pytest.approx(0.0019, abs=5e-4)


@pytest.mark.parametrize("name", ["pybullet", "mujoco"])
def test_pictures_follow_the_nodes(name):
    ball = soft(Filling(Sphere(0.06), (4, 4, 4)), Elastic(300, 2e4), 0.2)
    task = Bodies(ball)
    camera = Camera((X, Y - 0.6, 0.3), (X, Y, 0.2))
    start = task.scene(0).state()
    simulator = installed().create("sim", name)
    moved = start.each(
        lambda array: (
            array + np.array([0.1, 0.0, 0.0]) if array.shape[-1] == 3 else array
        )
    )
    before, after = (
        simulator.render(
            task, state=state, camera=camera, width=160, height=120
        ).astype(int)
        for state in (start, moved)
    )
    shown = [
        np.argwhere(np.abs(picture - picture[0, 0]).max(axis=-1) > 40)[:, 1].mean()
        for picture in (before, after)
    ]
    assert shown[1] - shown[0] == pytest.approx(
        0.1 / 0.6 * 60 / np.tan(np.radians(30)), rel=0.2
    )


def test_bodies_that_bounce_are_refused_beside_them():
    bouncing = [replace(body, restitution=0.5) for body in (BAR, LOAD)]
    with pytest.raises(
        UserError,
        match="a scene with soft bodies can't have two bodies with restitution",
    ):
        played(Bodies(*bouncing, TOWEL))


@pytest.mark.parametrize("name", ["pybullet", "sapien", "mujoco_warp"])
def test_other_engines_refuse_them_and_name_the_mend(name):
    try:
        simulator = installed().create("sim", name)
    except UserError:
        pytest.skip(f"{name} is not installed")
    with pytest.raises(
        UserError,
        match=rf"sim={name} does not support soft bodies \(soft\); use sim=mujoco",
    ):
        simulator.rollout(Bodies(TOWEL), [Rollout(BARE, still(), 0)])
