"""PyBullet as rollouts see it: what is asked of the physics, not how it is had."""

import hashlib
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from core.design import Candidate, Component, Tool
from core.errors import UserError
from core.geometry import Box, Cylinder, Mesh, Pose, Sphere
from core.interfaces import JointTrajectory, Rollout, RolloutSettings, Task
from core.kinematics import arm
from core.plugins import installed
from core.robot import FINGER_OPEN
from core.rollout import prepare
from core.scene import Body, Part, Scene, table
from core.trajectory import plan_motion

pytest.importorskip("pybullet")

ROOT = Path(__file__).parents[3]
GREY = (0.5, 0.5, 0.5, 1)
FAR = np.array([3.0, 3.0, 0.0])  # from the arm
HOME = Pose.xyz_rpy((0.5, 0, 0.5))
STILL = JointTrajectory(np.zeros(1), arm().home_for(HOME)[None], np.array([FINGER_OPEN]))
SIM = installed().create("sim", "pybullet")


class World(Task):
    """A task of these bodies."""

    description = "Bodies."
    goals = ()

    def __init__(self, *bodies, name="World"):
        self.name = name
        self._scene = Scene(bodies)

    def scene(self, seed):
        return self._scene

    def reward(self, start, end):
        return np.zeros(start.positions.shape[:-2])


def cube(name="cube", at=(0.0, 0.0, 0.0), side=0.1, mass=1.0, **how):
    return Body.of(name, Box((side, side, side)), at, mass=mass, color=GREY, **how)


def compound(name, *parts, at, mass, friction=0.5, rpy=(0, 0, 0)):
    return Body(name, Pose.xyz_rpy(at, rpy), mass, parts, parts, friction)


def part(shape, *at, rpy=(0, 0, 0)):
    return Part(shape, Pose.xyz_rpy(at, rpy))


def stick(length, mass=0.005):
    pose = Pose(np.array([0, 0, -length / 2]))
    return Tool((Component("stick", "panda_virtual", pose, Box((0.02, 0.02, length)), mass),))


def wait(*bodies, seconds=1.0, settle_s=0.0, record_hz=0.0, tool=Tool(), sim=SIM):  # noqa: B008
    """What becomes of bodies while the arm stays home."""
    job = Rollout(tool, STILL, settle_s=settle_s, hold_s=seconds, record_hz=record_hz)
    (outcome,) = sim.rollout(World(*bodies), [job])
    assert outcome.error is None
    return outcome


def move(plan, *bodies, tool=Tool(), record_hz=0.0, sim=SIM, hold_s=0.5):  # noqa: B008
    motion = plan_motion(np.array(plan, dtype=float), HOME, arm())
    job = Rollout(tool, motion.trajectory, settle_s=0.1, hold_s=hold_s, record_hz=record_hz)
    (outcome,) = sim.rollout(World(*bodies), [job])
    assert outcome.error is None
    return outcome


def angle_between(one, other):
    return (one.rotation.inv() * other.rotation).magnitude()


# --- the same again ---------------------------------------------------------------------------------------------

PULL = [[0.755, 0, 0.5, 0, 0, 0], [0.755, 0, 0.32, 0, 0, 0], [0.6, 0.05, 0.32, 0, 0, 0]]  # from behind the third book


def digest(name, length=0.25, sim=SIM):
    """Of all that a rollout of a stick in a task tells."""
    task = installed().create("task", name)
    _, job = prepare(task, Candidate(stick(length), np.array(PULL, dtype=float)), 0, RolloutSettings())
    (outcome,) = sim.rollout(task, [job])
    states = (outcome.start, outcome.end)
    numbers = [x for s in states for x in (s.positions, s.quaternions, s.linear_velocities, s.angular_velocities)]
    moved = np.abs(outcome.end.positions - outcome.start.positions).max()
    return hashlib.sha256(np.concatenate([x.ravel() for x in numbers]).tobytes()).hexdigest(), moved


