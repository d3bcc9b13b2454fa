import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.errors import UserError
from core.geometry import Pose
from core.robot import kinematics
from tests.support.panda import ARM, HOME_JOINTS

seeds = st.integers(0, 2**32 - 1)


def miss(solution, pose):
    """Metres and radians between where the joints lead and where they ought to."""
    reached = ARM.forward(solution.joints)
    return np.linalg.norm(reached.position - pose.position), (
        reached.rotation.inv() * pose.rotation
    ).magnitude()


def within_limits(joints):
    return bool(((ARM.lower <= joints) & (joints <= ARM.upper)).all())


def test_home():
    assert ARM.home.tolist() == list(HOME_JOINTS)
    assert within_limits(ARM.home)
    np.testing.assert_allclose(ARM.forward(ARM.home).position, [0.5, 0, 0.5], atol=1e-3)


def test_positions_are_forward_of_each_row():
    joints = np.random.default_rng(0).uniform(ARM.lower, ARM.upper, (5, 7))
    np.testing.assert_array_equal(
        ARM.positions(joints), [ARM.forward(q).position for q in joints]
    )
    assert ARM.positions(joints[:0]).shape == (0, 3)


def test_the_workspace_in_front_is_reached_from_home():
    for x in (0.35, 0.5, 0.65):
        for y in (-0.3, 0, 0.3):
            for z in (0.1, 0.3, 0.5):
                for rpy in ((0, 0, 0), (0.3, -0.3, 0.5)):
                    pose = Pose.xyz_rpy((x, y, z), rpy)
                    solution = ARM.inverse(pose, ARM.home)
                    assert solution.error_m < 1e-4, pose
                    assert max(miss(solution, pose)) < 1e-3


coordinates = st.floats(-3, 3)
angles = st.floats(-10, 10)


@settings(max_examples=200)
@given(
    st.tuples(coordinates, coordinates, coordinates),
    st.tuples(angles, angles, angles),
    seeds,
)
def test_whatever_is_asked_for_limits_hold_and_the_miss_is_told_truthfully(
    xyz, rpy, seed
):
    pose = Pose.xyz_rpy(xyz, rpy)
    start = np.random.default_rng(seed).uniform(ARM.lower, ARM.upper)
    solution = ARM.inverse(pose, start)
    assert within_limits(solution.joints)
    metres, radians = miss(solution, pose)
    assert solution.error_m == pytest.approx(metres, abs=1e-9)
    assert solution.error_rad == pytest.approx(radians, abs=1e-6)
    worse = miss(type(solution)(start, 0.0, 0.0), pose)
    # Never worse than the seed.
    assert (
        metres**2 + (0.3 * radians) ** 2
        <= worse[0] ** 2 + (0.3 * worse[1]) ** 2 + 1e-12
    )


def test_a_home_out_of_reach():
    with pytest.raises(
        UserError,
        match=r"robot panda can't reach the task's home \(2, 0, 0\), by 1\.\d\d\d m",
    ):
        ARM.home_for(Pose.xyz_rpy((2, 0, 0)))


@pytest.mark.slow
def test_work_is_bounded_for_poses_out_of_reach(monkeypatch):
    """Poses flip inside the base, where no step gets near: few steps are left for the last ones."""
    count = 6000
    positions = np.zeros((count, 3))
    positions[1::2, 2] = 0.4
    flips = np.array(
        [
            Pose.xyz_rpy((0.0, 0.0, 0.0), (3.1 * k, 3.1 * k, 0.0)).rotation.as_matrix()
            for k in (0, 1)
        ]
    )
    rotations = flips[np.arange(count) % 2]
    calls = []
    measure = type(ARM)._miss
    monkeypatch.setattr(
        type(ARM), "_miss", lambda *given: calls.append(1) or measure(*given)
    )
    joints, errors = ARM.follow(positions, rotations, ARM.home)
    assert len(calls) < kinematics._MAX_STEPS_ALL + (kinematics._FEW_STEPS + 2) * count
    assert within_limits(joints)
    assert errors[-2:, 0].min() > 0.01
    calls.clear()
    first, _ = ARM.follow(positions[:100], rotations[:100], ARM.home)
    np.testing.assert_array_equal(first, joints[:100])
    assert len(calls) > 1000
