import numpy as np
import pytest

from core.design import Component, Tool
from core.geometry import Box, Pose
from core.store.artifacts import tool_mesh
from tests.panda import FINGER_OPEN


def box(name, parent, at, size, rpy=(0, 0, 0)):
    return Component(name, parent, Pose.xyz_rpy(at, rpy), Box(size))


def test_a_tool_is_printed_in_millimetres():
    tool = Tool(
        (
            box("shaft", "tool_mount", (0, 0, -0.05), (0.02, 0.02, 0.1)),
            box("blade", "shaft", (0.06, 0, 0), (0.1, 0.02, 0.02), (0, np.pi / 2, 0)),
        )
    )
    mesh = tool_mesh(tool, FINGER_OPEN)
    np.testing.assert_allclose(mesh.bounds, [[-10, -10, -100], [70, 10, 0]], atol=1e-6)
    assert mesh.volume == pytest.approx(1e9 * (0.02 * 0.02 * 0.1 + 0.1 * 0.02 * 0.02))


def test_a_pair_of_attachments_is_printed_side_by_side():
    fingers = ("left_finger", 1), ("right_finger", -1)
    pads = (box(f"pad_{mount}", mount, (0, side * 0.0075, 0.07), (0.02, 0.015, 0.04)) for mount, side in fingers)
    mesh = tool_mesh(Tool(tuple(pads), gripper=True), FINGER_OPEN)
    np.testing.assert_allclose(mesh.bounds, [[-10, -55, 50], [10, 55, 90]], atol=1e-6)
    assert mesh.body_count == 2
