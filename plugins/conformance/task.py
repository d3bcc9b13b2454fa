"""Checks that every task must pass. Each takes a task and raises an AssertionError that says what is wrong.

The last ones step the first engine that is installed, with the arm at home and no tool, and return its name.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np

from core.design import Tool
from core.designs.rules import SpawnRules
from core.errors import UserError
from core.interfaces import Outcome, Rollout, Task
from core.robot.kinematics import arm_of
from core.robot.solids import Obstacles, Solid, body_solids, solids_of
from core.robot.trajectory import at_home
from core.scene import Body, Pose, Scene, Soft, Sphere, State, Trace
from core.solids.contacts import find_contacts, make_trace
from core.solids.penetration import Explosion, findings
from core.solids.tracks import SAMPLE_HZ
from core.task import reward_of
from plugins.conformance.checking import LeftOut, expect, some_simulator
from plugins.conformance.worlds import end, film, start

SEEDS = (0, 1, 2)  # layouts that are looked at
MAX_OVERLAP_M = 0.001
MAX_DRIFT_M = 0.005  # of a body that nothing touches but what it rests on, in
REST_S = 2.0
MAX_IDLE_REWARD = 0.02


def check_it_is_described(task: Task) -> None:
    expect(task.name.isidentifier(), f"the name {task.name!r} must be one word, for configs and folders")
    expect(len(task.description.split()) >= 5, f"the description for the model is {task.description!r}")
    expect("\n" not in task.description, "the description is one paragraph, without line breaks")
    expect(task.name in task.source(), "the source that a model is shown does not hold the task's name")
    expect(0 < task.success_reward <= 1, f"success_reward is {task.success_reward}, not in (0, 1]")


def check_one_seed_gives_one_layout(task: Task) -> None:
    scene, again = task.scene(3), task.scene(3)
    expect(isinstance(scene, Scene), f"scene returned a {type(scene).__name__}, not a Scene")
    names = tuple(body.name for body in scene.bodies)
    expect(names == tuple(body.name for body in again.bodies), "one seed gives different bodies")
    same = all(a.pose == b.pose and a.mass == b.mass for a, b in zip(scene.bodies, again.bodies, strict=True))
    expect(same, "one seed gives different layouts; draw from np.random.default_rng(seed)")
    expect(scene.free, "nothing in the scene can move, so nothing can be earned; give a body a mass")


def check_goals_name_bodies_of_the_scene(task: Task) -> None:
    names = {body.name for body in task.scene(0).bodies}
    expect(isinstance(task.goals, tuple), f"goals is a {type(task.goals).__name__}, not a tuple")
    for goal in task.goals:
        unknown = {*goal.bodies, *goal.keep, *goal.untouched, *([goal.at] if goal.at else [])} - names
        expect(not unknown, f"a goal names {', '.join(sorted(unknown))}; the scene has {', '.join(sorted(names))}")
        joints = [joint.name for joint in task.scene(0).joints]
        expect(goal.joint in (None, *joints), f"a goal names the joint {goal.joint}; the scene has {joints}")


def check_rewards_work_for_one_world_or_many(task: Task) -> None:
    """They are in [0, 1] wherever bodies end, far away too, and the same for each world alone."""
    begin, rng = task.scene(0).state(), np.random.default_rng(0)
    shape = begin.positions.shape
    shifts = [np.zeros(shape), *(rng.normal(0, reach, shape) for reach in (0.05, 0.3, 1.0, 30.0))]
    ends = [replace(begin, positions=begin.positions + shift) for shift in shifts]
    n = len(ends)
    begins, lasts = State.stack([begin] * n), State.stack(ends)
    many = np.asarray(reward_of(task, begins, lasts, _without_contacts(begins, lasts)))
    expect(many.shape == (n,), f"the reward of {n} worlds has the shape {many.shape}, not ({n},)")
    expect(np.isfinite(many).all() and (many >= 0).all() and (many <= 1).all(), f"rewards {many} are not in [0, 1]")
    each = np.array([float(np.asarray(reward_of(task, begin, last, _without_contacts(begin, last)))) for last in ends])
    expect(np.allclose(each, many, atol=1e-9), f"worlds earn {each} one by one and {many} together")


def _without_contacts(*states: State) -> Trace:
    return Trace.of(*states, forces={})


def check_the_arm_reaches_home_clear_of_the_scene(task: Task) -> None:
    joints = arm_of(task.robot).home_for(task.home)  # raises where it can't
    miss = float(np.linalg.norm(arm_of(task.robot).forward(joints).position - task.home.position))
    expect(miss < 1e-3, f"the arm misses the task's home pose by {miss * 1000:.1f} mm")
    SpawnRules(task, 0).check(Tool())


def check_nothing_overlaps_at_spawn(task: Task) -> None:
    for seed in SEEDS:
        scene = task.scene(seed)
        bodies = scene.bodies
        solids = {body.name: _solids(body) for body in bodies}
        for number, body in enumerate(bodies):
            apart = [o for o in bodies[:number] if frozenset((o.name, body.name)) not in scene.joined]
            others = Obstacles(s for o in apart if not (o.fixed and body.fixed) for s in solids[o.name])
            for solid in solids[body.name]:
                for other, gap in others.gaps(solid, 0.0):
                    what = f"with seed {seed} {body.name!r} starts {-1000 * gap:.1f} mm inside {other!r}"
                    expect(-gap < MAX_OVERLAP_M, f"{what}; an engine pushes them apart, so leave a clearance")


def _solids(body: Body) -> list[Solid]:
    """Return a body's collision shapes in the world; of a soft one balls around its nodes."""
    if not isinstance(body, Soft):
        return list(body_solids(body))
    free = [Pose(place) for node, place in enumerate(body.placed) if node not in body.pinned]
    return [solid for pose in free for solid in solids_of(body.name, Sphere(body.form.thickness / 2), pose)]


