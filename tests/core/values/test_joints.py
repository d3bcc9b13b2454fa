import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from core.geometry import Pose
from core.scene import Body, Box, Drive, Joint, Latch, Scene
from core.values.joints import Placement
from plugins.simulators.forces import latch_force

RED = (1, 0, 0, 1)
numbers = st.floats(-1.0, 1.0)
vectors = st.tuples(numbers, numbers, numbers)


def body(name, position=(0, 0, 0), rpy=(0, 0, 0), mass=1.0):
    return Body.of(name, Box((0.1, 0.1, 0.1)), position, mass=mass, color=RED, rpy=rpy)


def two(joint, first=(0.1, 0.2, 0.3), second=(0.4, 0.1, 0.3)):
    return Scene(
        (body("a", first, (0.3, 0.2, 0.1)), body("b", second, (1, 0.2, -0.4))), (joint,)
    )


def moving(seed):
    """Where a body is, and how it moves, at random."""
    rng = np.random.default_rng(seed)
    turn = Rotation.random(3, rng=rng).as_quat(scalar_first=True)
    return Placement(
        rng.normal(size=(3, 3)), turn, rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
    )


def test_a_joint_reads_its_start_from_the_scene():
    scene = two(
        Joint("j", "hinge", "b", "a", axis=(0, 0, 3), lower=-1, upper=1, start=0.25)
    )
    position, speed = scene.state().joint("j")
    assert position == pytest.approx(0.25)
    assert speed == 0
    assert scene.joints[0].axis == (0, 0, 1)
    assert scene.joined == {frozenset("ab")}


@given(
    st.sampled_from(["hinge", "slider"]),
    st.floats(-3.1, 3.1),
    st.floats(-5, 5),
    vectors,
    st.integers(0, 99),
)
def test_what_a_joint_carries_is_where_it_reads_it(kind, value, speed, origin, seed):
    placed = two(
        Joint("j", kind, "b", "a", axis=(1, 2, 3), origin=origin, start=0.2)
    ).placed_joints["j"]
    parent = moving(seed)
    read = placed.read(
        placed.carry(np.full(3, value), np.full(3, speed), parent), parent
    )
    assert read.position == pytest.approx(np.full(3, value), abs=1e-6)
    assert read.speed == pytest.approx(np.full(3, speed), abs=1e-6)


@given(st.sampled_from(["hinge", "slider"]), st.integers(0, 99))
def test_velocities_are_the_rates_of_poses(kind, seed):
    placed = two(
        Joint("j", kind, "b", "a", axis=(1, 2, 3), origin=(0.1, -0.2, 0.3))
    ).placed_joints["j"]
    now, h, speed = moving(seed), 1e-6, np.full(3, 0.7)
    turned = Rotation.from_rotvec(now.angular * h) * Rotation.from_quat(
        now.quaternion, scalar_first=True
    )
    later = now._replace(
        position=now.position + h * now.linear,
        quaternion=turned.as_quat(scalar_first=True),
    )
    one, two_ = (
        placed.carry(np.full(3, 0.4) + t * speed, speed, p)
        for t, p in ((0, now), (h, later))
    )
    assert (two_.position - one.position) / h == pytest.approx(one.linear, abs=1e-4)
    spin = (
        Rotation.from_quat(two_.quaternion, scalar_first=True)
        * Rotation.from_quat(one.quaternion, scalar_first=True).inv()
    )
    assert spin.as_rotvec() / h == pytest.approx(one.angular, abs=1e-4)


@given(st.integers(0, 99))
def test_a_ball_gives_the_angle_that_it_turned(seed):
    placed = two(Joint("j", "ball", "b", "a", origin=(0.1, 0, 0))).placed_joints["j"]
    parent, turn = (
        moving(seed),
        Rotation.from_rotvec([[0.3, 0, 0], [0, -1.0, 0], [0, 0, 2.5]]),
    )
    read = placed.read(
        placed.carry(turn.as_quat(scalar_first=True), np.zeros((3, 3)), parent), parent
    )
    assert read.position == pytest.approx([0.3, 1.0, 2.5])
    assert read.speed == pytest.approx(0.0, abs=1e-9)


def test_an_angle_beyond_half_a_turn_is_told_by_the_range():
    joint = Joint("j", "hinge", "b", axis=(0, 0, 1), lower=0.0, upper=5.0)
    placed = two(joint).placed_joints["j"]
    world = Placement.at_rest(Pose())
    assert placed.read(
        placed.carry(np.array([4.5]), np.zeros(1), world), world
    ).position == pytest.approx(4.5)