def test_the_same_job_gives_the_same_outcome_to_the_last_bit():
    first, moved = digest("OneBook")
    assert moved > 0.05  # contacts, and many of them
    assert digest("OneBook")[0] == first  # at once
    digest("BringCube", 0.1)
    digest("OneBook", 0.2)
    wait(table(), cube(at=(0.5, 0, 0.3)), tool=Tool(gripper=True))
    assert digest("OneBook")[0] == first  # after other tools and tasks
    assert digest("OneBook", sim=installed().create("sim", "pybullet"))[0] == first  # in another simulator
    code = "from tests.plugins.simulators.test_pybullet import digest; print(digest('OneBook')[0])"
    again = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert again.stdout.strip() == first  # in a fresh process


def test_jobs_in_a_batch_do_not_touch_each_other():
    task = World(table(), cube(at=(0.6, 0, 0.05)), name="Batch")
    push = plan_motion(np.array([[0.45, 0, 0.3, 0, 0, 0], [0.65, 0, 0.3, 0, 0, 0]]), HOME, arm()).trajectory
    jobs = [Rollout(stick(0.25), push), Rollout(Tool(), STILL), Rollout(stick(0.25), push)]
    first, idle, last = SIM.rollout(task, jobs)
    assert np.array_equal(first.end.positions, last.end.positions)
    assert first.end.position("cube")[0] > 0.65
    np.testing.assert_allclose(idle.end.position("cube"), [0.6, 0, 0.05], atol=1e-3)
    assert SIM.rollout(task, []) == []


# --- the arm ----------------------------------------------------------------------------------------------------


def lowest(tool, joints):
    """Metres above the table of the lowest corner of a rigid tool, over a recording (T, 7)."""
    corners = [
        pose.apply(component.shape.to_trimesh().vertices)
        for component in tool.components
        for _, pose in [tool.placed()[component.name]]
    ]
    return min(arm().forward(q).apply(np.concatenate(corners))[:, 2].min() for q in joints)


@pytest.mark.parametrize("xy", [(0.5, 0.0), (0.6, 0.2)])
def test_a_tool_cannot_be_pushed_through_the_table(xy):
    tool = stick(0.3)
    outcome = move([[*xy, 0.32, 0, 0, 0], [*xy, 0.25, 0, 0, 0]], table(), tool=tool, record_hz=100)
    assert lowest(tool, outcome.recording.arm) > -0.003
    assert lowest(tool, outcome.recording.arm[-1:]) < 0.005  # it did come down
    assert outcome.tracking_error_rad > 0.01  # and that shows


def test_a_thin_blade_cannot_be_pushed_through_the_table():
    shaft = stick(0.28).components[0]
    blade = Component("blade", "stick", Pose(np.array([0.05, 0, -0.14])), Box((0.15, 0.1, 0.003)))
    tool = Tool((shaft, blade))
    outcome = move([[0.5, 0, 0.32, 0, 0, 0], [0.5, 0, 0.23, 0, 0, 0]], table(), tool=tool, record_hz=100)
    assert lowest(tool, outcome.recording.arm) > -0.003


def test_a_body_cannot_be_pushed_through_the_table():
    outcome = move(
        [[0.5, 0, 0.45, 0, 0, 0], [0.5, 0, 0.3, 0, 0, 0]],
        table(),
        cube(at=(0.5, 0, 0.05)),
        tool=stick(0.3),
        record_hz=100,
    )
    assert outcome.recording.states.position("cube")[:, 2].min() > 0.047


def test_a_tool_cannot_be_swept_through_a_wall():
    wall = Body.of("wall", Box((0.4, 0.02, 0.4)), (0.5, 0, 0.2), mass=0, color=GREY)
    tool = stick(0.25)
    plan = [[0.5, -0.2, 0.4, 0, 0, 0], [0.5, 0.2, 0.4, 0, 0, 0]]
    joints = move(plan, wall, tool=tool, record_hz=100).recording.arm
    tips = np.array([arm().forward(q).apply([0, 0, -0.25])[1] for q in joints])
    begun = int(np.argmin(tips))
    assert tips[begun] < -0.15
    assert tips[begun:].max() < 0  # half the wall and half the stick are 0.02


