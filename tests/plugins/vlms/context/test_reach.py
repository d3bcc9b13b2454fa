from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from core.geometry import Pose
from core.interfaces import Waypoints
from core.plugins import installed
from core.robot.kinematics import arm_of
from core.robot.trajectory import plan_motion
from plugins.vlms.context.reach import PITCHES, compute_reach, span_at, turns_at
from tests.support.panda import ARM, PANDA

HOME = Pose.xyz_rpy((0.5, 0.0, 0.5))


@cache
def reach():
    return compute_reach(ARM)


def missed(*waypoints):
    """Metres and radians by which a motion from home misses these waypoints: x, y, z, pitch, yaw."""
    plan = np.array([[x, y, z, 0.0, pitch, yaw] for x, y, z, pitch, yaw in waypoints])
    motion = plan_motion(Waypoints(plan), HOME, ARM)
    return tuple(motion.misses.max(axis=0))


@pytest.mark.parametrize("azimuth", [0.0, 1.3, -1.3])
@pytest.mark.parametrize(
    ("height", "pitch"), [(0.0, -0.5), (0.1, 0.0), (0.3, 0.5), (0.5, -0.8), (0.5, 0.8)]
)
def test_a_motion_reaches_both_edges_in_every_direction(height, pitch, azimuth):
    span = reach()[height][pitch]
    x, y = np.cos(azimuth), np.sin(azimuth)
    middle = (span.least + span.most) / 2
    way = [
        (r * x, r * y, height, pitch, azimuth)
        for r in (middle, span.most, max(span.least, 0.02))
    ]
    error_m, error_rad = missed(*way)
    assert error_m < 0.005
    assert error_rad < 0.03


@pytest.mark.parametrize("pitch", PITCHES)
@pytest.mark.parametrize("height", [0.1, 0.4, 0.8])
def test_no_other_posture_reaches_farther(height, pitch):
    """From thirty random postures: the outer edge is the arm's, not that of one way to it."""
    beyond = Pose.xyz_rpy(
        (reach()[height][pitch].most + 0.05, 0.0, height), (0.0, pitch, 0.0)
    )
    rng = np.random.default_rng(0)
    found = [ARM.inverse(beyond, rng.uniform(ARM.lower, ARM.upper)) for _ in range(30)]
    assert min(one.error_m + one.error_rad for one in found) > 0.01


@pytest.mark.parametrize("at", [(0.3, -0.2, 0.0), (0.0, 0.0, 0.9), (0.1, 0.2, -0.1)])
def test_the_reach_is_that_of_the_base(at):
    """Distances go from its axis, ahead of it; heights are the world's."""
    elsewhere = arm_of(replace(PANDA, base=Pose.xyz_rpy(at, (0.0, 0.0, 0.7))))
    moved = compute_reach(elsewhere, (0.0,))
    # Low ones are out of reach.
    assert min(moved) == {0.0: 0.0, 0.9: 0.6, -0.1: 0.0}[at[2]]
    for height, row in moved.items():
        if (own := round(height - at[2], 1)) in reach():
            assert row[0.0] == reach()[own][0.0]


def test_an_arm_of_six_joints():
    arm = arm_of(installed().create("robot", "ur5"))
    found = compute_reach(arm, (0.0, 0.5))
    assert found[0.1][0.0].most == pytest.approx(0.9, abs=0.03)
    pose = Pose.xyz_rpy((found[0.1][0.5].most, 0.0, 0.1), (0.0, 0.5, 0.0))
    assert arm.inverse(pose, arm.home).error_m < 0.004


def test_a_way_out_ends_where_the_arm_meets_itself():
    """Two centimetres farther, where the inverse kinematics still goes, the wrist is in the forearm."""
    arm = arm_of(installed().create("robot", "kinova"))
    span = span_at(arm, 0.5, 0.8)
    assert (span.least, span.most) == (0.0, pytest.approx(0.54))


def test_turns_at_home_end_where_they_say():
    turns = turns_at(ARM, HOME)
    for axis, (least, most) in zip("xyz", turns, strict=True):
        for angle, step in ((least, -0.15), (most, 0.15)):
            seed = ARM.home_for(HOME)
            for share in np.linspace(0.0, 1.0, 40):
                solution = ARM.inverse(
                    Pose.from_rotation(
                        HOME.position, Rotation.from_euler(axis, share * angle)
                    ),
                    seed,
                )
                seed = solution.joints
                assert solution.error_rad < 0.02, (axis, angle)
            if abs(angle) < 3.0:
                beyond = Rotation.from_euler(axis, angle + step)
                assert (
                    ARM.inverse(
                        Pose.from_rotation(HOME.position, beyond), seed
                    ).error_rad
                    > 0.02
                ), (axis, angle)
