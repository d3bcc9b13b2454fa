import json

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import plugins.gym  # registers them
from core.design import Component, Tool
from core.designs.reading import load_designs, read_designs
from core.errors import UserError
from core.geometry import Box, Pose
from core.interfaces import RolloutSettings
from core.plugins import Offer, installed
from core.simulation.attempt import prepare
from plugins.gym.environment import ToolEnv
from tasks.bring_cube import BringCube
from tasks.move_ball import MoveBall
from tests.support.commands import ROOT
from tests.support.engines import every_simulator
from tests.support.panda import ARM, FINGER_OPEN
from tests.support.rare import rare

pytestmark = pytest.mark.slow

DESIGNS = ROOT / "tests/tasks/solutions"
SOLVED = [f"RoboToolBench/{file.stem}" for file in sorted(DESIGNS.glob("*.json"))]
# One reads a trace and moves, one has joints.
HARD = ("HardToolBench/StopCart", "HardToolBench/TwoStations")


def test_the_twelve_are_environments():
    names = {
        spec.name
        for spec in gymnasium.registry.values()
        if spec.namespace == "RoboToolBench"
    }
    assert names == {file.stem for file in DESIGNS.glob("*.json")}


def test_tasks_of_other_distributions_have_a_namespace_of_their_own(monkeypatch):
    """Names are fitted to what Gymnasium's grammar allows."""
    offers = {
        ("task", "MoveBall2"): Offer("task", "MoveBall2", "mine", "my.tasks", MoveBall),
        ("task", "odd name"): Offer(
            "task", "odd name", "harder", "vlmgineer", MoveBall
        ),
    }
    monkeypatch.setattr(installed(), "offers", offers)
    monkeypatch.setattr(gymnasium.envs.registration, "registry", {})
    plugins.gym.register_tasks()
    assert set(gymnasium.envs.registration.registry) == {
        "my-tasks/MoveBall2-v0",
        "vlmgineer/odd-name-v0",
    }


@pytest.mark.filterwarnings("error", "ignore:Setting the shape:DeprecationWarning")
@pytest.mark.parametrize("name", rare([*SOLVED, *HARD], SOLVED[0], HARD[0]))
def test_gymnasiums_checker_passes(name):
    task = name.split("/")[1]
    mode = "end_effector" if task in ("BringCube", "LiftBox") else "joints"
    env = gymnasium.make(
        f"{name}-v0",
        designs=None if task == "LiftBox" or name in HARD else DESIGNS / f"{task}.json",
        gripper=task == "LiftBox",
        control_mode=mode,
        render_mode="rgb_array",
        size=(64, 48),
        words=["material=paper"],  # of which the designs are
    )
    check_env(env.unwrapped, skip_render_check=task != "BringCube")
    env.close()


def test_soft_bodies_are_observed_by_their_nodes_or_refused_where_contacts_count():
    env = gymnasium.make("SoftToolBench/PullRope-v0", words=["sim=mujoco"])
    observed, _ = env.reset(seed=1)
    space = env.observation_space
    assert observed.shape == space.shape
    assert np.isfinite(space.high).all()
    np.testing.assert_allclose(
        observed[9:12], observed[22:][: 3 * 22].reshape(22, 3).mean(axis=0), atol=0.01
    )
    with pytest.raises(
        UserError,
        match="HangCloth can't be stepped: the trace has no forces, by which contacts of soft",
    ):
        gymnasium.make("SoftToolBench/HangCloth-v0", words=["sim=mujoco"]).reset()