@pytest.mark.parametrize("tool", [Tool(), Tool(gripper=True), stick(0.3, mass=1.0)], ids=["bare", "hand", "1 kg"])
def test_joints_hold_against_gravity(tool):
    outcome = wait(seconds=3, tool=tool, record_hz=20)
    assert np.abs(outcome.recording.arm - STILL.arm[0]).max() < 2e-3
    assert outcome.tracking_error_rad < 2e-3


def test_the_arm_follows_its_trajectory():
    plan = [[0.6, 0.2, 0.3, 0, 0.3, 0], [0.5, -0.2, 0.4, 0, 0, 0.5]]
    motion = plan_motion(np.array(plan), HOME, arm())
    (outcome,) = SIM.rollout(World(name="Empty"), [Rollout(Tool(), motion.trajectory, hold_s=0.5, record_hz=100)])
    targets, _ = motion.trajectory.sample(outcome.recording.times)
    miss = np.abs(outcome.recording.arm - targets).max()
    assert miss < 0.02
    assert outcome.tracking_error_rad == pytest.approx(miss, rel=0.5, abs=2e-3)
    np.testing.assert_allclose(arm().forward(outcome.recording.arm[-1]).position, plan[-1][:3], atol=1e-3)


@pytest.mark.parametrize("time_step", [0.001, 0.004])
def test_tracking_does_not_depend_on_the_time_step(time_step):
    other = installed().create("sim", "pybullet", {"time_step": time_step})
    plan = [[0.6, 0.2, 0.3, 0, 0.3, 0], [0.6, -0.2, 0.3, 0, 0, 0.5]]
    bodies = table(), cube(at=(0.6, 0, 0.05))
    ours, theirs = (move(plan, *bodies, tool=stick(0.25), sim=sim, record_hz=10) for sim in (SIM, other))
    length = min(len(ours.recording.times), len(theirs.recording.times))
    assert np.abs(ours.recording.arm[:length] - theirs.recording.arm[:length]).max() < 0.03
    np.testing.assert_allclose(ours.end.position("cube"), theirs.end.position("cube"), atol=0.03)


@pytest.mark.parametrize("time_step", [0.001, 0.002, 0.004])
@pytest.mark.parametrize("rate", [20.0, 50.0])
def test_joints_close_in_on_their_targets_at_the_tracking_rate(time_step, rate):
    sim = installed().create("sim", "pybullet", {"time_step": time_step, "tracking_rate": rate})
    arms = STILL.arm + np.array([[0.0], [0.002]]) * np.eye(7)[0]  # the first joint's target jumps
    jump = JointTrajectory(np.array([0.0, 1e-4]), arms, np.full(2, FINGER_OPEN))
    (outcome,) = sim.rollout(World(name="Empty"), [Rollout(Tool(), jump, settle_s=0.1, hold_s=0.1, record_hz=250)])
    times, left = outcome.recording.times, arms[1, 0] - outcome.recording.arm[:, 0]
    first, last = np.searchsorted(times, [0.0119, 0.0319])
    found = np.log(left[first] / left[last]) / (times[last] - times[first])
    assert found == pytest.approx(rate, rel=0.1)


# --- the gripper ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("grip", [0.0, 0.5, 1.0])
def test_the_fingers_go_where_they_are_told(grip):
    outcome = move([[0.5, 0, 0.5, 0, 0, 0, grip]], tool=Tool(gripper=True), record_hz=10)
    np.testing.assert_allclose(outcome.recording.fingers[0], FINGER_OPEN, atol=1e-3)
    np.testing.assert_allclose(outcome.recording.fingers[-1], FINGER_OPEN * (1 - grip), atol=1e-3)


