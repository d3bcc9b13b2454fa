"""Test what MuJoCo alone has: worlds, contacts, servos, the renderer. Settings are in test_settings.py."""

import math
from dataclasses import replace

import numpy as np
import pytest

from core.errors import NoPicture
from core.geometry import Box, Cylinder, Sphere
from core.interfaces import JointTrajectory, Order, Outcome, Rollout
from core.plugins import installed
from core.scene import Body, table
from core.simulation.playback import play
from plugins.conformance.output import bits
from plugins.conformance.sample_tools import stick
from plugins.conformance.worlds import (
    BARE,
    GRAVITY,
    GREY,
    HAND,
    Bodies,
    cube,
    motion,
    slope,
    still,
)
from tests.support.worlds import end, film, move, start, wait

pytest.importorskip("mujoco")


from plugins.simulators.mujoco.renderer import MuJoCoRenderer
from plugins.simulators.rendering import joint_positions
from tests.support.packages import without
from tests.support.panda import FINGER_OPEN


def mujoco(**settings):
    return installed().create("sim", "mujoco", settings)


# --- playing ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tool", [stick(0.25), HAND], ids=["stick", "hand"])
def test_all_steps_at_once_are_what_the_core_plays_step_by_step(tool):
    """The same start and end, the same lag, the same film; to the last bit."""
    bodies = (
        table(),
        cube(at=(0.6, 0, 0.05)),
        Body.of("can", Cylinder(0.03, 0.1), (0.7, 0, 0.05), mass=0.3, color=GREY),
    )
    plan = [[0.45, 0, 0.3, 0, 0, 0, 0.3], [0.65, 0, 0.3, 0, 0, 0, 1.0]]
    job = Rollout(tool, motion(plan), settle_s=0.1, hold_s=0.2, record_hz=30.0)
    sim = mujoco()
    task = Bodies(*bodies)
    (ours,) = sim.rollout(task, [job])
    theirs = play(sim.world(task, tool), job)
    assert bits(ours) == bits(theirs)
    for name in ("times", "arm", "fingers"):
        np.testing.assert_array_equal(
            getattr(film(ours), name), getattr(film(theirs), name)
        )
    np.testing.assert_array_equal(
        film(ours).states.positions, film(theirs).states.positions
    )


def test_a_world_settles_once_for_all_that_begin_alike():
    """Another start, another time to settle, other fingers: each as in a simulator of its own."""
    task = Bodies(table(), cube(at=(0.6, 0, 0.055)))
    away = motion([[0.65, 0, 0.05, 0, 0, 0, 0.5]])
    elsewhere = JointTrajectory(np.zeros(1), still().arm + 0.1, np.array([FINGER_OPEN]))
    shut = JointTrajectory(np.zeros(1), still().arm, np.zeros(1))
    jobs = [
        Rollout(HAND, trajectory, settle_s=settle_s, hold_s=0.1)
        for settle_s in (0.1, 0.0, 0.2)
        for trajectory in (away, still(), shut, elsewhere)
    ]
    together = mujoco().rollout(task, [*jobs, *reversed(jobs)])
    for job, ours, again in zip(jobs, together, reversed(together), strict=False):
        (alone,) = mujoco().rollout(task, [job])
        assert bits(ours) == bits(again) == bits(alone)


@pytest.mark.parametrize("time_step", [0.001, 0.0025, 0.004])
@pytest.mark.parametrize("rate", [20.0, 50.0])
def test_joints_close_in_on_their_targets_at_the_tracking_rate(time_step, rate):
    world = mujoco(time_step=time_step, tracking_rate=rate).world(Bodies(), BARE)
    # All at once: none pushes another away.
    target = still().arm[0] + 2e-3
    rest = np.zeros(7)
    left = []
    for _ in range(round(3 / rate / time_step)):
        world.step(Order(target, FINGER_OPEN, rest, 0.0))
        left.append(target - world.joints()[0])
    first = round(0.5 / rate / time_step)
    last = len(left) - 1
    found = np.log(left[first] / left[last]) / ((last - first) * time_step)
    # A joint's inertia is not that of its link alone.
    np.testing.assert_allclose(found, rate, rtol=0.25)


def test_a_world_that_explodes_is_an_error_and_nothing_else(
    tmp_path, monkeypatch, capfd
):
    """No log file where one stands, nothing on the terminal, and the next job in the same world is as it would be."""
    monkeypatch.chdir(tmp_path)
    far = np.stack([still().arm[0], still().arm[0] + 1e12])
    broken = Rollout(
        BARE, JointTrajectory(np.array([0.0, 0.1]), far, np.full(2, FINGER_OPEN))
    )
    task = Bodies(table(), cube(at=(0.6, 0, 0.05)))
    sim = mujoco()
    before, failed, after = sim.rollout(
        task, [Rollout(BARE, still()), broken, Rollout(BARE, still())]
    )
    assert isinstance(failed, Outcome)
    assert failed.error is not None
    assert failed.error.startswith("MuJoCo: ")
    assert "\n" not in failed.error
    assert failed.start is None
    assert failed.end is None
    assert before.error is None
    np.testing.assert_array_equal(end(before).positions, end(after).positions)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_targets_that_are_not_numbers_are_refused_before_a_step():
    broken = Rollout(BARE, replace(still(), arm=np.full_like(still().arm, np.nan)))
    (outcome,) = mujoco().rollout(Bodies(table()), [broken])
    assert outcome.error == "the trajectory's targets are not finite"


# --- contacts ---------------------------------------------------------------------------------------------------