def test_observations_have_what_the_docstring_says():
    env = gymnasium.make(
        "RoboToolBench/BringCube-v0", render_mode="rgb_array", size=(80, 60)
    )
    observed, info = env.reset(seed=1)
    assert observed.shape == (9 + 13 + 7 + 3 * 7,)
    assert observed.dtype == env.observation_space.dtype == np.float32
    np.testing.assert_allclose(observed[9:12], (1.0, 0.0, 0.035), atol=1e-3)
    np.testing.assert_allclose(observed[12:16], (1, 0, 0, 0), atol=1e-3)
    np.testing.assert_allclose(observed[16:22], 0, atol=0.02)
    end = ARM.forward(observed[:7])
    np.testing.assert_allclose(observed[22:25], end.position, atol=1e-5)
    np.testing.assert_allclose(
        np.abs(observed[25:29]), np.abs(end.quaternion), atol=1e-4
    )
    # Floor, table, mark.
    np.testing.assert_allclose(observed[-7:-4], (0.6, 0.0, 0.0), atol=1e-6)
    assert info["reward"] == pytest.approx(0, abs=1e-6)
    assert env.render().shape == (60, 80, 3)


def test_a_variation_draws_the_layout_and_shows_its_marks():
    env = gymnasium.make("RoboToolBench/BringCube-v0", words=["task.variation=wide"])
    seen = [env.reset(seed=seed)[0] for seed in (0, 0, 1)]
    assert env.observation_space.shape == seen[0].shape
    np.testing.assert_array_equal(seen[0], seen[1])
    task = env.unwrapped.task
    mark = task.scene(env.unwrapped._layout)["mark"].pose.position
    np.testing.assert_allclose(seen[2][-7:-4], mark, atol=1e-6)
    assert np.abs(seen[0][-7:-5] - seen[2][-7:-5]).max() > 0.001


def test_end_effector_actions_move_the_end_effector():
    env = gymnasium.make("RoboToolBench/BringCube-v0", control_mode="end_effector")
    observed, _ = env.reset(seed=0)
    before = ARM.forward(observed[:7])
    for _ in range(10):
        observed, *_ = env.step(np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0]))
    moved = ARM.forward(observed[:7])
    np.testing.assert_allclose(
        moved.position - before.position, (0, 10 * 0.05 * 0.25, 0), atol=0.01
    )
    assert (moved.rotation * before.rotation.inv()).magnitude() < 0.05


def test_the_same_plan_earns_what_it_earns_in_a_rollout():
    """A solution's joint trajectory, driven step by step, and its rewards summed: the task is solved, and the episode
    ends.
    """

    env = gymnasium.make(
        "RoboToolBench/BringCube-v0", designs=DESIGNS / "BringCube.json"
    )
    task = env.unwrapped.task
    document = load_designs(DESIGNS / "BringCube.json")
    candidate = read_designs(document, installed().create("tool", "urdf"), task)[0]
    trajectory = prepare(task, candidate, 0, RolloutSettings())[1].trajectory
    env.reset(seed=0)
    limits, total, done = 0.05 * ARM.velocity_limits, 0.0, False
    times = np.arange(0.05, trajectory.duration + 1.0, 0.05)
    targets, _ = trajectory.sample(times)
    for target in targets:
        _, reward, done, _, info = env.step((target - env.unwrapped._joints) / limits)
        total += reward
        if done:
            break
    assert done
    assert info["is_success"]
    assert total == pytest.approx(info["reward"])
    assert info["reward"] >= task.success_reward


def test_words_set_parts_as_on_the_command_line():
    base = ToolEnv("BringCube", words=["robot.base=[0.1,0,0,0]"]).task.robot.base
    np.testing.assert_allclose(base.position, (0.1, 0, 0))


def test_fingers_open_and_close():
    env = gymnasium.make("RoboToolBench/LiftBox-v0", gripper=True)
    observed, _ = env.reset(seed=0)
    np.testing.assert_allclose(observed[7:9], FINGER_OPEN, atol=2e-3)
    for _ in range(20):
        observed, *_ = env.step(np.array([0.0] * 7 + [1.0]))
    np.testing.assert_allclose(observed[7:9], 0, atol=2e-3)


