"""Test what SAPIEN alone has: its settings, the renderer, and missing packages."""

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.conformance.worlds import (
    BARE,
    GRAVITY,
    GREY,
    HAND,
    HOME,
    Bodies,
    cube,
    end,
    film,
    move,
    slope,
    stick,
    still,
    wait,
)
from core.design import Component, Tool
from core.errors import NoPicture, UserError
from core.geometry import Box, Pose, Sphere
from core.interfaces import JointTrajectory, Rollout
from core.plugins import installed
from core.robot.trajectory import plan_motion
from core.scene import Body, table
from core.simulation.playback import play

pytest.importorskip("sapien", exc_type=ImportError)

from plugins.simulators.sapien.bodies import Weighed
from plugins.simulators.sapien.description import place, robot_links
from plugins.simulators.sapien.renderer import SapienRenderer
from plugins.simulators.sapien.world import World
from tests.panda import ARM, FINGER_OPEN, PANDA

ROOT = Path(__file__).parents[3]


def sapien(**settings):
    return installed().create("sim", "sapien", settings)


# --- settings ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("time_step", [0.002, 0.01])
def test_what_happens_does_not_depend_on_the_time_step(time_step):
    plan = [[0.6, 0.2, 0.3, 0, 0.3, 0], [0.6, -0.2, 0.3, 0, 0, 0.5]]
    bodies = table(), cube(at=(0.6, 0, 0.05))
    sims = sapien(), sapien(time_step=time_step)
    ours, theirs = (end(move(sim, plan, *bodies, tool=stick(0.25))).position("cube") for sim in sims)
    np.testing.assert_allclose(ours, theirs, atol=0.02)


@pytest.mark.parametrize("time_step", [0.002, 0.004])
@pytest.mark.parametrize("rate", [20.0, 50.0])
def test_joints_close_in_on_their_targets_at_the_tracking_rate(tmp_path, time_step, rate):
    world = World(
        tmp_path,
        Weighed(Bodies().scene(0)),
        PANDA,
        BARE,
        still(),
        time_step=time_step,
        solver_iterations=10,
        tracking_rate=rate,
    )
    target, rest = still().arm[0] + 5e-4 * np.eye(7)[0], np.zeros(7)
    left = []
    for _ in range(round(0.05 / time_step)):
        world.step(target, FINGER_OPEN, rest, 0.0)
        left.append(target[0] - world.joints()[0][0])
    first, last = round(0.01 / time_step), round(0.04 / time_step)
    found = np.log(left[first] / left[last]) / ((last - first) * time_step)
    # The other joints give way meanwhile; stiff ones come in up to twice as fast at long steps, never slower.
    assert 0.9 * rate < found < (1.4 if rate * time_step < 0.15 else 2.2) * rate


@pytest.mark.parametrize("tool", [BARE, HAND])
def test_orders_given_one_by_one_or_all_at_once_do_the_same(tmp_path, tool):
    class Stepped:
        """The world without `core.simulation.playback.Following`."""

        def __init__(self, world):
            self.time_step, self.step, self.joints, self.state = world.time_step, world.step, world.joints, world.state

    plan = [[0.6, 0.2, 0.3, 0, 0.3, 0, 1.0], [0.6, 0, 0.05, 0, 0, 0.5, 0.3]]
    job = Rollout(tool, plan_motion(np.array(plan), HOME, ARM).trajectory, settle_s=0.1, hold_s=0.2, record_hz=25.0)
    worlds = [
        World(
            tmp_path,
            Weighed(Bodies(table(), cube(at=(0.6, 0, 0.05))).scene(0)),
            PANDA,
            tool,
            job.trajectory,
            time_step=0.005,
            solver_iterations=10,
            tracking_rate=50.0,
        )
        for _ in range(2)
    ]
    one, other = play(worlds[0], job), play(Stepped(worlds[1]), job)
    assert one.tracking_error_rad == other.tracking_error_rad > 0
    np.testing.assert_array_equal(one.recording.arm, other.recording.arm)
    np.testing.assert_array_equal(one.recording.states.positions, other.recording.states.positions)
    np.testing.assert_array_equal(one.end.angular_velocities, other.end.angular_velocities)


