"""An arm without a spare joint passes its singularities without a jump, and reports by how much it misses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from core.geometry import Pose
from core.interfaces import Waypoints
from core.plugins import installed
from core.robot.kinematics import arm_of
from core.robot.trajectory import plan_motion

HOME = Pose.xyz_rpy((0.45, 0.0, 0.4))


@pytest.fixture(scope="module")
def arm():
    return arm_of(installed().create("robot", "ur5"))


def deviation(arm, plan, joints):
    """How far the mount is from the straight way between two waypoints, at most: metres and radians."""
    share = np.linspace(0, 1, 500)[:, None]
    start, end = Rotation.from_euler("xyz", plan[:, 3:6])
    turned = start * Rotation.from_rotvec(share * (start.inv() * end).as_rotvec())
    points = plan[0, :3] + share * (plan[1, :3] - plan[0, :3])
    far = np.zeros(2)
    for pose in map(arm.forward, joints):
        ways, angles = (
            np.linalg.norm(points - pose.position, axis=1),
            (turned.inv() * pose.rotation).magnitude(),
        )
        nearest = np.argmin(ways + 0.3 * angles)
        far = np.maximum(far, (ways[nearest], angles[nearest]))
    return far


def last_way(motion):
    """The joints (T, J) from the first waypoint on."""
    return motion.trajectory.arm[motion.trajectory.times >= motion.arrivals[0]]


# Through the wrist's singularity (joint 5 at 0), and past it by less than five degrees.
WAYS = (
    ((0.40, -0.20, 0.40, np.pi / 2, 0.0, 0.0), (0.40, 0.25, 0.40, np.pi / 2, 0.0, 0.0)),
    (
        (0.40, -0.20, 0.40, np.pi / 2, 0.03, 0.0),
        (0.40, 0.25, 0.40, np.pi / 2, 0.03, 0.0),
    ),
    ((0.40, -0.20, 0.30, 1.4, 0.1, 0.2), (0.40, 0.20, 0.40, 1.7, -0.1, -0.2)),
)


@pytest.mark.parametrize("way", WAYS)
def test_a_line_past_the_wrists_singularity(arm, way):
    plan = np.array(way)
    motion = plan_motion(Waypoints(plan), HOME, arm)
    joints = last_way(motion)
    assert np.abs(joints[:, 4]).min() < 0.08, "the way is not near the singularity"
    metres, radians = deviation(arm, plan, joints)
    assert metres < motion.misses[1, 0] + 0.003
    assert radians < motion.misses[1, 1] + 0.01
    assert motion.misses[1, 0] < 0.02
    assert no_joint_jumps(arm, motion)


def no_joint_jumps(arm, motion):
    steps = (
        np.abs(np.diff(motion.trajectory.arm, axis=0))
        / np.diff(motion.trajectory.times)[:, None]
    )
    return bool((steps <= arm.velocity_limits).all())


def test_from_knot_to_knot_no_joint_turns_by_more_than_the_limit(arm):
    """The tool's axis swings past that of joint 4, which is to turn by half a turn at once."""
    angles = np.arange(0.0, 1.2, 0.1)
    turns = Rotation.from_euler(
        "xyz", [(0.97 + angle, 0.02, -0.4) for angle in angles]
    ).as_matrix()
    points = np.tile((0.45, 0.0, 0.4), (len(angles), 1))
    start = arm.inverse(
        Pose.from_rotation(points[0], Rotation.from_matrix(turns[0])),
        arm.home_for(HOME),
    ).joints
    free, _ = arm.follow(points, turns, start)
    kept, errors = arm.follow(points, turns, start, arm.jump_rad)
    assert np.abs(np.diff(free, axis=0)).max() > arm.jump_rad
    assert np.abs(np.diff(kept, axis=0)).max() <= arm.jump_rad + 1e-12
    assert 0.001 < errors[:, 1].max() < 0.2
    assert errors[-1].max() < 1e-3, "behind the singularity it is back on its way"
