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


def remark(thick):
    """What is said of a plate of 30 mm by 200 mm that is so thick."""
    shape = Box((0.03, thick, 0.2))
    tray = Component("tray", "tool_mount", Pose.xyz_rpy((0, 0, -0.1)), shape, 0.05)
    return say_printable(RUN, Candidate(Tool((tray,)), None))


def test_a_stiff_tool_is_not_said_to_bend():
    assert "not rigid" not in remark(0.03)


@pytest.mark.parametrize(("thick", "said"), [(0.003, ""), (0.0005, "no (")])
def test_a_tool_that_bends_is_said_to_with_what_to_type(thick, said):
    line = remark(thick)
    assert line.startswith("printable in pla: ")
    assert said in line
    assert "component 'tray' is not rigid: of pla, 1 N would bend it by " in line
    assert line.endswith(" mm; search with fitness=buildable material=pla")
