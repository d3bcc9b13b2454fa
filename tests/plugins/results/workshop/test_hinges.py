"""Hinges as they are printed: the pin fits, the links turn freely, and what can't be made is said."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from core.design import Component, Tool, ToolJoint
from core.geometry import Box, Pose
from core.interfaces import Material
from plugins.conformance.joints import sliding
from plugins.results.workshop.hinges import make_hinges
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.solid import rod, union
from plugins.results.workshop.tool import make_tool
from tests.panda import PANDA

AT = np.array([0.0, 0.0, -0.08])  # of the axis, along x
LOWER, UPPER = -0.3, 0.7


def pair(width=0.05, parent=0.02, thick=0.016):
    """A post, and a jaw that is wider than it along the axis."""
    post = Component("post", "tool_mount", Pose(np.array([0, 0, -0.045])), Box((parent, 0.016, 0.09)), 0.03)
    joint = ToolJoint("hinge", (1.0, 0.0, 0.0), LOWER, UPPER, (0.0, 0.0, 0.04))
    jaw = Component("jaw", "post", Pose(np.array([0, 0, -0.075])), Box((width, thick, 0.1)), 0.03, joint=joint)
    return Tool((post, jaw))


def along(length, wide):
    """A rod on the axis, metres and millimetres."""
    half = np.array([length / 2, 0, 0])
    return union([rod(AT - half, AT + half, wide / 2000)])


@pytest.mark.parametrize("tool", [pair(), pair(0.02, 0.05)])  # the one that is wider becomes a fork
def test_a_pin_fits_and_the_links_turn(tool):
    made = make_tool(tool, PANDA, Material(), Printer(), Fit())
    post, jaw = (part.solid.body for part in made.parts)
    middle = post if tool.components[0].shape.size[0] < 0.04 else jaw
    assert (along(0.05, 2.98) ^ (post + jaw)).volume() < 0.1  # tight in the fork
    assert (along(0.02, 3.38) ^ middle).volume() < 0.1
    for angle in np.linspace(LOWER, UPPER, 37):
        turn = Rotation.from_rotvec([angle, 0, 0]).as_matrix()
        turned = jaw.transform(np.column_stack([turn, 1000 * (AT - turn @ AT)]))
        assert (turned ^ post).volume() < 0.1
        assert turned.min_gap(post, 1.0) > 0.1
    assert made.hardware[-1].startswith("1 pin 3 m6 x 50 for the hinge of jaw: tight in")
    assert not [check for check in made.checks if not check.passed and check.name != "weight"]


@pytest.mark.parametrize(
    ("tool", "said"),
    [
        (sliding(ToolJoint("slider", (0, 0, 1), -0.1, 0.1)), "a guide is not part of the solids"),
        (pair(0.022), "neither link is wider than the other on both sides"),
        (pair(0.3), "it would be 300 mm long"),
        (pair(thick=0.0035), "jaw is too thin about the axis"),
    ],
)
def test_what_can_t_be_made_is_said(tool, said):
    made = make_hinges(tool, Fit(), Printer())
    (check,) = made.checks
    assert not check.passed
    assert said in check.found
    assert (made.cuts, made.hardware) == ({}, [])


def test_a_fork_of_which_nothing_would_be_left_is_none():
    tool = pair()
    post, jaw = tool.components
    long = replace(jaw, shape=Box((0.03, 0.016, 0.03)), joint=replace(jaw.joint, origin=(0.0, 0.0, 0.0)))
    tool = Tool((post, replace(long, pose=Pose(np.array([0, 0, -0.035])))))
    assert "too little is left of jaw where tool turns" in make_hinges(tool, Fit(), Printer()).checks[0].found
