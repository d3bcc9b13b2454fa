"""A key that goes through a slot, turns, and lifts."""

import pytest

from tests.plugins.vlms.offline.trying import earn, list_ways, make_brief, read_task

pytestmark = pytest.mark.slow

GOAL = """
  - {bodies: [cover], raised: 0.1, held: true}
"""


def write_cover(x, y):
    """Write a cover with a hole x long and y wide in its middle, over a hollow."""
    return f"""
  - name: frame
    fixed: true
    position: [0.6, 0, 0]
    parts:
      - {{box: [0.2, 0.02, 0.05], position: [0, 0.09, 0.025]}}
      - {{box: [0.2, 0.02, 0.05], position: [0, -0.09, 0.025]}}
  - name: cover
    position: [0.6, 0, 0.0576]
    mass: 0.5
    parts:
      - {{box: [0.2, {0.1 - y / 2}, 0.015], position: [0, {0.05 + y / 4}, 0]}}
      - {{box: [0.2, {0.1 - y / 2}, 0.015], position: [0, {-0.05 - y / 4}, 0]}}
      - {{box: [{0.1 - x / 2}, {y}, 0.015], position: [{0.05 + x / 4}, 0, 0]}}
      - {{box: [{0.1 - x / 2}, {y}, 0.015], position: [{-0.05 - x / 4}, 0, 0]}}
"""


@pytest.mark.parametrize(
    ("x", "y", "suits"),
    [(0.08, 0.04, True), (0.04, 0.08, True), (0.06, 0.06, False)],
)
def test_a_key_is_for_a_hole_that_is_longer_than_wide(tmp_path, x, y, suits):
    brief = make_brief(read_task(tmp_path, write_cover(x, y), GOAL))
    assert ("key" in list_ways(brief)) == suits


def test_a_key_lifts_a_cover(tmp_path):
    brief = make_brief(read_task(tmp_path, write_cover(0.08, 0.04), GOAL))
    assert sum(reward > 0.9 for reward in earn(brief, "key", 4)) >= 3
