"""A rod that presses what a joint holds."""

import numpy as np
import pytest

from core.interfaces import PAPER
from plugins.tasks.file.task import FileTask
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.joints import list_spots
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.wants import list_alternatives
from tests.plugins.vlms.offline.trying import earn, list_ways, make_brief, read_task
from tests.support.panda import on_panda

pytestmark = pytest.mark.slow

LEVER = """
  - {name: post, box: [0.04, 0.04, 0.1], position: [0.5, 0, 0.05], fixed: true}
  - {name: lever, box: [0.2, 0.02, 0.02], position: [0.5, 0, 0.12], mass: 0.1}
joints:
  - {name: pivot, kind: hinge, body: lever, parent: post, lower: 0, upper: 1.2, friction: 0.02}
"""
KNOB = """
  - {name: post, box: [0.04, 0.04, 0.1], position: [0.5, 0, 0.05], fixed: true}
  - {name: knob, box: [0.03, 0.03, 0.03], position: [0.5, 0, 0.117], mass: 0.1}
  - {name: left, box: [0.1, 0.02, 0.4], position: [0.5, 0.05, 0.2], fixed: true}
  - {name: right, box: [0.1, 0.02, 0.4], position: [0.5, -0.05, 0.2], fixed: true}
  - {name: behind, box: [0.02, 0.12, 0.4], position: [0.56, 0, 0.2], fixed: true}
  - {name: before, box: [0.02, 0.12, 0.4], position: [0.44, 0, 0.2], fixed: true}
joints:
  - {name: pivot, kind: slider, body: knob, parent: post, axis: [1, 0, 0], lower: 0, upper: 0.01}
"""


@pytest.mark.parametrize(
    ("bodies", "to", "suits"),
    [(LEVER, 0.8, True), (KNOB, 0.01, False)],  # no rod gets beside the knob
)
def test_a_rod_is_for_what_it_gets_to(tmp_path, bodies, to, suits):
    goal = f"\n  - {{joint: pivot, to: {to}, tolerance: 0.1}}\n"
    ways = list_ways(make_brief(read_task(tmp_path, bodies, goal)))
    assert ("press" in ways) == suits


def test_points_are_on_the_body_and_pushed_head_on(tmp_path):
    """A round lever: the corners of the box around it are 4 mm off."""
    bodies = LEVER.replace(
        "box: [0.2, 0.02, 0.02]", "cylinder: {radius: 0.01, length: 0.2}"
    )
    bodies = bodies.replace("mass: 0.1}", "mass: 0.1, rpy_deg: [0, 90, 0]}")
    bodies = bodies.replace("parent: post", "parent: post, axis: [1, 0, 0]")
    goal = "\n  - {joint: pivot, to: 0.8, tolerance: 0.1}\n"
    task = read_task(tmp_path, bodies, goal)
    layout = Layout(task, 0, PAPER)
    ((want,),) = list_alternatives(task, layout.scene)
    spots = [*list_spots(Job(layout, want))]
    assert spots
    for spot in spots:
        _, y, z = spot.point - [0.5, 0, 0.12]
        assert np.hypot(y, z) == pytest.approx(0.01, abs=1e-4)
        assert abs(spot.way[1]) * abs(y) / 0.01 > 0.85


@pytest.mark.parametrize("scene", ["press_button", "turn_valve"])
def test_a_rod_moves_a_joint(scene):
    task = on_panda(FileTask(f"tasks/scenes/{scene}.yaml"))
    rewards = earn(make_brief(task), "press", 6)
    assert sum(reward > 0.85 for reward in rewards) >= 3