@pytest.mark.parametrize(
    ("setting", "value"),
    [("time_step", 0), ("time_step", 0.1), ("time_step", math.nan), ("solver_iterations", 0), ("tracking_rate", 0)],
)
def test_numbers_that_make_no_sense(setting, value):
    with pytest.raises(UserError, match=setting):
        sapien(**{setting: value})


# --- surfaces ---------------------------------------------------------------------------------------------------


def test_many_coefficients_of_friction_are_their_pairs_geometric_means():
    """Nine blocks on a slope, each with a friction of its own: those of one kind differ too."""
    tilt, frictions = 0.45, np.geomspace(0.1, 1.2, 9)
    hill = replace(slope(tilt, 0.3), mass=0.0)
    at = [hill.pose.apply([-1.8, 0.11 * (i - 4), 0.05 + 0.02]) for i in range(9)]
    blocks = [
        Body.of(f"b{i}", Box((0.1, 0.1, 0.04)), at[i], mass=1, color=GREY, rpy=(0, tilt, 0), friction=friction)
        for i, friction in enumerate(frictions)
    ]
    state = end(wait(sapien(), hill, *blocks))
    slid = [float(np.linalg.norm(state.position(f"b{i}") - at[i])) for i in range(9)]
    due = GRAVITY * (math.sin(tilt) - np.sqrt(0.3 * frictions) * math.cos(tilt)) / 2
    np.testing.assert_allclose(slid, np.maximum(due, 0), atol=0.02)
    assert max(slid) > 1


def test_restitutions_are_told_apart():
    plate = replace(Body.of("plate", Box((2, 1, 0.1)), (3, 3, -0.05), mass=0, color=GREY), restitution=1.0)
    balls = [
        replace(Body.of(f"b{e}", Sphere(0.05), (2.5 + e, 3, 0.55), mass=0.5, color=GREY), restitution=e)
        for e in (0.0, 0.5, 0.9)
    ]
    heights = film(wait(sapien(), plate, *balls, seconds=0.65, record_hz=250)).states.positions[:, :, 2] - 0.05
    risen = [float(h[int(np.argmax(h < 0.01)) :].max()) for h in heights.T]
    np.testing.assert_allclose(risen, [0.0, 0.5 * 0.25, 0.5 * 0.81], atol=0.03)


# --- the robot --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tool", [BARE, HAND, stick(0.3, mass=1.0)], ids=["bare", "hand", "stick"])
def test_links_weigh_what_the_description_says(tool):
    """Few links, the same mass and the same kinematics: joints anywhere put the flange where Pinocchio has it."""
    links = robot_links(PANDA, tool)
    assert len(links) == (10 if tool.gripper else 8)
    assert sum(link.inertia.mass for link in links) == pytest.approx(17 + 0.7 * tool.gripper + tool.mass, abs=1.0)
    rng = np.random.default_rng(3)
    for _ in range(5):
        joints = rng.uniform(ARM.lower, ARM.upper)
        poses = place(links, {f"panda_joint{i + 1}": q for i, q in enumerate(joints)})
        flange = poses[7] @ Pose.xyz_rpy((0, 0, 0.107), (math.pi, 0, -math.pi / 4))
        np.testing.assert_allclose(flange.matrix, ARM.forward(joints).matrix, atol=1e-9)


def test_the_mounted_tool_adds_its_inertia():
    heavy = Tool((Component("block", "tool_mount", Pose(np.array([0, 0, -0.1])), Box((0.1, 0.1, 0.2)), mass=2.0),))
    bare, loaded = robot_links(PANDA, BARE)[7].inertia, robot_links(PANDA, heavy)[7].inertia
    assert loaded.mass == pytest.approx(bare.mass + 2)
    in_link = Pose.xyz_rpy((0, 0, 0.107), (math.pi, 0, -math.pi / 4)).apply([0, 0, -0.1])
    centre = (bare.mass * bare.frame.position + 2 * in_link) / loaded.mass
    np.testing.assert_allclose(loaded.frame.position, centre, atol=1e-9)