def test_the_gripper_lifts_a_cube():
    over = 0.1034 + 0.02  # the hand above the middle of what the fingertips hold
    plan = [[0.5, 0, z, 0, 0, 0, grip] for z, grip in ((over, 0), (over, 1), (0.4, 1))]
    held = cube(at=(0.5, 0, 0.02), side=0.04, mass=0.2)
    outcome = move(plan, table(), held, tool=Tool(gripper=True), record_hz=10, hold_s=2.0)
    assert outcome.end.position("cube")[2] == pytest.approx(0.4 - over + 0.02, abs=0.01)
    np.testing.assert_allclose(outcome.recording.fingers[-1], 0.02, atol=2e-3)
    dropped = move([*plan, [0.5, 0, 0.4, 0, 0, 0, 0]], table(), held, tool=Tool(gripper=True), hold_s=2.0)
    assert dropped.end.position("cube")[2] == pytest.approx(0.02, abs=1e-3)


# --- bodies -----------------------------------------------------------------------------------------------------


def test_free_fall():
    outcome = wait(cube(at=(3, 3, 5)), seconds=0.5)
    assert outcome.end.linear_velocity("cube")[2] == pytest.approx(-9.81 * 0.5, rel=1e-4)
    assert outcome.end.position("cube")[2] == pytest.approx(5 - 9.81 * 0.5**2 / 2, abs=9.81 * 0.5 * 0.002)
    np.testing.assert_allclose(outcome.end.position("cube")[:2], [3, 3], atol=1e-9)


@pytest.mark.parametrize(("one", "other"), [(0.5, 0.5), (0.1, 0.9), (1.0, 0.25)])
@pytest.mark.parametrize("steepness", [0.85, 1.15])
def test_friction_is_the_geometric_mean(one, other, steepness):
    mean = math.sqrt(one * other)
    tilt = math.atan(steepness * mean)
    slope = Body.of("slope", Box((4, 1, 0.1)), FAR, mass=0, color=GREY, rpy=(0, tilt, 0), friction=one)
    at = slope.pose.apply([0, 0, 0.05 + 0.02])
    block = Body.of("block", Box((0.2, 0.2, 0.04)), at, mass=1, color=GREY, rpy=(0, tilt, 0), friction=other)
    slid = np.linalg.norm(wait(slope, block, seconds=1.0).end.position("block") - at)
    due = 9.81 * (math.sin(tilt) - mean * math.cos(tilt)) / 2  # metres in the first second
    if steepness < 1:
        assert slid < 5e-3
    else:
        assert slid == pytest.approx(due, rel=0.15, abs=5e-3)


@pytest.mark.parametrize(("steepness", "rolls"), [(0.4, False), (3.0, True)])
def test_rolling_friction_is_an_arm(steepness, rolls):
    tilt = math.atan(steepness * 0.01 / 0.1)
    slope = Body.of("slope", Box((4, 1, 0.1)), FAR, mass=0, color=GREY, rpy=(0, tilt, 0), friction=1.0)
    at = slope.pose.apply([0, 0, 0.05 + 0.1])
    ball = Body.of("ball", Sphere(0.1), at, mass=1, color=GREY, friction=1.0, rolling_friction=0.01)
    rolled = np.linalg.norm(wait(slope, ball, seconds=2.0).end.position("ball") - at)
    assert (rolled > 0.2) if rolls else (rolled < 0.02)


def test_a_ball_rolls_without_slipping_as_fast_as_a_ball():
    tilt = 0.2
    slope = Body.of("slope", Box((4, 1, 0.1)), FAR, mass=0, color=GREY, rpy=(0, tilt, 0), friction=1.0)
    at = slope.pose.apply([0, 0, 0.15])
    outcome = wait(slope, Body.of("ball", Sphere(0.1), at, mass=3, color=GREY, friction=1.0), seconds=1.0)
    rolled = np.linalg.norm(outcome.end.position("ball") - at)
    assert rolled == pytest.approx(5 / 7 * 9.81 * math.sin(tilt) / 2, rel=0.05)  # a block would go 7/5 as far