def check_variations_draw_layouts(task: Task) -> str:
    for name in task.variations:
        varied = copy(task)
        varied.variation = name
        wrong = [key for key, (low, high) in varied.ranges.items() if not -np.inf < low <= high < np.inf]
        expect(not wrong, f"variation {name!r}: the range of {', '.join(wrong)} is not from a lower to a higher number")
        layouts = [
            [(b.pose, b.mass, getattr(b, "elastic", None)) for b in varied.scene(seed).bodies] for seed in (0, 1)
        ]
        expect(layouts[0] != layouts[1], f"variation {name!r}: two seeds give the same layout; use self.draw(seed)")
        check_nothing_overlaps_at_spawn(varied)
    return ", ".join(task.variations) or "it has none"


def idle(task: Task) -> tuple[str, Outcome]:
    """Hold the arm at home without a tool for `REST_S`; the engine's name and the outcome."""
    try:
        still = at_home(task)
    except UserError as error:  # reported by the check of home
        raise LeftOut("the arm does not reach home") from error
    job = Rollout(Tool(), still, SEEDS[0], hold_s=REST_S, record_hz=SAMPLE_HZ, forces=task.reads_trace)
    name, simulator = some_simulator(soft=bool(task.scene(SEEDS[0]).softs))
    outcome, again = simulator.rollout(task, [job, job])
    expect(outcome.error is None, f"in {name} the scene breaks by itself: {outcome.error}")
    same = np.array_equal(start(outcome).positions, start(again).positions)
    expect(same, f"in {name} one seed gave two layouts")
    return name, outcome


def check_what_rests_stays_at_rest(task: Task) -> str:
    """What moves by itself may move once the robot's motion begins, and push others then."""
    name, outcome = idle(task)
    try:
        found = findings(task.scene(SEEDS[0]), task.robot, Tool(), film(outcome))
    except Explosion as error:
        raise AssertionError(f"in {name} the scene explodes by itself: {error}") from error
    expect(not found, f"in {name}, while the arm waits: {'; '.join(finding.text for finding in found)}")
    scene = task.scene(SEEDS[0])
    if any(body.launched for body in scene.bodies) or any(joint.drive is not None for joint in scene.joints):
        return "some things move by themselves"
    ways = np.linalg.norm(end(outcome).positions - start(outcome).positions, axis=-1)
    body, way = start(outcome).names[int(ways.argmax())], float(ways.max())
    what = f"in {name} {body!r} moves {1000 * way:.0f} mm within {REST_S:g} s while the arm waits at home"
    expect(way < MAX_DRIFT_M, f"{what}; put it where it can rest, or give it friction")
    return f"in {name}"


def check_doing_nothing_earns_nothing(task: Task) -> str:
    """At spawn, and after the arm has waited at home: a scene must not solve itself."""
    scene = task.scene(SEEDS[0])
    state = scene.state()
    name, outcome = idle(task)
    after = f"after {REST_S:g} s in {name}"
    finished = (scene.complete(start(outcome)), scene.complete(end(outcome)))
    trace = make_trace(scene, [find_contacts(scene, task.robot, Tool(), film(outcome))])[0]
    tried = {"at spawn": (state, state, _without_contacts(state, state)), after: (*finished, trace)}
    for what, (first, last, between) in tried.items():
        reward = float(np.asarray(reward_of(task, first, last, between)))
        expect(np.isfinite(reward) and 0 <= reward <= 1, f"doing nothing earns {reward} {what}, not in [0, 1]")
        expect(reward < MAX_IDLE_REWARD, f"doing nothing earns {reward:.2f} {what}; it must be under {MAX_IDLE_REWARD}")
    return f"in {name}"
