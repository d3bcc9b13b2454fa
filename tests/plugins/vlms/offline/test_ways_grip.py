"""Fingers that close on a body and carry it."""

import numpy as np
import pytest

from plugins.vlms.offline.hand import hand_of
from plugins.vlms.offline.search import Search
from tests.plugins.vlms.offline.trying import earn, list_ways, make_brief, read_task

pytestmark = pytest.mark.slow

CUBE = """
  - {name: cube, box: [0.04, 0.04, 0.04], position: [0.5, 0, 0.02], mass: 0.05}
"""
COVERED = f"""{CUBE}
  - {{name: lid, box: [0.2, 0.2, 0.02], position: [0.5, 0, 0.06], fixed: true}}
"""
WIDE = """
  - {name: box, box: [0.2, 0.2, 0.04], position: [0.5, 0, 0.02], mass: 0.05}
"""
ASIDE = """
  - {bodies: ["*"], place: [0.5, 0.2, null], tolerance: 0.03, released: true}
"""
UP = """
  - {bodies: ["*"], raised: 0.15, held: true}
"""


@pytest.mark.parametrize(
    ("bodies", "tool", "way", "suits"),
    [
        (CUBE, "urdf", "grip", True),
        (CUBE, "none", "hand", True),
        (WIDE, "urdf", "grip", True),
        (WIDE, "none", "hand", False),  # between bare fingers there is less room
        (COVERED, "urdf", "grip", False),
    ],
)
def test_fingers_are_for_bodies_that_they_get_to(tmp_path, bodies, tool, way, suits):
    task = read_task(tmp_path, bodies, UP)
    brief = make_brief(task, gripper=True, tool=tool)
    assert (way in list_ways(brief)) == suits


@pytest.mark.parametrize(("x", "sign"), [(0.2, -1), (0.5, 0), (0.9, 1)])
def test_pads_are_as_far_from_the_hand_as_the_arm_lacks(tmp_path, x, sign):
    """What is too near to the robot is gripped by a hand that stays farther away."""
    bodies = CUBE.replace("0.5", str(x))
    brief = make_brief(read_task(tmp_path, bodies, UP), gripper=True)
    for option in Search(brief).options:
        ranges = option.way.ranges
        values = {name: (low + high) / 2 for name, (low, high) in ranges.items()}
        (job,) = option.jobs
        mount = option.way.head(job, values).mount
        ahead = job.frame.rotation.apply(
            mount.position - hand_of(job.layout.robot).tips.position
        )
        assert np.sign(np.round(ahead[0], 3)) == sign


@pytest.mark.parametrize(("beside", "suits"), [(0.016, False), (0.018, True)])
def test_there_is_room_for_the_widest_pads(tmp_path, beside, suits):
    """Pads of 8 mm open to 10 mm beside the body."""
    bodies = CUBE
    for number, side in enumerate((-1, 1)):
        y = side * (0.02 + beside + 0.01)
        bodies += f"  - {{name: wall_{number}, box: [0.3, 0.02, 0.1], position: [0.5, {y}, 0.05], fixed: true}}\n"
        x = 0.5 + side * (0.02 + beside + 0.01)
        bodies += f"  - {{name: end_{number}, box: [0.02, 0.3, 0.1], position: [{x}, 0, 0.05], fixed: true}}\n"
    brief = make_brief(read_task(tmp_path, bodies, UP), gripper=True)
    assert ("grip" in list_ways(brief)) == suits


@pytest.mark.parametrize("goals", [UP, ASIDE])
@pytest.mark.parametrize(("tool", "way"), [("urdf", "grip"), ("none", "hand")])
def test_fingers_carry_a_body(tmp_path, goals, tool, way):
    task = read_task(tmp_path, CUBE, goals)
    rewards = earn(make_brief(task, gripper=True, tool=tool), way, 6)
    assert sum(reward > 0.9 for reward in rewards) >= 3