def test_a_tool_that_breaks_a_rule_is_not_mounted(tmp_path):
    file = tmp_path / "floating.json"
    document = load_designs(DESIGNS / "BringCube.json")
    tool = Tool(
        (
            Component(
                "rod", "tool_mount", Pose.xyz_rpy((0, 0, -0.4)), Box((0.02, 0.02, 0.2))
            ),
        )
    )
    document["strategies"][0] |= installed().create("tool", "urdf").dump(tool)
    file.write_text(json.dumps(document))
    with pytest.raises(
        UserError,
        match=r"floating.json: the tool of design 0 can't be mounted: .* 295.0 mm away",
    ):
        gymnasium.make("RoboToolBench/BringCube-v0", designs=file, words=["sim=mujoco"])


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        (
            {"control_mode": "torques"},
            "no control_mode 'torques'; possible: end_effector, joints",
        ),
        (
            {
                "designs": DESIGNS / "BringCube.json",
                "strategy": 7,
                "words": ["sim=mujoco"],
            },
            r"BringCube.json has \d designs; there is no",
        ),
        ({"words": ["sim=pybulet"]}, r"no sim 'pybulet' \(did you mean 'pybullet'\?\)"),
    ],
)
def test_wrong_arguments_are_refused(settings, reason):
    with pytest.raises(UserError, match=reason):
        gymnasium.make("RoboToolBench/BringCube-v0", **settings)


class Timed(BringCube):
    """Pays a tenth for each second in which the cube touches the table, and the table alone."""

    def reward(self, start, end, trace):
        return (
            trace.contact("cube", "table").mean(axis=-1)
            * ~trace.touched("cube", "robot")
            * trace.times[-1]
            / 10
        )


class Pressed(BringCube):
    def reward(self, start, end, trace):
        return trace.force_n("cube", "robot")


@every_simulator
def test_a_reward_may_read_the_trace_of_the_episode(engine, monkeypatch):
    monkeypatch.setitem(
        installed().offers,
        ("task", "Timed"),
        Offer("task", "Timed", "mine", "vlmgineer", Timed),
    )
    env = ToolEnv("Timed", words=[f"sim={engine}"])
    for _ in range(2):  # an episode has nothing of the last one
        _, info = env.reset(seed=0)
        assert info["reward"] == pytest.approx(0, abs=0.005)
        for _ in range(20):
            _, _, _, _, info = env.step(np.zeros(7))
        assert info["reward"] == pytest.approx(0.1, abs=0.005)


def test_a_reward_that_reads_forces_is_refused(monkeypatch):
    monkeypatch.setitem(
        installed().offers,
        ("task", "Pressed"),
        Offer("task", "Pressed", "mine", "vlmgineer", Pressed),
    )
    with pytest.raises(
        UserError,
        match="BringCube can't be stepped: the trace has no forces; this engine",
    ):
        ToolEnv("Pressed", words=["sim=mujoco"]).reset()


def test_a_tool_weighs_by_its_material():
    made = gymnasium.make(
        "RoboToolBench/BringCube-v0",
        designs=DESIGNS / "BringCube.json",
        words=["material=pla", "material.infill=1.0", "material.friction=0.3"],
    ).unwrapped.tool
    assert made.mass == pytest.approx(
        1240 * sum(component.shape.volume for component in made.components)
    )
    assert made.friction == 0.3
    with pytest.raises(UserError, match="no material 'wood'"):
        gymnasium.make("RoboToolBench/BringCube-v0", words=["material=wood"])
    with pytest.raises(UserError, match=r"the arm carries at most 3 kg"):
        gymnasium.make(
            "RoboToolBench/BringCube-v0",
            designs=DESIGNS / "BringCube.json",
            words=["material=steel"],
        )


@pytest.mark.parametrize(
    ("action", "said"),
    [
        (
            np.zeros(8),
            r"^an action is an array \(7,\) of finite numbers .*; got .array",
        ),
        ([0.0] * 6 + [np.nan], "got .*nan"),
        (["a"] * 7, "got .*a"),
        (None, "got 'None"),
    ],
)
def test_an_action_that_can_not_be_is_refused_and_the_arm_stays(action, said):
    env = ToolEnv("BringCube")
    before, _ = env.reset(seed=0)
    with pytest.raises(gymnasium.error.InvalidAction, match=said):
        env.step(action)
    after, *_ = env.step(np.zeros(7))
    np.testing.assert_allclose(after[:7], before[:7], atol=1e-3)
