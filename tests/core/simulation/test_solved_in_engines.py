"""Solved in each engine: what drives bring somewhere while the arm waits, met by a little and missed by a little."""

import numpy as np
import pytest

from core.design import Candidate, Tool
from core.interfaces import Waypoints
from core.plugins import installed
from tests.support.engines import every_simulator, simulator
from tests.support.playing import evaluate_batch
from tests.support.text import replaced_all

SCENE = """
name: Sled
description: A sled is driven by 0.1 m to the right within half a second, and a block beside it by 1 cm.
bodies:
  - {name: sled, box: [0.05, 0.05, 0.05], position: [0.7, 0.3, 0.3], mass: 0.2}
  - {name: block, box: [0.05, 0.05, 0.05], position: [0.7, 0.4, 0.3], mass: 0.2}
joints:
  - {name: runs, kind: slider, body: sled, axis: [1, 0, 0], drive: {times: [0, 0.5], positions: [0, 0.1], force: 50}}
  - {name: creeps, kind: slider, body: block, axis: [1, 0, 0], drive: {times: [0, 0.5], positions: [0, 0.01], force: 9}}
goals:
  - GOAL
every: true
"""


def solved(tmp_path, engine, goal):
    file = tmp_path / "sled.yaml"
    file.write_text(replaced_all(SCENE, ("GOAL", goal)))
    task = installed().create("task", "file", file=str(file))
    home = Waypoints(np.array([[*task.home.position, *task.home.rpy]]))
    (tried,) = evaluate_batch(task, simulator(engine), [Candidate(Tool(), home)])
    (trial,) = tried.trials
    assert trial.status == "ok", trial.reason
    assert trial.solved == tried.solved
    margins = [margin.margin for margin in trial.margins]
    assert not margins or (min(margins) >= 0) == trial.solved
    return trial.solved


@every_simulator
@pytest.mark.parametrize(
    ("goal", "met", "missed"),
    [
        ("{bodies: [sled], place: [BY, null, null], tolerance: 0.012}", 0.8115, 0.8125),
        ("{joint: runs, to: '> BY'}", 0.0995, 0.1005),
        ("{bodies: [sled], moved: ['> BY', null, null]}", 0.0995, 0.1005),
        ("{bodies: [sled], place: [0.8, null, null], by_s: BY}", 0.52, 0.4),
        ("{joint: runs, to: '> 0.09', keep: [block], kept_m: BY}", 0.0105, 0.0095),
        ("{bodies: [sled, block], moved: ['> BY', null, null]}", 0.0095, 0.0105),
    ],
)
def test_it_is_within_its_own_tolerance_or_it_is_not(
    engine, goal, met, missed, tmp_path
):
    assert solved(tmp_path, engine, goal.replace("BY", str(met)))
    assert not solved(tmp_path, engine, goal.replace("BY", str(missed)))
