"""Test what PyBullet alone has. What every engine must do is in test_conformance.py and test_settings.py."""

import math

import numpy as np
import pytest

from core.geometry import Box, Capsule, Cylinder, Pose
from core.plugins import installed
from core.scene import Body, Geom, Scene, table
from plugins.conformance.output import bits
from plugins.conformance.worlds import BARE, GREY, Bodies, cube, end, move, stick, wait
from tests.panda import PANDA

pytest.importorskip("pybullet")


def hammer(name, at, side=0.05):
    """A body whose centre of mass is not its frame's origin, and whose axes of inertia are not its own."""
    parts = (
        Geom(Box((side, 0.02, 0.02)), Pose.xyz_rpy((0.03, 0.01, 0), (0.2, 0.3, 0.4))),
        Geom(Box((0.03, side, 0.04)), Pose.xyz_rpy((0, 0, 0.02))),
    )
    return Body(name, Pose.xyz_rpy(at, (0.3, 0, 0.5)), 0.2, parts, parts)


PLAN = [[0.6, 0.2, 0.15, 0, 0.3, 0], [0.6, -0.2, 0.15, 0, 0, 0.5]]
THINGS = (table(), cube(at=(0.6, 0, 0.05)), hammer("hammer", (0.7, 0.1, 0.1)), hammer("other", (0.5, -0.1, 0.1), 0.06))


def test_what_is_kept_between_rollouts_changes_no_bit_of_them():
    def played(sim, tool, bodies):
        return bits(move(sim, PLAN, *bodies, tool=tool, record_hz=25))

    jobs = [(stick(0.25), THINGS), (stick(0.3), THINGS), (stick(0.25), THINGS[:2]), (stick(0.25), THINGS)]
    one = installed().create("sim", "pybullet")
    assert [played(one, *job) for job in jobs] == [played(installed().create("sim", "pybullet"), *job) for job in jobs]


def test_motors_keep_targets_that_do_not_change(monkeypatch):
    from plugins.simulators.pybullet.world import World

    sim = installed().create("sim", "pybullet")
    obey = World.obey
    driven = []

    def anew(world, order):
        driven.append(world._driven)
        world._driven = None
        obey(world, order)

    kept = bits(move(sim, PLAN, *THINGS, tool=stick(0.25), record_hz=25))
    monkeypatch.setattr(World, "obey", anew)
    assert bits(move(sim, PLAN, *THINGS, tool=stick(0.25), record_hz=25)) == kept
    assert len(driven) > 500


def test_joints_have_the_inertia_of_their_motors(monkeypatch):
    """Bullet takes a joint's inertia only as a link's, so that the joints before it carry it too."""

    def inertia(joint):
        """What a torque of 1 Nm accelerates while the other joints are held."""
        sim = installed().create("sim", "pybullet")  # its worlds end with it
        world = sim.world(Bodies(table()), BARE)
        p = world.client
        p.setGravity(0, 0, 0)
        for number in world._joints:
            force = 0.0 if number == world._joints[joint] else 1e9
            p.setJointMotorControl2(world.robot, number, p.VELOCITY_CONTROL, targetVelocity=0.0, force=force)
        p.setJointMotorControl2(world.robot, world._joints[joint], p.TORQUE_CONTROL, force=1.0)
        p.stepSimulation()
        speed = p.getJointState(world.robot, world._joints[joint])[1]
        return world.time_step / speed

    heavy = np.array([inertia(joint) for joint in range(7)])
    monkeypatch.setattr("plugins.simulators.pybullet.world.driven_links", lambda robot: {})
    light = np.array([inertia(joint) for joint in range(7)])
    assert light[6] < 0.02
    more = heavy - light
    motors = np.array(PANDA.motor_inertia)
    beyond = np.append(np.cumsum(motors[::-1])[::-1][1:], 0.0)
    assert (more > 0.95 * motors).all()
    assert (more < 1.05 * (motors + beyond)).all()


def test_frames_of_many_bodies_are_those_of_each(tmp_path):
    from plugins.simulators.pybullet.world import PreparedScene

    scene = PreparedScene(Scene(THINGS), tmp_path)
    assert scene.shifted  # of the free bodies
    offsets = [body.offset for body in scene.bodies if not body.fixed and body.offset is not None]
    rng = np.random.default_rng(0)
    centers = rng.normal(size=(200, len(offsets), 3))
    quaternions = rng.normal(size=(200, len(offsets), 4))
    each = [
        [Pose(c, q) @ offset for c, q, offset in zip(*rows, offsets, strict=True)]
        for rows in zip(centers, quaternions, strict=True)
    ]
    positions, turned = scene.frames(centers, quaternions)
    assert positions.tobytes() == np.array([[pose.position for pose in row] for row in each]).tobytes()
    assert turned.tobytes() == np.array([[pose.quaternion for pose in row] for row in each]).tobytes()


@pytest.mark.parametrize("shape", [Capsule(0.01, 0.1), Cylinder(0.03, 0.1)])
@pytest.mark.parametrize("yaw", [0.1, 0.4, 1.2])
def test_what_lies_on_its_round_side_does_not_creep(shape, yaw):
    at = (0.6, 0.1, shape.radius)
    rpy = (0.0, math.pi / 2, yaw)
    body = Body.of("body", shape, at, mass=0.3, color=GREY, rpy=rpy)
    state = end(wait(installed().create("sim", "pybullet"), table(), body, seconds=2.0))
    assert np.abs(state.position("body") - at).max() < 1e-3
