"""Test what MuJoCo alone has where bodies hang from joints, are launched, or press on each other."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.geometry import Box, Pose, Sphere
from core.interfaces import Rollout
from core.plugins import installed
from core.scene import Body, Drive, Joint, Latch, Scene
from core.simulation.playback import play
from plugins.conformance.worlds import BARE, FAR, GRAVITY, Bodies, cube, still
from tests.support.worlds import end, film, start

pytest.importorskip("mujoco")

import mujoco as mj

from plugins.simulators.mujoco.bodies import Moving
from plugins.simulators.mujoco.model import compile_model
from tests.support.panda import PANDA

JOB = Rollout(BARE, still(), settle_s=0.3, hold_s=0.5, record_hz=50.0)
SLAB = Body.of(
    "slab",
    Box((1.0, 1.0, 0.1)),
    (FAR[0], FAR[1], -0.05),
    mass=0.0,
    color=(0.5, 0.5, 0.5, 1.0),
)


def mujoco(**settings):
    return installed().create("sim", "mujoco", settings)


def block(name, *at, mass=1.0):
    return cube(name, np.add(FAR, at), mass=mass)


def slider(body="block", **more):
    return Joint("slider", "slider", body, **more)


def machine(*, latched, restitution=0.0):
    """A gate that is driven, a rod on it that swings, a ball joint, a latch or none, a cube that is thrown."""
    gate = block("gate", 0, 0, 2)
    rod = block("rod", 0, 0.2, 1.9, mass=0.2)
    bob = block("bob", 1, 0, 2)
    thrown = replace(
        block("thrown", -1, 0, 2),
        velocity=(0.5, 0.0, 1.0),
        spin=(1.0, 2.0, 3.0),
        restitution=restitution,
    )
    joints = (
        slider(
            "gate", start=0.1, drive=Drive((0.0, 0.3), (0.1, 0.4), 50.0, repeats=True)
        ),
        Joint("swing", "hinge", "rod", "gate", (1, 0, 0), (0, -0.2, 0), damping=0.01),
        Joint("bob", "ball", "bob", None, (1, 0, 0), (0.1, 0.2, 0.3), stiffness=0.5),
        Joint(
            "detent", "slider", "caught", latches=(Latch(0.0, 12.0, 0.01),) * latched
        ),
    )
    caught = replace(block("caught", 1, 1, 2), restitution=restitution)
    return Bodies(rod, SLAB, gate, bob, thrown, caught, joints=joints)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("latched", [False, True])
@pytest.mark.parametrize("forces", [False, True])
def test_all_steps_at_once_are_what_the_core_plays_step_by_step(
    latched, forces, restitution
):
    task = machine(latched=latched, restitution=restitution)
    sim = mujoco()
    first, ours = sim.rollout(task, [JOB, replace(JOB, forces=forces)])
    theirs = play(sim.world(task, BARE), JOB)
    for one in (first, theirs):
        for mine, other in ((start(ours), start(one)), (end(ours), end(one))):
            for array, others in zip(mine.arrays, other.arrays, strict=True):
                np.testing.assert_array_equal(array, others)
        np.testing.assert_array_equal(
            film(ours).states.positions, film(one).states.positions
        )
    assert start(ours).linear_velocity("thrown").tolist() == [0.5, 0.0, 1.0]


@pytest.mark.parametrize("width", [0.001, 0.01])
@pytest.mark.parametrize("mass", [0.02, 0.5])
def test_a_latch_holds_and_opens_however_stiff_it_is(width, mass):
    """Up to seven times stiffer than an explicit force could be at this time step."""
    for share in (0.97, 1.03):
        pull = 50.0 * share  # of a spring a metre long
        joint = slider(
            axis=(1, 0, 0),
            stiffness=pull,
            rest=1.0,
            damping=50 * pull,
            latches=(Latch(0.0, 50.0, width),),
        )
        task = Bodies(block("block", 0, 0, 2, mass=mass), joints=(joint,))
        (outcome,) = mujoco().rollout(task, [replace(JOB, hold_s=3.0)])
        moved = end(outcome).position("block")[0] - FAR[0]
        assert (moved < width / 2) == (share < 1)


def test_a_drive_bears_its_load_up_to_its_force():
    for force, due in ((20.0, 0.0), (6.0, -0.5 * (GRAVITY - 6.0) * 0.8**2)):
        task = Bodies(
            block("block", 0, 0, 2),
            joints=(slider(drive=Drive((0.0,), (0.0,), force)),),
        )
        (outcome,) = mujoco().rollout(task, [JOB])
        assert end(outcome).position("block")[2] - 2 == pytest.approx(
            due, rel=0.01, abs=1e-5
        )


def test_a_drive_pushes_what_sleeps():
    task = Bodies(
        SLAB,
        block("pusher", 0, 0, 0.06),
        block("asleep", 0.11, 0, 0.05),
        joints=(
            slider(
                "pusher", axis=(1, 0, 0), drive=Drive((0.0, 0.4), (0.0, 0.2), 100.0)
            ),
        ),
    )
    (outcome,) = mujoco().rollout(task, [replace(JOB, settle_s=2.0)])
    assert (
        end(outcome).position("asleep")[0] - start(outcome).position("asleep")[0] > 0.15
    )


def test_forces_are_what_bodies_weigh_awake_and_asleep_and_what_stops_them():
    ball = Body.of(
        "ball",
        Sphere(0.05),
        np.add(FAR, (0.3, 0, 0.5)),
        mass=0.3,
        color=(0.5, 0.5, 0.5, 1.0),
    )
    task = Bodies(
        block("high", 0, 0, 0.15, mass=2.0), SLAB, block("low", 0, 0, 0.05), ball
    )
    job = Rollout(BARE, still(), settle_s=0.5, hold_s=2.0, record_hz=30.0, forces=True)
    taken = film(mujoco().rollout(task, [job])[0])
    assert set(taken.forces) == {("high", "low"), ("slab", "low"), ("slab", "ball")}
    for forces in taken.forces.values():
        assert forces.shape == taken.times.shape
        assert forces[0] == 0
    late = taken.times > 0.3
    np.testing.assert_allclose(
        taken.forces["high", "low"][late], 2 * GRAVITY, rtol=1e-3
    )
    np.testing.assert_allclose(
        taken.forces["slab", "low"][late], 3 * GRAVITY, rtol=1e-3
    )
    impulse = (taken.forces["slab", "ball"][1:] * np.diff(taken.times)).sum()
    assert impulse == pytest.approx(0.3 * GRAVITY * 2.5, rel=1e-3)


@settings(max_examples=20)
@given(
    seed=st.integers(0, 2**32 - 1),
    kinds=st.lists(st.sampled_from(["hinge", "slider", "ball", None]), max_size=5),
)
def test_states_are_what_mujoco_makes_of_positions_and_speeds(seed, kinds):
    """For bodies anywhere that hang from the world, from fixed, free and jointed ones, moved in any way."""
    rng = np.random.default_rng(seed)
    bodies = [replace(cube("fixed", mass=0.0), pose=anywhere(rng))]
    joints = []
    for number, kind in enumerate(kinds):
        name = f"b{number}"
        parent = rng.choice([None, *(body.name for body in bodies)])
        bodies.append(replace(cube(name), pose=anywhere(rng)))
        if kind is not None:
            begin = 0.0 if kind == "ball" else rng.normal()
            joints.append(
                Joint(
                    name,
                    kind,
                    name,
                    parent,
                    tuple(rng.normal(size=3)),
                    tuple(rng.normal(size=3)),
                    start=begin,
                )
            )
    scene = Scene(tuple(reversed(bodies)), tuple(reversed(joints)))
    model = compile_model(
        PANDA,
        scene,
        BARE,
        0.0025,
        50.0,
        100.0,
    )
    data = mj.MjData(model)
    moving = Moving(scene, model)
    for array, others in zip(
        moving.state(data.qpos, data.qvel).arrays, scene.state().arrays, strict=True
    ):
        np.testing.assert_allclose(
            array * np.sign((array * others).sum(axis=-1, keepdims=True) + 1e-9),
            others,
            atol=1e-9,
        )
    data.qvel[:] = rng.normal(size=model.nv)
    mj.mj_integratePos(model, data.qpos, data.qvel, 1.0)
    mj.mj_forward(model, data)
    state = moving.state(
        np.array([data.qpos, data.qpos]), np.array([data.qvel, data.qvel])
    )[1]
    for name in state.names:
        number = model.body(
            f"body_{[body.name for body in scene.bodies].index(name)}"
        ).id
        where = state.placement(name)
        velocity = np.zeros(6)
        mj.mj_objectVelocity(model, data, mj.mjtObj.mjOBJ_XBODY, number, velocity, 0)
        np.testing.assert_allclose(where.position, data.xpos[number], atol=1e-9)
        np.testing.assert_allclose(
            abs(where.quaternion @ data.xquat[number]), 1.0, atol=1e-9
        )
        np.testing.assert_allclose([*where.angular, *where.linear], velocity, atol=1e-8)


def anywhere(rng):
    return Pose(rng.normal(size=3), rng.normal(size=4))
