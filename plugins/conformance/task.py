"""Checks that every task must pass. Each takes a task and raises an AssertionError that says what is wrong.

Nothing is stepped but in the last check, which takes the first engine that is installed.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from core.design import Tool
from core.designs.start import SpawnRules
from core.errors import UsageError, UserError
from core.geometry import Array
from core.goals import reaches
from core.interfaces import Rollout, Task
from core.robot.kinematics import arm_of
from core.robot.trajectory import at_home
from core.scene import Scene, State, Trace
from core.solids.contacts import find_contacts, make_trace
from core.solids.hindrances import find_hindrances
from core.solids.standing import find_layout_warnings, find_overlaps
from core.solids.tracks import SAMPLE_HZ
from core.task import reward_of
from core.values.layouts import NONE
from plugins.conformance.shared import LeftOut, between, expect_a, near, some_simulator
from plugins.conformance.worlds import Film, play

SEEDS = (0, 1, 2)  # layouts that are looked at
MAX_DRIFT_M = 0.005  # of a body that nothing touches but what it rests on, in
REST_S = 2.0
MAX_IDLE_REWARD = 0.02


def check_it_is_described(task: Task) -> None:
    """It has a name for configs, and a description that a model can read.

    Its source, which a model may be shown, holds the name.
    """
    assert task.name.isidentifier(), (
        f"the name {task.name!r} must be one word, for configs and folders"
    )
    assert len(task.description.split()) >= 5, (
        f"the description for the model is {task.description!r}"
    )
    assert "\n" not in task.description, (
        "the description is one paragraph, without line breaks"
    )
    assert task.name in task.source(), (
        "the source that a model is shown does not hold the task's name"
    )
    between("success_reward", task.success_reward, 1e-9, 1.0)


def layout_of(scene: Scene) -> list[tuple[object, ...]]:
    """Return what a seed draws of each body: its name, where it is, its mass, and what it is made of."""
    return [
        (body.name, body.pose, body.mass, getattr(body, "elastic", None))
        for body in scene.bodies
    ]


def check_one_seed_gives_one_layout(task: Task) -> None:
    """The same seed gives the same scene, and something in it can move."""
    scene = task.scene(3)
    expect_a(Scene, scene, "scene returned")
    assert layout_of(scene) == layout_of(task.scene(3)), (
        "one seed gives different layouts; draw from np.random.default_rng(seed)"
    )
    assert scene.free, (
        "nothing in the scene can move, so nothing can be earned; give a body a mass"
    )


def check_goals_name_bodies_of_the_scene(task: Task) -> None:
    """Goals name what is in the scene, and each goal to reach is about some body."""
    scene = task.scene(0)
    expect_a(tuple, task.goals, "goals is")
    for goal in task.goals:
        try:
            goal.check_names(scene)
        except UsageError as error:
            raise AssertionError(f"a goal names what is not there: {error}") from error

    for reach in reaches(task.goals):
        assert reach.subjects(scene.state()), f"{reach} is about no body"


def check_rewards_work_for_one_world_or_many(task: Task) -> None:
    """Rewards are in [0, 1] wherever bodies end, far away too, and the same for each world alone.

    So an engine may play many worlds, and the task judge them in one call.
    """
    begin = task.scene(0).state()
    rng = np.random.default_rng(0)
    ends = []
    for reach in (0.0, 0.05, 0.3, 1.0, 30.0):
        shift = rng.normal(0, reach, begin.positions.shape)
        ends.append(replace(begin, positions=begin.positions + shift))

    many = reward_for(task, State.stack([begin] * len(ends)), State.stack(ends))
    assert many.shape == (5,), (
        f"the reward of 5 worlds has the shape {many.shape}, not (5,)"
    )
    near("rewards", many, 0.5, 0.5)
    alone = [float(reward_for(task, begin, last)) for last in ends]
    near("what worlds earn together, and one by one", many, alone, 1e-9)


def reward_for(
    task: Task, first: State, last: State, trace: Trace | None = None
) -> Array:
    """What a task pays; without a ``trace`` nothing touched anything in between, and nothing was strained."""
    if trace is None:
        unstrained = np.zeros((*first.positions.shape[:-2], 2))
        strains = dict.fromkeys(task.scene(SEEDS[0]).breakable, unstrained)
        trace = Trace.of(first, last, forces={}, strains=strains)

    return np.asarray(reward_of(task, first, last, trace))


def check_the_arm_reaches_home_clear_of_the_scene(task: Task) -> None:
    """The mount gets to the task's home, and nothing is in the arm's way there."""
    arm = arm_of(task.robot)
    place = arm.forward(arm.home_for(task.home)).position  # raises where it can't
    near("where the mount is at the task's home, m", place, task.home.position, 1e-3)
    SpawnRules(task, 0).check_start(Tool())


def check_nothing_overlaps_at_spawn(task: Task) -> None:
    """No two rigid bodies are inside each other, unless a joint connects them or both are fixed."""
    for seed in SEEDS:
        for fault in find_overlaps(task.scene(seed)):
            raise AssertionError(f"with seed {seed} {fault.text}")


def check_nothing_in_the_scene_prevents_its_goals(task: Task) -> None:
    """No body is shut in by a joint that can't open, and none has to be moved with less force than that takes."""
    for seed in SEEDS:
        for line in find_hindrances(task.goals, task.scene(seed)):
            raise AssertionError(f"with seed {seed} {line}")

        if task.variation == NONE:
            break


