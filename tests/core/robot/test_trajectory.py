import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from core.geometry import Pose
from core.interfaces import Waypoints
from core.robot.trajectory import plan_motion
from tests.support.panda import ARM, FINGER_OPEN, PANDA

pytestmark = pytest.mark.slow

HOME = Pose.xyz_rpy((0.5, 0, 0.5))
PLAN = np.array(
    [
        [0.6, 0.0, 0.3, 0, 0, 0],
        [0.6, 0.2, 0.3, 0, 0.3, 0],
        [0.45, -0.2, 0.2, 0, 0, 1.0],
        [0.45, -0.2, 0.2, 0, 0, -0.5],
        [0.45, -0.2, 0.2, 0, 0, -0.5],
        [0.6, 0, 0.45, 0, -0.4, 0],
    ]
)


def plan_of(plan, **how):
    return plan_motion(Waypoints(np.asarray(plan, dtype=float)), HOME, ARM, **how)


def segments(plan, **how):
    """Find the time at which each waypoint's segment ends: plans are causal, so a plan cut short shows it."""
    ends = [plan_of(plan[: k + 1], **how).trajectory.duration for k in range(len(plan))]
    return list(zip([0.0, *ends], ends, strict=False))


def random_plan(seed, low, high, angle, columns=6):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 6))
    plan = np.column_stack(
        [rng.uniform(low, high, (count, 3)), rng.uniform(-angle, angle, (count, 3))]
    )
    return plan if columns == 6 else np.column_stack([plan, rng.uniform(0, 1, count)])


def reachable_plan(seed):
    return random_plan(seed, (0.4, -0.3, 0.1), (0.65, 0.3, 0.5), 0.3)


def wild_plan(seed):
    return random_plan(seed, -0.9, 0.9, 3.0, 7 if seed % 2 else 6)


def rates(trajectory):
    """Largest joint speed and acceleration by finite differences, as shares of the arm's limits."""
    step = np.diff(trajectory.times)[:, None]
    speed = np.diff(trajectory.arm, axis=0) / step
    speed = np.vstack([np.zeros(7), speed, np.zeros(7)])  # at rest before and after
    between = np.vstack([step[:1], (step[1:] + step[:-1]) / 2, step[-1:]])
    change = np.diff(speed, axis=0) / between
    return (np.abs(speed) / ARM.velocity_limits).max(), (
        np.abs(change) / PANDA.acceleration_limits
    ).max()


# --- where it goes ----------------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(st.integers(0, 10**6).map(reachable_plan))
def test_waypoints_are_reached(plan):
    motion = plan_of(plan)
    assert motion.misses[:, 0].max() < 1e-4
    assert motion.misses[:, 1].max() < 1e-3
    for (_, end), waypoint in zip(segments(plan), plan, strict=True):
        joints, _ = motion.trajectory.sample(np.array([end]))
        target = Pose.xyz_rpy(waypoint[:3], waypoint[3:6])
        reached = ARM.forward(joints[0])
        assert np.linalg.norm(reached.position - target.position) < 1e-3
        assert (reached.rotation.inv() * target.rotation).magnitude() < 2e-3


def test_the_arm_does_not_get_stuck_at_its_limits_on_the_way():
    """Each of these is in reach from home; the seven joints must not drift until one after another can't go on."""
    plan = np.array(
        [
            [0.427, -0.076, 0.182, -0.030, -0.467, -0.294],
            [0.490, -0.028, 0.132, -0.213, -0.247, 0.278],
            [0.645, -0.271, 0.439, 0.369, 0.314, -0.213],
            [0.470, 0.240, 0.168, -0.191, 0.002, 0.268],
        ]
    )
    for waypoint in plan:
        assert (
            ARM.inverse(Pose.xyz_rpy(waypoint[:3], waypoint[3:]), ARM.home).error_m
            < 1e-4
        )
    assert plan_of(plan).misses[:, 0].max() < 1e-3


def test_it_stands_still_at_each_waypoint():
    trajectory = plan_of(PLAN).trajectory
    for _, end in segments(PLAN):
        joints, _ = trajectory.sample(np.array([end - 0.01, end, end + 0.01]))
        assert (
            np.abs(np.diff(joints, axis=0)) / 0.01
        ).max() < 0.25  # rad/s, and the joints go up to 2.5