def test_what_friction_holds_does_not_creep():
    hill = slope(math.atan(0.45), 0.5)  # at 0.5 it would slide
    at = hill.pose.apply([0, 0, 0.05 + 0.02])
    block = Body.of(
        "block",
        Box((0.1, 0.1, 0.04)),
        at,
        mass=1.0,
        color=GREY,
        rpy=(0, math.atan(0.45), 0),
    )
    outcome = wait(mujoco(), hill, block, seconds=5.0, settle_s=0.5)
    crept = np.linalg.norm(
        end(outcome).position("block") - start(outcome).position("block")
    )
    assert crept < 5e-4


def test_a_ball_that_rolls_slowly_is_not_put_to_sleep():
    """Down a slope of 0.1 degrees, from rest."""
    hill = slope(2e-3, 1.0)
    at = hill.pose.apply([0, 0, 0.05 + 0.1])
    ball = Body.of("ball", Sphere(0.1), at, mass=1.0, color=GREY, friction=1.0)
    rolled = np.linalg.norm(
        end(wait(mujoco(), hill, ball, seconds=5.0)).position("ball") - at
    )
    assert rolled == pytest.approx(5 / 7 * GRAVITY * 2e-3 * 5**2 / 2, rel=0.1)


def test_what_sleeps_wakes_when_it_is_touched():
    plan = [[0.45, 0, 0.3, 0, 0, 0], [0.65, 0, 0.3, 0, 0, 0]]
    bodies = table(), cube(at=(0.6, 0, 0.05)), cube("far", (0.6, 0.4, 0.05))
    outcome = move(mujoco(), plan, *bodies, tool=stick(0.25))
    assert end(outcome).position("cube")[0] > 0.65
    np.testing.assert_array_equal(end(outcome).linear_velocity("far"), 0)
    np.testing.assert_allclose(
        end(outcome).position("far"), [0.6, 0.4, 0.05], atol=1e-4
    )


# --- the robot --------------------------------------------------------------------------------------------------


def test_a_joint_whose_force_is_at_its_limit_does_not_shake():
    """A stick pressed on the table with all that the arm can: joints stand still."""
    outcome = move(
        mujoco(),
        [[0.5, 0, 0.32, 0, 0, 0], [0.5, 0, 0.15, 0, 0, 0]],
        table(),
        tool=stick(0.3),
        record_hz=400,
        hold_s=1.0,
    )
    last = film(outcome).arm[-100:]
    assert outcome.tracking_error_rad > 0.05
    assert (last.max(axis=0) - last.min(axis=0)).max() < 1e-3


def test_the_arm_moves_smoothly():
    """From one step to the next no joint's speed changes by much more than its trajectory's does."""
    trajectory = motion([[0.6, 0.2, 0.3, 0, 0.3, 0], [0.5, -0.2, 0.4, 0, 0, 0.5]])
    (outcome,) = mujoco().rollout(
        Bodies(), [Rollout(BARE, trajectory, settle_s=0.0, hold_s=0.1, record_hz=400)]
    )
    dt = 0.0025
    wanted, _ = trajectory.sample(film(outcome).times)
    jumps = [
        np.abs(np.diff(joints, n=2, axis=0)).max() / dt
        for joints in (film(outcome).arm, wanted)
    ]
    assert jumps[0] < 2 * jumps[1]


# --- pictures ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def own_renderer():
    try:
        return MuJoCoRenderer()
    except NoPicture as error:
        pytest.skip(f"{error}; for example Debian's libegl1 has it")


def test_what_is_behind_glass_can_be_seen(own_renderer):
    def picture(opacity):
        pane = Body.of(
            "pane",
            Box((0.01, 0.4, 0.4)),
            (0.8, 0, 0.2),
            mass=0,
            color=(0.5, 0.5, 0.5, opacity),
        )
        red = Body.of(
            "red", Box((0.1, 0.1, 0.1)), (0.6, 0, 0.05), mass=1, color=(1, 0, 0, 1)
        )
        task = Bodies(table(), red, pane)
        own_renderer.load(task, 0, HAND)
        fingers = np.full(2, FINGER_OPEN)
        joints = joint_positions(task.robot, HAND, still().arm[0], fingers)
        own_renderer.pose(joints, task.scene(0).state())
        camera = replace(task.camera, position=(1.6, 0.0, 0.3), target=(0.6, 0.0, 0.1))
        seen = own_renderer.shoot(camera, 80, 60).astype(int)
        return (seen[..., 0] > seen[..., 1] + 60).sum()

    solid = picture(1.0)
    glass = picture(0.3)
    assert glass > solid + 20


def test_a_wrong_mujoco_gl_is_one_line(tmp_path):
    done = without([], ["core", "render", "sim=mujoco"], tmp_path, MUJOCO_GL="nonsense")
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "MUJOCO_GL=nonsense does not work here" in done.stderr


@pytest.mark.thorough
def test_render_says_who_drew(tmp_path, own_renderer):
    arguments = ["core", "render", "sim=mujoco", "width=32", "height=24"]
    done = without(["pybullet"], arguments, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("scene.png\ndrawn by MuJoCo's renderer on ")
    pytest.importorskip("pybullet")
    done = without(["OpenGL"], arguments, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(
        "scene.png\ndrawn by pybullet's renderer: MuJoCo's own renderer needs OpenGL"
    )
    done = without([], arguments, tmp_path, MUJOCO_GL="disable")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(
        "scene.png\ndrawn by pybullet's renderer: MuJoCo's own renderer is switched off"
    )
