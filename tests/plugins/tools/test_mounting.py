import numpy as np
import pytest

from core.design import Component, Tool
from core.designs.rules import check_tool
from core.geometry import Box, Pose
from plugins.conformance.sample_tools import LengthOnly
from plugins.conformance.shared import brief
from plugins.tools.mounting import describe_mount, first_box
from tasks.one_book import OneBook
from tests.support.panda import PANDA, on_panda


@pytest.mark.parametrize("gripper", [False, True])
def test_the_example_hangs_from_its_mount(gripper):
    box = first_box(brief(on_panda(OneBook()), LengthOnly(), gripper=gripper))
    component = Component(
        box.name, box.mount, Pose(box.place), Box(tuple(box.size)), 0.005
    )
    check_tool(Tool((component,), gripper), PANDA)


def test_the_mounts_are_described():
    rigid, fingers = (
        describe_mount(brief(on_panda(OneBook()), LengthOnly(), gripper=g))
        for g in (False, True)
    )
    assert "takes the place of the gripper" in rigid
    assert "a disc of\n63 mm diameter" in rigid
    assert all(
        f"In its frame `{name}` takes up x " in fingers
        for name in ("left_finger", "right_finger")
    )
    assert "meet when it is closed" in fingers
    assert np.all(
        [word in fingers for word in ("tip at", "inner face at", "opens toward")]
    )