def test_a_hollow_body_is_hollow():
    wall = 0.01
    parts = (
        part(Box((0.3, 0.3, wall)), 0, 0, wall / 2),
        *(part(Box((wall, 0.3, 0.2)), x, 0, 0.1) for x in (-0.145, 0.145)),
        *(part(Box((0.3, wall, 0.2)), 0, y, 0.1) for y in (-0.145, 0.145)),
    )
    inside = Body.of("ball", Sphere(0.03), (0.5, 0, 0.1), mass=0.1, color=GREY)
    for mass in (0.0, 0.5):
        end = wait(table(), compound("bin", *parts, at=(0.5, 0, 0), mass=mass), inside, seconds=1.0).end
        assert end.position("ball")[2] == pytest.approx(wall + 0.03, abs=2e-3)
        assert np.abs(end.position("ball")[:2] - [0.5, 0]).max() < 0.12
        if mass:
            np.testing.assert_allclose(end.position("bin"), [0.5, 0, 0], atol=1e-3)


def test_a_mesh_collides_as_its_convex_hull():
    """A trough, 0.1 high and open on top: what falls on it rests on the hull's lid."""
    trough = trimesh.util.concatenate(
        [
            trimesh.creation.box((0.3, 0.3, 0.02), trimesh.transformations.translation_matrix((0, 0, 0.01))),
            trimesh.creation.box((0.3, 0.02, 0.1), trimesh.transformations.translation_matrix((0, -0.14, 0.05))),
            trimesh.creation.box((0.3, 0.02, 0.1), trimesh.transformations.translation_matrix((0, 0.14, 0.05))),
        ]
    )
    body = compound("trough", Part(Mesh.from_trimesh(trough)), at=(0.5, 0, 0), mass=1.0)
    end = wait(table(), body, cube(at=(0.5, 0, 0.17), side=0.1), seconds=1.0).end
    assert end.position("cube")[2] == pytest.approx(0.15, abs=3e-3)
    np.testing.assert_allclose(end.position("trough"), [0.5, 0, 0], atol=2e-3)


@pytest.mark.parametrize(
    ("shape", "height"), [(Box((0.1, 0.2, 0.06)), 0.03), (Cylinder(0.05, 0.1), 0.05), (Sphere(0.04), 0.04)]
)
def test_shapes_rest_on_the_table_at_their_height(shape, height):
    body = Body.of("body", shape, (0.6, 0.1, height), mass=0.3, color=GREY, rpy=(0, 0, 0.4))
    end = wait(table(), body, seconds=2.0).end
    np.testing.assert_allclose(end.position("body"), [0.6, 0.1, height], atol=1e-3)
    assert angle_between(end.pose("body"), body.pose) < 0.01


L_SHAPE = part(Box((0.3, 0.1, 0.02)), 0.15, 0, 0.01), part(Box((0.02, 0.1, 0.2)), 0.01, 0, 0.12)  # its frame: a corner


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_body_is_where_its_frame_is_and_not_its_centre_of_mass(yaw):
    body = compound("L", *L_SHAPE, at=(0.6, 0.1, 0), mass=1.0, rpy=(0, 0, yaw))
    outcome = wait(table(), body, seconds=1.0, settle_s=0.1)
    for state in (outcome.start, outcome.end):
        np.testing.assert_allclose(state.position("L"), [0.6, 0.1, 0], atol=1e-3)
        assert angle_between(state.pose("L"), body.pose) < 5e-3


def test_velocities_are_those_of_the_frame():
    """A body that tumbles down onto an edge: its velocities are the rates of its own poses."""
    edge = Body.of("edge", Box((0.1, 1, 0.1)), FAR, mass=0, color=GREY)
    body = compound("L", *L_SHAPE, at=(3.02, 3, 0.1), mass=1.0)
    states = wait(edge, body, seconds=0.5, record_hz=500).recording.states
    rates = np.diff(states.position("L"), axis=0) / 0.002
    spins = [
        (b.rotation * a.rotation.inv()).as_rotvec() / 0.002
        for a, b in ((states[i].pose("L"), states[i + 1].pose("L")) for i in range(len(rates)))
    ]
    speeds, turning = states.linear_velocity("L")[1:], states.angular_velocities[1:, 0]
    assert np.abs(turning).max() > 1.0  # it does tumble
    centre = body.inertia().frame.position
    assert np.linalg.norm(centre) > 0.05
    np.testing.assert_allclose(np.median(np.abs(rates - speeds), axis=0), 0, atol=0.03)
    np.testing.assert_allclose(np.median(np.abs(np.array(spins) - turning), axis=0), 0, atol=0.03)


