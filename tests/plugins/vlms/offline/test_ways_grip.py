"""Fingers that close on a body and carry it."""

import pytest

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


@pytest.mark.parametrize("goals", [UP, ASIDE])
@pytest.mark.parametrize(("tool", "way"), [("urdf", "grip"), ("none", "hand")])
def test_fingers_carry_a_body(tmp_path, goals, tool, way):
    task = read_task(tmp_path, CUBE, goals)
    rewards = earn(make_brief(task, gripper=True, tool=tool), way, 6)
    assert sum(reward > 0.9 for reward in rewards) >= 3
