"""A vessel that is taken by its handles and turned over where its content has to go."""

import pytest

from tasks.turkey_legs import TurkeyLegs
from tests.plugins.vlms.offline.trying import earn, list_ways, make_brief, read_task
from tests.support.panda import on_panda

pytestmark = pytest.mark.slow

GOAL = """
  - {bodies: [cube], place: [0.6, 0.3, null], tolerance: 0.1}
"""


def write_pan(holds, handles):
    """Write a cube in a pan."""
    ends = "".join(
        f"\n      - {{box: [0.08, 0.04, 0.01], position: [0, {y}, 0.045]}}"
        for y in handles
    )
    return f"""
  - {{name: cube, box: [0.03, 0.03, 0.03], position: [0.6, 0, 0.026], mass: 0.05}}
  - name: pan
    position: [0.6, 0, 0]
    {holds}
    parts:
      - {{box: [0.2, 0.2, 0.01], position: [0, 0, 0.005]}}
      - {{box: [0.2, 0.01, 0.05], position: [0, 0.095, 0.035]}}
      - {{box: [0.2, 0.01, 0.05], position: [0, -0.095, 0.035]}}
      - {{box: [0.01, 0.18, 0.05], position: [0.095, 0, 0.035]}}
      - {{box: [0.01, 0.18, 0.05], position: [-0.095, 0, 0.035]}}{ends}
"""


@pytest.mark.parametrize(
    ("holds", "handles", "pours"),
    [
        ("mass: 0.3", (0.12, -0.12), True),
        ("fixed: true", (0.12, -0.12), False),  # it doesn't come along
        ("mass: 0.3", (0.12,), False),
        ("mass: 0.3", (), False),
    ],
)
def test_a_loose_vessel_with_two_handles_is_poured_out(tmp_path, holds, handles, pours):
    brief = make_brief(read_task(tmp_path, write_pan(holds, handles), GOAL))
    assert ("pour" in list_ways(brief)) == pours


@pytest.mark.thorough
def test_legs_are_poured_into_the_box():
    rewards = earn(make_brief(on_panda(TurkeyLegs())), "pour", 4)
    assert sum(reward > 0.9 for reward in rewards) >= 2
