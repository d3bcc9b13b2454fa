"""Test what PyBullet alone has. What every engine must do is in test_conformance.py and test_settings.py."""

import pytest

from core.plugins import installed
from core.scene import table
from plugins.conformance.output import bits
from plugins.conformance.sample_tools import stick
from plugins.conformance.worlds import cube
from tests.support.tongs import hammer
from tests.support.worlds import move

pytest.importorskip("pybullet")


PLAN = [[0.6, 0.2, 0.15, 0, 0.3, 0], [0.6, -0.2, 0.15, 0, 0, 0.5]]
THINGS = (
    table(),
    cube(at=(0.6, 0, 0.05)),
    hammer("hammer", (0.7, 0.1, 0.1)),
    hammer("other", (0.5, -0.1, 0.1), 0.06),
)


def test_what_is_kept_between_rollouts_changes_no_bit_of_them():
    def played(sim, tool, bodies):
        return bits(move(sim, PLAN, *bodies, tool=tool, record_hz=25))

    jobs = [
        (stick(0.25), THINGS),
        (stick(0.3), THINGS),
        (stick(0.25), THINGS[:2]),
        (stick(0.25), THINGS),
    ]
    one = installed().create("sim", "pybullet")
    assert [played(one, *job) for job in jobs] == [
        played(installed().create("sim", "pybullet"), *job) for job in jobs
    ]
