"""What is said of the best tool at the end of a run: whether it can be made, and bears what it has to."""

from types import SimpleNamespace

import pytest

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.values.materials import PAPER
from plugins.results.workshop.remark import say_printable
from tests.panda import PANDA

RUN = SimpleNamespace(
    representation=SimpleNamespace(material=PAPER), task=SimpleNamespace(robot=PANDA)
)


@pytest.mark.parametrize(
    ("thick", "said"),
    [
        (0.03, ["printable in pla: yes"]),
        (
            0.006,
            [
                "component 'tray' is not rigid: of pla, 1 N would bend it by ",
                " mm; search with fitness=buildable material=pla",
            ],
        ),
        (0.0005, ["printable in pla: no (", "fitness=buildable material=pla"]),
    ],
)
def test_a_tool_that_bends_is_said_to_with_what_to_type(thick, said):
    shape = Box((0.03, thick, 0.2))
    tray = Component("tray", "tool_mount", Pose.xyz_rpy((0, 0, -0.1)), shape, 0.05)
    line = say_printable(RUN, Candidate(Tool((tray,)), None))
    assert all(words in line for words in said)
    assert line.endswith(said[-1])