def test_a_tall_body_topples_and_a_flat_one_does_not():
    tilt = 0.3
    slope = Body.of("slope", Box((4, 2, 0.1)), FAR, mass=0, color=GREY, rpy=(0, tilt, 0), friction=2.0)

    def turned(size):
        at = slope.pose.apply([0, 0, 0.05 + size[2] / 2])
        body = Body.of("body", Box(size), at, mass=1, color=GREY, rpy=(0, tilt, 0), friction=2.0)
        return angle_between(wait(slope, body, seconds=1.5).end.pose("body"), body.pose)

    assert turned((0.1, 0.1, 0.25)) < 0.02  # tan(0.3) is 0.31: it would take 0.32
    assert turned((0.1, 0.1, 0.45)) > 0.5


# --- settings ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("setting", "value"),
    [("time_step", 0), ("time_step", -0.001), ("time_step", math.nan), ("solver_iterations", 0), ("tracking_rate", 0)],
)
def test_numbers_that_make_no_sense(setting, value):
    with pytest.raises(UserError, match=setting):
        installed().create("sim", "pybullet", {setting: value})


# --- recordings -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [10, 50])
def test_recordings_have_the_rate_that_was_asked_for(rate):
    outcome = wait(table(), cube(at=(0.6, 0, 0.3)), seconds=1.0, settle_s=0.5, record_hz=rate)
    film = outcome.recording
    np.testing.assert_allclose(np.diff(film.times), 1 / rate, atol=2e-3)
    assert film.times[0] == pytest.approx(-0.5)
    assert film.times[-1] == pytest.approx(1.0, abs=2e-3)
    count = len(film.times)
    assert film.arm.shape == (count, 7)
    assert film.fingers.shape == (count, 2)
    assert film.states.positions.shape == (count, 1, 3)
    np.testing.assert_allclose(film.states.position("cube")[0], [0.6, 0, 0.3])
    np.testing.assert_array_equal(film.states.position("cube")[-1], outcome.end.position("cube"))


def test_without_a_rate_nothing_is_recorded():
    assert wait(seconds=0.01).recording is None


def test_the_start_is_after_settling():
    outcome = wait(table(), cube(at=(0.6, 0, 0.2)), seconds=0.1, settle_s=1.0)
    assert outcome.start.position("cube")[2] == pytest.approx(0.05, abs=1e-3)
    at_once = wait(table(), cube(at=(0.6, 0, 0.2)), seconds=0.1)
    assert at_once.start.position("cube")[2] == pytest.approx(0.2)


# --- pictures ---------------------------------------------------------------------------------------------------


def test_pictures():
    task = World(table(), cube(at=(0.6, 0, 0.05)), name="Pictured")
    plain = SIM.render(task, width=160, height=120)
    assert plain.shape == (120, 160, 3)
    assert plain.dtype == np.uint8
    assert len(np.unique(plain)) > 50  # not a blank page
    np.testing.assert_array_equal(SIM.render(task, width=160, height=120), plain)

    def difference(**how):
        other = SIM.render(task, width=160, height=120, **how).astype(int)
        return (np.abs(other - plain).max(axis=-1) > 30).sum()

    moved = task.scene(0).state()
    moved.positions[0] = 0.8, 0.2, 0.05
    assert 20 < difference(state=moved) < 3000
    assert difference(state=task.scene(0).state()) == 0
    assert difference(arm=np.array([0.5, 0, 0, -1.5, 0, 1.5, 0.7])) > 200
    assert difference(fingers=np.zeros(2)) > 0
    assert difference(tool=Tool()) > 20  # no hand
    assert difference(tool=stick(0.4)) > 20
    assert difference() == 0  # all is as it was


def test_pictures_do_not_touch_rollouts():
    before, _ = digest("OneBook")
    SIM.render(installed().create("task", "OneBook"), width=32, height=24)
    assert digest("OneBook")[0] == before
