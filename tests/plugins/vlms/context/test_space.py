"""The room that a tool takes, from its mount and at each waypoint."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import GRIPPER_MOUNTS, Candidate, Component, Tool
from core.geometry import Box, Pose
from plugins.vlms.context.space import describe_space, describe_sweep

POST = Component(
    "post", "tool_mount", Pose.xyz_rpy((0.0, 0.0, -0.1)), Box((0.02, 0.04, 0.2))
)
TURNED = Pose.xyz_rpy((0.1, 0.0, -0.1), (0.0, 0.0, np.pi / 2))
BLADE = Component("blade", "post", TURNED, Box((0.3, 0.02, 0.02)))
TOOL = Tool((POST, BLADE))
PLAN = np.array([[0.5, 0, 0.5, 0, 0, 0], [0.5, 0, 0.5, 0, 0, np.pi / 2]])


def test_a_component_is_told_from_the_mount_whatever_it_hangs_from():
    assert describe_space(TOOL) == {
        "post": "-0.01 to 0.01, -0.02 to 0.02, -0.2 to 0",
        "blade": "0.09 to 0.11, -0.15 to 0.15, -0.21 to -0.19",
    }


def test_the_tool_is_told_in_the_world_at_each_waypoint():
    assert describe_sweep(Candidate(TOOL, PLAN)) == {
        1: "0.49 to 0.61, -0.15 to 0.15, 0.29 to 0.5",
        2: "0.35 to 0.65, -0.01 to 0.11, 0.29 to 0.5",
    }


@pytest.mark.parametrize("count", [24, 25, 60])
def test_of_a_long_plan_waypoints_from_the_first_to_the_last_are_told(count):
    swept = describe_sweep(Candidate(TOOL, np.zeros((count, 6))))
    assert len(swept) == 24
    assert (min(swept), max(swept)) == (1, count)


def test_a_tool_on_two_fingers_is_told_from_each_but_not_in_the_world():
    left = replace(POST, parent=GRIPPER_MOUNTS[0])
    fingers = Tool((left,), gripper=True)
    assert describe_space(fingers).keys() == {"post"}
    assert describe_sweep(Candidate(fingers, PLAN)) == {}
