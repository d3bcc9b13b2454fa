"""Bodies side by side, of which goals are met and missed by a little."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from core.design import Tool
from core.goals import goals_margins
from core.interfaces import (
    JointTrajectory,
    Rollout,
)
from core.robot.kinematics import arm_of
from core.solids.contacts import find_contacts, make_trace
from core.solids.record_rate import MAX_HZ
from plugins.tasks.file.task import FileTask
from tests.support.engines import simulator
from tests.support.panda import on_panda

FILES = Path(__file__).parents[1] / "plugins/tasks/file"
LANES = FILES / "lanes.yaml"


SOFTS = FILES / "softs.yaml"


GOAL = "{bodies: [tray], raised: 0.09}"


STAYED = (
    "{bodies: [slab], node: 0, place: [0.47, 0.27, null], tolerance: 0.003, rest: true}"
)


def read(folder, goals, scene=LANES, goal=GOAL):
    file = folder / "lanes.yaml"
    file.write_text(scene.read_text().replace(goal, "\n  - ".join(goals)))
    return on_panda(FileTask(str(file)))


NO_TOOL = Tool()


@cache
def play(engine, scene=LANES, tool=NO_TOOL):
    """What becomes of the lanes in 1 s: the state before and after, and what happened in between."""
    task = on_panda(FileTask(str(scene)))
    scene = task.scene(0).furnished(tool)
    home = arm_of(task.robot).home_for(task.home)
    still = JointTrajectory(np.zeros(1), home[None], np.zeros(1))
    job = Rollout(tool, still, 1, settle_s=0.1, hold_s=1.0, record_hz=MAX_HZ, forces=True)  # fmt: skip
    (outcome,) = simulator(engine).rollout(task, [job])
    assert outcome.error is None
    contacts = find_contacts(scene, task.robot, tool, outcome.recording)
    trace = make_trace(scene, contacts)
    return scene.complete(outcome.start), scene.complete(outcome.end), trace


def check_first_alone_is_met(tasks, played, engine):
    """Check that what was played meets the first of two tasks, and misses the other."""
    met, missed = [earn(task, played) for task in tasks]
    assert met == pytest.approx(1, abs=1e-6), engine
    assert missed < 0.999, engine


def earn(task, played):
    """What a task pays for what was played; its margins say the same of whether it is solved."""
    reward = float(task.reward(*played))
    solved = all(margin.is_kept for margin in goals_margins(task, *played))
    assert solved == task.is_solved(reward, *played) == (reward > 1 - 1e-9)
    return reward
