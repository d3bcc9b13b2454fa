"""Check that nothing happens in a task while the arm waits, in the first engine that is installed."""

from __future__ import annotations

import numpy as np

from core.design import Tool
from core.errors import UserError
from core.interfaces import Rollout, Task
from core.robot.trajectory import at_home
from core.solids.contacts import find_contacts, make_trace
from core.solids.tracks import SAMPLE_HZ
from plugins.conformance.shared import LeftOut, between, expect, some_simulator
from plugins.conformance.task import SEEDS, reward_for
from plugins.conformance.worlds import end, film, play, start

MAX_DRIFT_M = 0.005  # of a body that nothing touches but what it rests on, in
REST_S = 2.0
MAX_IDLE_REWARD = 0.02


def check_nothing_happens_while_the_arm_waits(task: Task) -> str:
    """Nothing drifts, and nothing is earned, while the arm is at home without a tool: a scene must not solve itself."""
    try:
        still = at_home(task)
    except UserError as error:  # reported by the check of home
        raise LeftOut("the arm does not reach home") from error

    scene = task.scene(SEEDS[0])
    spawn = scene.state()
    between(
        "what doing nothing earns at spawn",
        reward_for(task, spawn, spawn),
        0.0,
        MAX_IDLE_REWARD,
    )

    name, simulator = some_simulator(soft=bool(scene.softs))
    job = Rollout(
        Tool(),
        still,
        SEEDS[0],
        hold_s=REST_S,
        record_hz=SAMPLE_HZ,
        forces=task.reads_trace,
    )
    outcome = play(simulator, task, job)
    begin = scene.complete(start(outcome))
    last = scene.complete(end(outcome))
    moving = any(body.launched for body in scene.bodies) or any(
        joint.drive is not None for joint in scene.joints
    )
    ways = np.linalg.norm(last.positions - begin.positions, axis=-1)
    for body, way in zip(begin.names, ways, strict=True):
        what = f"in {name} {body!r} moves {1000 * way:.0f} mm within {REST_S:g} s while the arm waits at home"
        expect(
            moving or way < MAX_DRIFT_M,
            f"{what}; put it where it can rest, or give it friction",
        )

    contacts = find_contacts(scene, task.robot, Tool(), film(outcome))
    trace = make_trace(scene, contacts)
    earned = reward_for(task, begin, last, trace)
    between(
        f"what doing nothing earns after {REST_S:g} s in {name}",
        earned,
        0.0,
        MAX_IDLE_REWARD,
    )

    return f"in {name}"