@settings(max_examples=25)
@given(st.integers(0, 10**6).map(reachable_plan))
def test_between_waypoints_positions_go_straight_and_orientations_by_slerp(plan):
    trajectory = plan_of(plan).trajectory
    stops = [HOME, *(Pose.xyz_rpy(waypoint[:3], waypoint[3:6]) for waypoint in plan)]
    for (begin, end), a, b in zip(segments(plan), stops, stops[1:], strict=False):
        joints, _ = trajectory.sample(np.linspace(begin, end, 60))
        way = b.position - a.position
        length = np.linalg.norm(way)
        whole = a.rotation.inv() * b.rotation
        progress = []
        for pose in map(ARM.forward, joints):
            done = float(np.clip((pose.position - a.position) @ way / length**2, 0, 1))
            progress.append(done)
            assert np.linalg.norm(pose.position - (a.position + done * way)) < 2e-3
            due = a.rotation * Rotation.from_rotvec(done * whole.as_rotvec())
            assert (
                pose.rotation.inv() * due
            ).magnitude() < 0.01 + 2e-3 / length * whole.magnitude()
        assert progress[-1] == pytest.approx(1, abs=1e-3 / length)
        assert (np.diff(progress) > -1e-4 / length).all()  # never back


# --- how fast ---------------------------------------------------------------------------------------------------


def check_limits(trajectory):
    assert (np.diff(trajectory.times) > 0).all()
    assert ((ARM.lower <= trajectory.arm) & (trajectory.arm <= ARM.upper)).all()
    assert ((trajectory.fingers >= 0) & (trajectory.fingers <= FINGER_OPEN)).all()
    speed, acceleration = rates(trajectory)
    assert speed < 1.01
    assert acceleration < 1.02


@settings(max_examples=100)
@given(st.integers(0, 10**6).map(reachable_plan) | st.integers(0, 10**6).map(wild_plan))
def test_limits_hold_whatever_is_asked_for(plan):
    check_limits(plan_of(plan).trajectory)


def test_a_fast_plan_makes_use_of_the_limits():
    trajectory = plan_of(PLAN, segment_s=0.01).trajectory
    check_limits(trajectory)
    speed, acceleration = rates(trajectory)
    assert max(speed, acceleration) > 0.6


@pytest.mark.parametrize("segment_s", [0.2, 0.5, 2.0])
def test_segments_last_as_long_as_asked_or_longer(segment_s):
    tiny = np.array(
        [[0.5, 0, 0.5, 0, 0, 0], [0.501, 0, 0.5, 0, 0, 0], [0.501, 0, 0.5, 0, 0, 0.01]]
    )
    for begin, end in segments(tiny, segment_s=segment_s):
        assert segment_s * 0.999 <= end - begin < segment_s * 1.05
    for begin, end in segments(PLAN, segment_s=segment_s):
        assert end - begin >= segment_s * 0.999


# --- the gripper ------------------------------------------------------------------------------------------------


def test_fingers_move_linearly_with_the_segment():
    grips = [0, 1, 1, 0.25, 0, 0]
    plan = np.column_stack([PLAN, grips])
    trajectory = plan_of(plan).trajectory
    for (begin, end), before, after in zip(
        segments(plan), [0, *grips], grips, strict=False
    ):
        _, fingers = trajectory.sample(np.linspace(begin, end, 11))
        expected = FINGER_OPEN * (1 - np.linspace(before, after, 11))
        np.testing.assert_allclose(fingers, expected, atol=1e-6)


# --- what is known beforehand -----------------------------------------------------------------------------------


@settings(max_examples=25)
@given(st.integers(0, 10**6).map(reachable_plan))
def test_distance_is_the_length_of_the_way_from_home(plan):
    polyline = np.linalg.norm(
        np.diff([HOME.position, *plan[:, :3]], axis=0), axis=1
    ).sum()
    assert plan_of(plan).distance_m == pytest.approx(polyline, rel=1e-3, abs=1e-4)


@pytest.mark.parametrize("x", [1.0, 1.5])
def test_out_of_reach_the_miss_is_told(x):
    plan = np.array(
        [[0.6, 0, 0.3, 0, 0, 0], [x, 0, 0.3, 0, 0, 0], [0.6, 0, 0.3, 0, 0, 0]]
    )
    motion = plan_of(plan)
    (_, end) = segments(plan)[1]
    joints, _ = motion.trajectory.sample(np.array([end]))
    there = np.linalg.norm(ARM.forward(joints[0]).position - plan[1, :3])
    assert motion.misses[:, 0].max() >= there - 1e-4
    assert there > 0.05
    there_from_home = np.linalg.norm(plan[0, :3] - HOME.position)
    # As far as it came, not as far as it was sent.
    assert motion.distance_m < there_from_home + 2 * (x - 0.6) - 0.1


def test_a_miss_on_the_way_from_home_to_the_first_waypoint_does_not_count():
    """The straight line there leads through the arm's base, where it can't be."""
    behind = [[-0.5, 0, 0.5, 0, 0, np.pi]]
    alone = ARM.inverse(
        Pose.xyz_rpy(behind[0][:3], behind[0][3:]), plan_of(behind).trajectory.arm[-1]
    )
    assert plan_of(behind).misses[:, 0].max() == pytest.approx(alone.error_m, abs=1e-3)