def test_fingers_stay_as_far_from_the_middle():
    """One motor moves both: a body off the middle is not pushed there by one finger alone."""
    over = 0.1034 + 0.02
    plan = [[0.5, 0, over, 0, 0, 0, 0], [0.5, 0, over, 0, 0, 0, 1]]
    post = Body.of("post", Box((0.02, 0.02, 0.04)), (0.5, 0.015, 0.02), mass=0, color=GREY)
    fingers = film(move(sapien(), plan, table(), post, tool=HAND, record_hz=50)).fingers
    assert fingers[-1].min() > 0.003
    assert np.abs(fingers[:, 0] - fingers[:, 1]).max() < 3e-3


def test_numbers_that_are_none_break_one_job_only():
    arms = np.full((1, 7), np.nan)
    broken = Rollout(BARE, JointTrajectory(np.zeros(1), arms, np.full(1, FINGER_OPEN)))
    first, second = sapien().rollout(Bodies(table(), cube(at=(0.6, 0, 0.05))), [broken, Rollout(BARE, still())])
    assert first.error
    assert second.error is None
    assert end(second).position("cube")[2] == pytest.approx(0.05, abs=1e-3)


# --- pictures ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def own_renderer():
    try:
        return SapienRenderer()
    except NoPicture as error:
        pytest.skip(f"{error}; for example Mesa's lavapipe 24.3 or newer has it")


def test_its_own_renderer_sees_what_pybullets_sees(own_renderer):
    """The same camera and scene: edges of the cube, the table and the arm are at the same pixels."""
    pytest.importorskip("pybullet")
    task = Bodies(table(), cube(at=(0.7, 0, 0.1), side=0.2))
    own = sapien()
    ours = own.render(task, width=160, height=120).astype(float).mean(axis=-1)
    assert own.drawn_by.startswith("SAPIEN's renderer on ")
    theirs = installed().create("sim", "pybullet").render(task, width=160, height=120).astype(float).mean(axis=-1)
    seen = [picture < 250 for picture in (ours, theirs)]
    assert (seen[0] ^ seen[1]).mean() < 0.03  # where there is anything at all
    assert np.corrcoef(ours.ravel(), theirs.ravel())[0, 1] > 0.8


def call(arguments, folder, missing):
    """A command in a process, and in those that it starts, where a module is not installed."""
    (folder / "sitecustomize.py").write_text(f"import sys\nsys.modules[{missing!r}] = None\n")
    environment = {**os.environ, "PYTHONPATH": str(folder), "VK_ICD_FILENAMES": "/nowhere.json"}
    command = [sys.executable, "-m", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


SMALL = ["budget.n_agent=1", "budget.n_tool=1", "budget.n_action=2", "budget.n_iteration=0", "executor.workers=2"]


@pytest.mark.slow
def test_without_pybullet_it_runs_headless(tmp_path):
    done = call(["core.run", "sim=sapien", *SMALL, "hydra.run.dir=out"], tmp_path, "pybullet")
    assert done.returncode == 0, done.stderr
    assert "no pictures: SAPIEN's own renderer needs Vulkan" in done.stderr
    assert "pip install pybullet" in done.stderr
    assert json.loads((tmp_path / "out/result.json").read_text())["best"]["reward"] > 0
    assert not (tmp_path / "out/scene.png").exists()
    missing = call(["core.run", *SMALL], tmp_path, "pybullet")
    assert missing.returncode == 1
    assert missing.stderr.count("\n") == 1
    assert "sim=pybullet needs PyBullet: pip install pybullet" in missing.stderr


@pytest.mark.slow
def test_without_sapien_pybullet_runs(tmp_path):
    pytest.importorskip("pybullet")
    done = call(["core.run", *SMALL, "hydra.run.dir=out", "film=false"], tmp_path, "sapien")
    assert done.returncode == 0, done.stderr
    missing = call(["core.run", "sim=sapien", *SMALL], tmp_path, "sapien")
    assert missing.returncode == 1
    assert missing.stderr.count("\n") == 1
    assert "sim=sapien needs SAPIEN: pip install 'sapien" in missing.stderr


@pytest.mark.slow
def test_render_says_who_drew(tmp_path):
    pytest.importorskip("pybullet")
    done = call(["core.render", "sim=sapien", "width=32", "height=24"], tmp_path, "none_of_it")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("scene.png\ndrawn by pybullet's renderer: SAPIEN's own renderer needs Vulkan")
