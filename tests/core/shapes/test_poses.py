import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from core.geometry import Pose

lengths = st.floats(-10, 10)
vectors = st.tuples(lengths, lengths, lengths)
angles = st.floats(-math.pi, math.pi)
turns = st.tuples(angles, angles, angles)
poses = st.builds(Pose.xyz_rpy, vectors, turns)


def turn(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array(
        {
            "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
            "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
        }[axis]
    )


@given(vectors, turns)
def test_roll_pitch_yaw_are_turns_about_the_fixed_axes_as_in_urdf(xyz, rpy):
    roll, pitch, yaw = rpy
    matrix = Pose.xyz_rpy(xyz, rpy).matrix
    np.testing.assert_allclose(
        matrix[:3, :3], turn("z", yaw) @ turn("y", pitch) @ turn("x", roll), atol=1e-12
    )
    np.testing.assert_array_equal(matrix[:, 3], [*xyz, 1])
    np.testing.assert_array_equal(matrix[3], [0, 0, 0, 1])


@given(poses)
def test_the_inverse_undoes(pose):
    np.testing.assert_allclose(
        pose.inverse().matrix, np.linalg.inv(pose.matrix), atol=1e-11
    )
    np.testing.assert_allclose((pose.inverse() @ pose).matrix, np.eye(4), atol=1e-11)


@given(vectors, turns)
def test_there_and_back_by_roll_pitch_yaw(xyz, rpy):
    # Beyond, other angles name the same orientation.
    assume(abs(rpy[1]) < math.pi / 2 - 1e-3)
    pose = Pose.xyz_rpy(xyz, rpy)
    difference = np.subtract(pose.rpy, rpy)
    np.testing.assert_allclose(np.angle(np.exp(1j * difference)), 0, atol=1e-9)


ANGLES = (0.0, -0.0, 1e-9, np.pi / 2, -np.pi / 2, np.pi, 1.5708, 3.1416)


def draw_pose(rng):
    """Draw a pose, and SciPy's rotation of it; every third angle is a special one."""
    special = rng.choice(ANGLES, 3)
    rpy = np.where(rng.random(3) < 1 / 3, special, rng.normal(0, 2, 3))
    pose = Pose.xyz_rpy(rng.normal(size=3), rpy)
    known = Rotation.from_euler("xyz", rpy).as_quat(scalar_first=True)
    assert (pose.quaternion == known / np.linalg.norm(known)).all()

    return pose, Rotation.from_quat(pose.quaternion, scalar_first=True)


@pytest.mark.filterwarnings("ignore:Gimbal lock")
def test_poses_turn_as_scipys_rotations_do_to_the_last_bit():
    rng = np.random.default_rng(0)

    for _ in range(300):
        pose, rotation = draw_pose(rng)
        other, others_rotation = draw_pose(rng)
        both = (rotation * others_rotation).as_quat(scalar_first=True)
        back = rotation.inv().as_quat(scalar_first=True)

        assert (pose.rotation_matrix == rotation.as_matrix()).all()
        assert (pose.rpy == rotation.as_euler("xyz")).all()
        assert ((pose @ other).quaternion == both / np.linalg.norm(both)).all()
        assert (pose.inverse().quaternion == back / np.linalg.norm(back)).all()


def test_quaternions_are_scalar_first_and_of_length_one():
    quarter = Pose.xyz_rpy((0, 0, 0), (0, 0, math.pi / 2))
    np.testing.assert_allclose(
        np.abs(quarter.quaternion), [math.sqrt(0.5), 0, 0, math.sqrt(0.5)], atol=1e-12
    )
    np.testing.assert_allclose(
        Pose(np.zeros(3), np.array([0.0, 0, 3, 0])).quaternion, [0, 0, 1, 0]
    )
    np.testing.assert_allclose(
        Pose(np.zeros(3), np.array([0.0, 0, 3, 0])).apply([1, 2, 3]),
        [-1, 2, -3],
        atol=1e-12,
    )


def test_equal_poses_are_one_key():
    one, same, other = (Pose.xyz_rpy((1, 0, x), (0, 0, 1)) for x in (0, 0, 1e-9))
    assert one == same
    assert hash(one) == hash(same)
    assert len({one, same, other}) == 2
    assert one != "a pose"


@pytest.mark.parametrize(
    ("position", "quaternion", "reason"),
    [
        ([0, 0], [1, 0, 0, 0], r"shape \(3,\), got \(2,\)"),
        ([0, 0, 0], [1, 0, 0], r"shape \(4,\), got \(3,\)"),
        ([0, 0, math.nan], [1, 0, 0, 0], "finite"),
        ([0, 0, math.inf], [1, 0, 0, 0], "finite"),
        ([0, 0, 0], [math.nan, 0, 0, 0], "finite"),
        ([0, 0, 0], [0, 0, 0, 0], "length zero"),
    ],
)
def test_what_is_no_pose(position, quaternion, reason):
    with pytest.raises(ValueError, match=reason):
        Pose(np.array(position), np.array(quaternion))
