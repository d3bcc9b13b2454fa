import math
from dataclasses import replace

import numpy as np
import pytest

from core.design import Component, DesignError, Tool, ToolJoint
from core.designs.rules import SpawnRules, check_tool
from core.designs.tool_joints import moved
from core.geometry import Box, Pose
from plugins.conformance.joints import hinged, sliding, tongs
from tests.core.designs.test_rules import CubeOnTable
from tests.panda import PANDA, on_panda


def hinge(**given):
    return ToolJoint("hinge", given.pop("axis", (1, 0, 0)), given.pop("lower", -1), given.pop("upper", 1), **given)


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({"axis": (0, 0, 0)}, "needs a length"),
        ({"axis": (math.nan, 0, 0)}, "needs a length"),
        ({"axis": (math.inf, 0, 0)}, "needs a length"),
        ({"lower": 0.1}, "must hold 0"),
        ({"lower": 0, "upper": 0}, "more than 0"),
        ({"upper": math.nan}, "must hold 0"),
        ({"damping": -1}, "damping must be 0 or more"),
        ({"friction": math.nan}, "friction must be 0 or more"),
        ({"stiffness": -0.1}, "stiffness must be 0 or more"),
    ],
)
def test_joints_that_make_no_sense(given, fault):
    with pytest.raises(DesignError, match=fault):
        hinge(**given)


def test_an_axis_becomes_a_unit_vector():
    assert hinge(axis=(0, 3, -4)).axis == (0.0, 0.6, -0.8)


@pytest.mark.parametrize(
    ("joint", "fault"),
    [
        (hinge(lower=-7), "from -7 to 1 rad; at most 6.28"),
        (ToolJoint("slider", (1, 0, 0), 0, 0.6), "from 0 to 0.6 m; at most 0.5"),
        (hinge(rest=10), "relaxed at 10 rad"),
        (
            hinge(stiffness=100),
            r"too stiff a spring: .* swing at \d+ Hz, and at most 20 .* a stiffness of 5.3 would do",
        ),
        (hinge(damping=1), "too much damping: 1 for an inertia of"),
    ],
)
def test_joints_that_engines_can_not_follow(joint, fault):
    check_tool(hinged(0.2, hinge()), PANDA)
    with pytest.raises(DesignError, match=f"the joint of component 'rod'.*{fault}"):
        check_tool(hinged(0.2, joint), PANDA)


def test_the_stiffness_that_is_proposed_is_taken():
    with pytest.raises(DesignError) as refused:
        check_tool(hinged(0.2, hinge(stiffness=1000)), PANDA)
    proposed = float(str(refused.value).split("a stiffness of ")[1].split()[0])
    check_tool(hinged(0.2, hinge(stiffness=0.95 * proposed)), PANDA)


def test_a_joint_moves_something():
    post, rod = hinged(0.2, hinge()).components
    with pytest.raises(DesignError, match=r"'rod' moves 0.0005 kg; at least 0.001 kg"):
        check_tool(Tool((post, replace(rod, mass=0.0005))), PANDA)


def test_number_of_joints():
    components, parent = [*hinged(0.2, hinge()).components[:1]], "post"
    for i in range(9):
        at = Pose(np.array([0.0, 0.0, -0.06 if i == 0 else -0.02]))
        components.append(Component(f"c{i}", parent, at, Box((0.02, 0.02, 0.02)), 0.01, joint=hinge()))
        parent = f"c{i}"
    check_tool(Tool(tuple(components[:9])), PANDA)
    with pytest.raises(DesignError, match="9 moving joints; at most 8"):
        check_tool(Tool(tuple(components)), PANDA)


def test_what_a_joint_moves():
    """A rod about its end, with another behind it; a block along its slide."""
    tool = hinged(0.5, ToolJoint("hinge", (1, 0, 0), -1, 1, (0, 0, 0.1)))
    mass, inertia = moved(tool, tool.bearers[0])
    assert mass == pytest.approx(0.1)
    assert inertia == pytest.approx(0.1 * (0.2**2 + 0.01**2) / 12 + 0.1 * 0.1**2)
    more = Component("tip", "rod", Pose(np.array([0.0, 0.0, -0.11])), Box((0.02, 0.02, 0.02)), 0.05)
    mass, inertia = moved(Tool((*tool.components, more)), tool.bearers[0])
    assert mass == pytest.approx(0.15)
    own = 0.1 * (0.2**2 + 0.01**2) / 12 + 0.1 * 0.1**2
    assert inertia == pytest.approx(own + 0.05 * (0.02**2 / 6 + 0.21**2))
    block = sliding(ToolJoint("slider", (0, 0, 1), -0.1, 0.1))
    assert moved(block, block.bearers[0]) == (0.2, 0.2)


def test_tongs_pass_every_rule():
    check_tool(tongs(), PANDA)
    SpawnRules(on_panda(CubeOnTable()), 0).check(tongs())


def test_frames_of_bearers():
    """A component with a joint is in its own link's frame, and its children too."""
    tool = tongs()
    assert [bearer.name for bearer in tool.bearers] == ["left", "right"]
    assert tool.borne_on == ("tool_mount", "left", "right")
    for component in tool.components:
        bearer, pose = tool.borne[component.name]
        link = next((b.pose for b in tool.bearers if b.name == bearer), Pose())
        np.testing.assert_allclose((link @ pose).matrix, tool.placed()[component.name][1].matrix, atol=1e-12)