def test_a_chain_is_listed_from_its_root_and_travels():
    chain = (
        Joint("tip", "hinge", "c", "b"),
        Joint("root", "hinge", "a"),
        Joint("middle", "hinge", "b", "a"),
    )
    scene = Scene((body("a"), body("b"), body("c")), chain)
    assert [placed.joint.name for placed in scene.ordered_joints] == [
        "root",
        "middle",
        "tip",
    ]
    assert pickle.loads(pickle.dumps(scene)).joints == chain


# --- what moves by itself ---------------------------------------------------------------------------------------


def test_a_latch_pulls_back_most_halfway_and_lets_go():
    joint = Joint("j", "slider", "b", latches=(Latch(0.1, 8.0, 0.02),))
    at = [0.1, 0.11, 0.09, 0.1201, 0.5]
    assert [latch_force(joint, position) for position in at] == pytest.approx(
        [0, -8, 8, 0, 0], abs=1e-9
    )


def test_a_drive_rests_moves_and_stays_or_repeats():
    drive = Drive((0, 1, 2), (0.0, 0.5, 0.0), 10.0)
    times = np.array([-1.0, 0.0, 0.5, 1.0, 1.5, 3.5])
    assert drive.sample(times) == pytest.approx([0, 0, 0.25, 0.5, 0.25, 0])
    assert replace(drive, repeats=True).sample(times) == pytest.approx(
        [0, 0, 0.25, 0.5, 0.25, 0.25]
    )


# --- errors -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Joint("j", "screw", "b"),
            "kind must be hinge, slider or ball, got 'screw'",
        ),
        (lambda: Joint("j", "hinge", "b", axis=(0, 0, 0)), "its axis needs a length"),
        (
            lambda: Joint("j", "hinge", "b", origin=(0, math.nan, 0)),
            "its origin three numbers",
        ),
        (
            lambda: Joint("j", "slider", "b", lower=0.1, upper=0.2),
            "it starts at 0, outside of its range 0.1..0.2",
        ),
        (
            lambda: Joint("j", "slider", "b", lower=-1),
            "both ends of its range must be numbers up to 1000",
        ),
        (lambda: Joint("j", "hinge", "b", lower=-4, upper=4), "less than a whole turn"),
        (lambda: Joint("j", "hinge", "b", damping=-1), "damping must be from 0"),
        (
            lambda: Joint("j", "hinge", "b", rest=math.inf),
            "rest, start and both ends",
        ),
        (
            lambda: Joint("j", "slider", "b", lower=0, upper=1e300),
            "rest, start and both ends",
        ),
        (lambda: Latch(1e300, 1, 0.1), "a latch needs a place"),
        (
            lambda: Drive((0, 1), (0, 1e300), 1),
            "a number for each of its 2 times, up to 1000",
        ),
        (lambda: Joint("j", "ball", "b", lower=-1, upper=1), "a ball has no range"),
        (
            lambda: Joint("j", "slider", "b", drive=Drive((0,), (0,), 1), friction=1),
            "a joint with a drive has no",
        ),
        (lambda: Latch(0, -1, 0.1), "a latch needs a place"),
        (lambda: Drive((1, 2), (0, 0), 1), "times must begin at 0 and rise"),
        (lambda: Drive((0, 2), (0,), 1), "a number for each of its 2 times"),
        (lambda: Drive((0,), (0,), 0), "force must be above 0"),
        (lambda: Drive((0,), (0,), 1, repeats=True), "needs two times or more"),
        (
            lambda: two(Joint("j", "hinge", "x")),
            "joint 'j': there is no body 'x'; there are: a, b",
        ),
        (
            lambda: Scene((body("a", mass=0),), (Joint("j", "hinge", "a"),)),
            "its body 'a' is fixed; give it a mass",
        ),
        (
            lambda: Scene(
                (replace(body("a"), velocity=(1, 0, 0)),), (Joint("j", "hinge", "a"),)
            ),
            "can't start with a velocity; use a drive",
        ),
        (
            lambda: Scene(
                (body("a"),), (Joint("i", "hinge", "a"), Joint("j", "slider", "a"))
            ),
            "joint 'j': its body 'a' hangs from another joint already",
        ),
        (
            lambda: Scene(
                (body("a"), body("b")),
                (Joint("i", "hinge", "a", "b"), Joint("j", "hinge", "b", "a")),
            ),
            "among the joints of a, b is a circle",
        ),
        (
            lambda: Scene((body("a"),), (Joint("i", "hinge", "a"),) * 2),
            "two joints in the scene have the same name",
        ),
        (
            lambda: replace(body("a", mass=0), velocity=(1, 0, 0)),
            "a velocity needs finite numbers, and a mass above 0",
        ),
    ],
)
def test_a_joint_that_can_not_be(make, message):
    with pytest.raises(ValueError, match=message):
        make()
