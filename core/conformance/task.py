"""What any task must satisfy: each check takes one and raises an AssertionError that says what is wrong."""

from __future__ import annotations

import numpy as np

from core.conformance.checking import expect
from core.design import Tool
from core.designs.rules import SpawnRules
from core.interfaces import Task
from core.robot.kinematics import arm
from core.scene import Scene, State


def check_it_is_described(task: Task) -> None:
    expect(task.name.isidentifier(), f"the name {task.name!r} must be one word, for configs and folders")
    expect(len(task.description.split()) >= 5, f"the description for the model is {task.description!r}")
    expect("\n" not in task.description, "the description is one paragraph, without line breaks")
    expect(f"class {type(task).__name__}" in task.source(), "the source that a model is shown does not hold the class")
    expect(0 < task.success_reward <= 1, f"success_reward is {task.success_reward}, not in (0, 1]")


def check_the_scene_is_the_seeds(task: Task) -> None:
    scene, again = task.scene(3), task.scene(3)
    expect(isinstance(scene, Scene), f"scene gave a {type(scene).__name__}, not a Scene")
    names = tuple(body.name for body in scene.bodies)
    expect(names == tuple(body.name for body in again.bodies), "one seed gives different bodies")
    same = all(a.pose == b.pose and a.mass == b.mass for a, b in zip(scene.bodies, again.bodies, strict=True))
    expect(same, "one seed gives different layouts")
    expect(scene.free, "nothing in the scene can move, so nothing can be earned; give a body a mass")


def check_goals_speak_of_the_scene(task: Task) -> None:
    names = {body.name for body in task.scene(0).bodies}
    expect(isinstance(task.goals, tuple), f"goals is a {type(task.goals).__name__}, not a tuple")
    for goal in task.goals:
        unknown = ({*goal.bodies, *goal.keep}) - names
        expect(not unknown, f"a goal speaks of {', '.join(sorted(unknown))}; the scene has {', '.join(sorted(names))}")


def check_doing_nothing_is_no_success(task: Task) -> None:
    state = task.scene(0).state()
    reward = float(np.asarray(task.reward(state, state)))
    expect(np.isfinite(reward) and 0 <= reward <= 1, f"the reward of doing nothing is {reward}, not in [0, 1]")
    expect(reward < task.success_reward, f"doing nothing earns {reward:.2f}, which counts as success")


def check_rewards_are_of_one_world_or_many(task: Task) -> None:
    """Of many at once the same as of each; in [0, 1] wherever bodies end, thrown far away too."""
    start = task.scene(0).state()
    rng = np.random.default_rng(0)
    ends = [start, *(shifted(start, rng.normal(0, reach, start.positions.shape)) for reach in (0.05, 0.3, 1.0, 30.0))]
    starts = State.stack([start] * len(ends))
    many = np.asarray(task.reward(starts, State.stack(ends)))
    expect(many.shape == (len(ends),), f"the reward of {len(ends)} worlds has the shape {many.shape}")
    expect(np.isfinite(many).all() and (many >= 0).all() and (many <= 1).all(), f"rewards {many} are not in [0, 1]")
    each = np.array([float(np.asarray(task.reward(start, end))) for end in ends])
    expect(np.allclose(each, many, atol=1e-9), f"worlds one by one earn {each}, at once {many}")


def shifted(state: State, by: np.ndarray) -> State:
    """Each free body moved by (B, 3)."""
    return State(
        state.names, state.positions + by, state.quaternions, state.linear_velocities, state.angular_velocities
    )


def check_the_arm_reaches_home_clear_of_the_scene(task: Task) -> None:
    joints = arm().home_for(task.home)  # raises where it can't
    miss = float(np.linalg.norm(arm().forward(joints).position - task.home.position))
    expect(miss < 1e-3, f"the arm misses the task's home pose by {miss * 1000:.1f} mm")
    SpawnRules(task, 0).check(Tool())


CHECKS = (
    check_it_is_described,
    check_the_scene_is_the_seeds,
    check_goals_speak_of_the_scene,
    check_doing_nothing_is_no_success,
    check_rewards_are_of_one_world_or_many,
    check_the_arm_reaches_home_clear_of_the_scene,
)
