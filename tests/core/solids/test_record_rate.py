"""The rate of recordings, and the samples that are looked at."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import Component, Tool
from core.geometry import Box, Pose, Sphere
from core.interfaces import JointTrajectory
from core.robot.kinematics import robot_model
from core.scene import Scene
from core.solids.penetration import findings
from core.solids.record_rate import coarse_samples, refined_samples, sample_hz, subset
from core.solids.rollout_solids import tool_solids
from core.solids.tracks import SAMPLE_HZ
from core.values.joints import Joint
from tests.support.panda import ARM, PANDA
from tests.support.recordings import WALL, body, recording, straight


def stick(thick):
    return Tool(
        (
            Component(
                "stick",
                "tool_mount",
                Pose.xyz_rpy((0, 0, -0.1)),
                Box((thick, thick, 0.2)),
            ),
        )
    )


def turn(seconds):
    """The arm turns about its base by a radian."""
    joints = np.array([ARM.home, ARM.home])
    joints[1, 0] += 1.0
    return JointTrajectory(np.array([0.0, seconds]), joints, np.zeros(2))


# Thick, and around all that the arm does.
NEAR = Scene((body("room", Box((3.0, 3.0, 3.0)), (0, 0, 0), mass=0.0),))


@pytest.mark.parametrize(
    ("thick", "seconds", "hz"),
    [(0.02, 20.0, 25.0), (0.02, 2.0, 25.0), (0.02, 0.5, 100.0), (0.001, 0.5, 1600.0)],
)
def test_fast_and_thin_tools_are_looked_at_more_often(thick, seconds, hz):
    assert sample_hz(PANDA, stick(thick), turn(seconds), NEAR) == hz


def test_thin_bodies_are_looked_at_more_often():
    sheet = body("sheet", Box((3.0, 3.0, 0.002)), (0, 0, 0), mass=0.0)
    scene = Scene((*NEAR.bodies, sheet))
    assert sample_hz(PANDA, stick(0.02), turn(0.5), scene) == 800.0


@pytest.mark.parametrize("seconds", [0.28, 2.24, 4.48])
def test_a_motion_may_last_a_whole_number_of_samples(seconds):
    """Of a float like 2.24 `np.arange` returns the end too."""
    hz = sample_hz(PANDA, stick(0.02), turn(seconds), NEAR)
    almost = sample_hz(PANDA, stick(0.02), turn(seconds - 1e-3), NEAR)
    assert hz == almost


@pytest.mark.parametrize(("gap", "hz"), [(0.04, 100.0), (0.06, 25.0)])
def test_only_what_is_near_the_tool_makes_its_speed_count(gap, hz):
    # Below the stick's end.
    top = stick_at_home()[2] - 0.1 - gap
    ground = body("ground", Box((3.0, 3.0, 0.2)), (0, 0, top - 0.1), mass=0.0)
    assert sample_hz(PANDA, stick(0.02), turn(0.5), Scene((ground,))) == hz


@pytest.mark.parametrize(
    ("block", "others", "joints", "hz"),
    [
        ({"mass": 0.0}, {}, (), 25.0),  # stays where it is
        ({"mass": 1.0}, {}, (), 100.0),  # may be pushed along
        ({"mass": 0.0}, {"velocity": (3.0, 0.0, 0.0)}, (), 100.0),
        ({"mass": 0.0}, {}, (Joint("pivot", "hinge", "ball"),), 100.0),  # may swing
    ],
)
def test_speed_counts_wherever_something_may_move(block, others, joints, hz):
    """A slow way past a block, and then a fast one through the air."""
    where = stick_at_home()
    beside = body("block", Box((0.1, 0.1, 0.1)), where, **block)
    ball = replace(body("ball", Sphere(0.03), (0, 2.0, 1.0)), **others)
    arm = np.array([ARM.home] * 3)
    arm[:, 0] += [0.0, 0.7, 1.7]
    motion = JointTrajectory(np.array([0.0, 7.0, 7.5]), arm, np.zeros(3))
    scene = Scene((beside, ball), joints)
    assert sample_hz(PANDA, stick(0.02), motion, scene) == hz


def stick_at_home():
    """The middle of the stick as the arm begins (3,)."""
    model = robot_model(PANDA, stick(0.02))
    rotations, positions = model.place_joints(
        model.order(np.array([ARM.home]), np.zeros((1, len(PANDA.finger_joints))))
    )
    (solid,) = tool_solids(PANDA, stick(0.02))
    frame = solid.frame
    return positions[frame, 0] + rotations[frame, 0] @ solid.pose.position


def test_samples_are_added_where_they_are_wanted():
    film = recording(
        Scene((WALL, body("thing", Box((0.03, 0.03, 0.03)), (0.2, 0, 0.25)))),
        path(161),
        hz=400.0,
    )
    few = coarse_samples(film)
    assert few.tolist() == list(range(0, 161, 16))
    wanted = np.ones(10)
    wanted[3], wanted[5] = 3.0, 1000.0
    more = refined_samples(few, wanted)
    assert sorted(set(more) - set(few)) == [52, 56, 60, *range(81, 96)]
    assert np.array_equal(subset(film, more).times, film.times[more])
    assert np.array_equal(
        subset(film, more).states.positions, film.states.positions[more]
    )


def path(count):
    return {"thing": straight((0.2, 0.0, 0.25), (0.8, 0.0, 0.25), count)}


def test_what_happens_between_two_rough_samples_is_found():
    """There and back through a wall within 1/25 s, and nothing of it at the rate of `SAMPLE_HZ`."""
    thing = body("thing", Box((0.03, 0.03, 0.03)), (0.4, 0, 0.25))
    scene = Scene((WALL, thing))
    still = straight((0.4, 0, 0.25), (0.4, 0, 0.25), 64)
    there = np.vstack(
        [
            straight((0.4, 0, 0.25), (0.6, 0, 0.25), 8),
            straight((0.6, 0, 0.25), (0.4, 0, 0.25), 8),
        ]
    )
    film = recording(scene, {"thing": np.vstack([still, there, still])}, hz=400.0)
    (found,) = findings(scene, PANDA, stick(0.02), film)
    assert "passed through 'wall'" in found.text
    assert (
        findings(
            scene,
            PANDA,
            stick(0.02),
            subset(film, np.arange(0, 144, round(400 / SAMPLE_HZ))),
        )
        == []
    )


def test_forces_are_averaged_over_the_time_since_the_sample_before():
    film = recording(
        Scene((body("thing", Box((0.03, 0.03, 0.03)), (0.2, 0, 0.25)),)),
        path(5),
        hz=100.0,
    )
    film = replace(
        film, forces={("tool", "thing"): np.array([1.0, 2.0, 4.0, 8.0, 16.0])}
    )
    for samples, means in (
        ([0, 2, 4], [1, 3, 12]),
        ([0, 1, 2, 3, 4], [1, 2, 4, 8, 16]),
        ([0, 4], [1, 7.5]),
    ):
        assert subset(film, np.array(samples)).forces["tool", "thing"] == pytest.approx(
            means
        )