def check_variations_draw_layouts(task: Task) -> str:
    """Two seeds of a variation give two layouts, in which nothing overlaps, falls or is left in the air either."""
    for name in task.variations:
        varied = copy(task)
        varied.variation = name
        assert layout_of(varied.scene(0)) != layout_of(varied.scene(1)), (
            f"variation {name!r}: two seeds give the same layout; use self.draw(seed)"
        )
        for warning in find_layout_warnings(varied):
            raise AssertionError(warning)

    return ", ".join(task.variations) or "it has none"


def check_nothing_happens_while_the_arm_waits(task: Task) -> str:
    """Nothing drifts, and nothing is earned, while the arm is at home without a tool: a scene must not solve itself."""
    try:
        still = at_home(task)
    except UserError as error:  # reported by the check of home
        raise LeftOut("the arm does not reach home") from error

    scene = task.scene(SEEDS[0])
    spawn = scene.state()
    earned = reward_for(task, spawn, spawn)
    between("what doing nothing earns at spawn", earned, 0.0, MAX_IDLE_REWARD)

    name, simulator = some_simulator(soft=bool(scene.softs))
    job = Rollout(
        Tool(),
        still,
        SEEDS[0],
        hold_s=REST_S,
        record_hz=SAMPLE_HZ,
        forces=task.reads_trace,
    )
    played = Film(scene, play(simulator, task, job))
    begin = scene.complete(played.start)
    last = scene.complete(played.end)

    is_launched = any(body.launched for body in scene.bodies)
    if not (is_launched or any(joint.drive is not None for joint in scene.joints)):
        ways = np.linalg.norm(last.positions - begin.positions, axis=-1)
        for body, way in zip(begin.names, ways, strict=True):
            what = f"in {name} {body!r} moves {1000 * way:.0f} mm within {REST_S:g} s while the arm waits at home"
            mend = "put it where it can rest, or give it friction"
            assert way < MAX_DRIFT_M, f"{what}; {mend}"

    contacts = find_contacts(scene, task.robot, Tool(), played.recording)
    earned = reward_for(task, begin, last, make_trace(scene, contacts))
    between(
        f"what doing nothing earns after {REST_S:g} s in {name}",
        earned,
        0.0,
        MAX_IDLE_REWARD,
    )

    return f"in {name}"
