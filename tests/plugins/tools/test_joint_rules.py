import math
from dataclasses import replace

import numpy as np
import pytest

from core.design import Component, DesignError, Tool, ToolJoint
from core.designs.rules import check_tool
from core.designs.springs import bound_speeds, measure_lightness
from core.designs.start import SpawnRules
from core.geometry import Box, Pose
from core.values.materials import PAPER, Material
from plugins.conformance.joints import hinged, sliding
from plugins.tools.joint_rules import check_joints
from tests.support.panda import PANDA, on_panda
from tests.support.scenes import CubeOnTable
from tests.support.tongs import tongs


def hinge(**given):
    """A hinge at the upper end of a rod of 0.2 m."""
    ends = given.pop("lower", -1), given.pop("upper", 1)
    return ToolJoint(
        "hinge",
        given.pop("axis", (1, 0, 0)),
        *ends,
        given.pop("origin", (0, 0, 0.1)),
        **given,
    )


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


@pytest.mark.parametrize(
    ("joint", "fault"),
    [
        (hinge(lower=-7), "from -7 to 1 rad; at most 6.28"),
        (ToolJoint("slider", (1, 0, 0), 0, 0.6), "from 0 to 0.6 m; at most 0.5"),
        (hinge(rest=10), "relaxed at 10 rad"),
        (
            hinge(stiffness=100),
            r"too stiff a spring: .* swing at \d+ Hz, and at most 20 .* a stiffness of 21 would do",
        ),
        (
            hinge(damping=0.15, axis=(0, 0, 1)),
            "too much damping: 0.15 for an inertia of",
        ),
        (
            hinge(lower=0, upper=1e-300),
            "from 0 to 1e-300 rad; give it a range of 0.01 or more",
        ),
        (ToolJoint("slider", (1, 0, 0), 0, 1e-4), "a range of 0.0005 or more"),
    ],
)
def test_joints_that_engines_can_not_follow(joint, fault):
    check_tool(hinged(0.2, hinge()), PANDA)
    with pytest.raises(DesignError, match=f"the joint of component 'rod'.*{fault}"):
        check_tool(hinged(0.2, joint), PANDA)


def heavy(joint):
    """A block of 1 kg that swings on a post, or slides along it."""
    post = Component(
        "post",
        "tool_mount",
        Pose.xyz_rpy((0.0, 0.0, -0.15)),
        Box((0.03, 0.03, 0.3)),
        0.05,
    )
    block = Component(
        "block",
        "post",
        Pose.xyz_rpy((0.05, 0.0, 0.0)),
        Box((0.07, 0.2, 0.2)),
        1.0,
        joint=joint,
    )
    return Tool((post, block))


PLA = Material("pla", 1240, young_pa=2.5e9, strength_pa=26e6)


@pytest.mark.parametrize(
    ("joint", "fault", "material"),
    [
        # lifts a stone of 38 kg, the damper slows it, and the arm need not move
        (
            hinge(stiffness=60, damping=0.3, lower=-0.1, rest=1),
            "exerts 66 N m where it is 1.1 rad .* at most 3",
            PAPER,
        ),
        (
            hinge(stiffness=1.6, lower=-0.1, upper=0.1, rest=1.7),
            "springs hold 2.59 J .* at most 2 J are",
            PAPER,
        ),
        (
            hinge(stiffness=0.6, lower=-0.1, upper=0.1, rest=1),
            r"exerts 0.66 N m .* at most 0.45 N m",
            PLA,
        ),
        (
            ToolJoint("slider", (0, 0, 1), -0.1, 0.1, stiffness=300, rest=0.1),
            "exerts 60 N .* at most 50 N",
            PAPER,
        ),
        (hinge(damping=0.3), "a damping of 0.3 N m s/rad; at most 0.2", PAPER),
        (
            ToolJoint("slider", (0, 0, 1), -0.1, 0.1, damping=30),
            "a damping of 30 N s/m; at most 20",
            PAPER,
        ),
        (hinge(friction=4.0), "a dry friction of 4 N m; at most 3", PAPER),
    ],
)
def test_springs_and_dampers_are_as_strong_as_those_that_one_can_buy_or_print(
    joint, fault, material
):
    with pytest.raises(DesignError, match=fault):
        check_joints(heavy(joint), PANDA, material)


def test_all_springs_of_a_tool_share_an_energy():
    one = heavy(hinge(stiffness=1.4, lower=-0.1, upper=0.1, rest=1.4))
    check_joints(one, PANDA, PAPER)
    again = replace(
        one.components[1], name="other", pose=Pose.xyz_rpy((-0.05, 0.0, 0.0))
    )
    with pytest.raises(
        DesignError, match=r"springs hold 3.15 J .* give 'block' a smaller range"
    ):
        check_joints(Tool((*one.components, again)), PANDA, PAPER)


@pytest.mark.parametrize(
    ("joint", "where"),
    [
        (ToolJoint("slider", (0, 0, 1), -0.5, 0.1), "at -0.5 m: shorten"),
        (ToolJoint("slider", (1, 0, 0), 0, 0.2), "at 0.00.* m: shorten"),
    ],
)
def test_what_moves_goes_on_touching_what_bears_it(joint, where):
    with pytest.raises(
        DesignError,
        match=f"'block' leaves what bears it, 'tool_mount', where its joint is {where}",
    ):
        check_tool(heavy(joint), PANDA)
    near = heavy(ToolJoint("slider", (0, 0, 1), -0.1, 0.1))
    check_tool(near, PANDA)


@pytest.mark.parametrize(
    ("reach", "refused"),
    [(0.0, False), (0.09, False), (0.099, False), (0.103, True), (0.2, True)],
)
def test_what_swings_stays_clear_of_the_plate_that_shields_it(reach, refused):
    """The block of 0.2 m slides up the post, and a plate on the post is 0.1 m above its upper side."""
    slides = heavy(ToolJoint("slider", (0, 0, 1), -0.04, max(reach, 0.01)))
    post, block = slides.components
    plate = Component(
        "plate", "post", Pose.xyz_rpy((0.06, 0, 0.171)), Box((0.1, 0.2, 0.002)), 0.05
    )
    at = block.pose.position - [0, 0, 0.03]
    lower = replace(block, pose=Pose(at))
    tool = replace(slides, components=(post, plate, lower))
    try:
        check_joints(tool, PANDA, PAPER)
        fault = ""
    except DesignError as error:
        fault = str(error)

    assert ("goes through" in fault) == refused, fault


@pytest.mark.parametrize(
    ("degrees", "upper", "refused"),
    [
        (45, 0.05, False),
        (45, 0.3, False),
        (45, 0.9, True),
        (45, 2.4, True),
        (90, 1.1, False),
        (90, 1.7, True),
        (135, 1.8, False),
        (135, 2.5, True),
        (-90, 1.5, False),
        (180, 3.2, True),
    ],
)
def test_what_swings_stays_clear_of_a_plate_that_begins_at_its_pin(
    degrees, upper, refused
):
    """The plate stands so many degrees beside the paddle, and both touch the post at the pin."""
    size = Box((0.02, 0.02, 0.2))
    upright = Component("post", "tool_mount", Pose.xyz_rpy((0, 0, -0.1)), size, 0.1)
    turn = math.radians(degrees)
    middle = (0.1 * math.sin(turn), -0.1 * math.cos(turn), 0)
    plate = Component(
        "plate",
        "post",
        Pose.xyz_rpy(middle, (0, 0, turn - math.pi / 2)),
        Box((0.2, 0.02, 0.1)),
        0.1,
    )
    swings = ToolJoint("hinge", (0, 0, 1), -0.05, upper, origin=(0, 0.085, 0))
    pose = Pose.xyz_rpy((0, -0.085, 0))
    size = Box((0.01, 0.16, 0.03))
    paddle = Component("paddle", "post", pose, size, 0.03, joint=swings)
    tool = Tool((upright, plate, paddle))
    if not refused:
        check_joints(tool, PANDA, PAPER)
        return

    with pytest.raises(DesignError, match="'paddle' goes through 'plate'"):
        check_joints(tool, PANDA, PAPER)


@pytest.mark.parametrize(
    ("placed", "fault"),
    [
        ({"origin": (0, 0, 0.3)}, "passes 'block' at 200 mm"),
        (
            {"origin": (0.03, 0, 0), "axis": (0, 1, 0)},
            "passes 'tool_mount' at 65 mm; at most 10 mm",
        ),
    ],
)
def test_the_axis_of_a_hinge_is_a_pin_through_both_of_its_sides(placed, fault):
    """Else what moves would be held by nothing, however it touches what bears it (LeverStone paid 1.00 for it)."""
    with pytest.raises(DesignError, match=f"'block' has an axis that {fault}"):
        check_tool(heavy(hinge(lower=-0.01, upper=0.01, **placed)), PANDA)


def test_the_stiffness_that_is_proposed_is_taken():
    with pytest.raises(DesignError) as refused:
        check_tool(hinged(0.2, hinge(stiffness=1000, lower=-0.1, upper=0.1)), PANDA)
    proposed = float(str(refused.value).split("a stiffness of ")[1].split()[0])
    check_tool(
        hinged(0.2, hinge(stiffness=0.95 * proposed, lower=-0.1, upper=0.1)), PANDA
    )


def test_a_joint_moves_something():
    post, rod = hinged(0.2, hinge()).components
    with pytest.raises(DesignError, match=r"'rod' moves 0.0005 kg; at least 0.001 kg"):
        check_tool(Tool((post, replace(rod, mass=0.0005))), PANDA)


def test_number_of_joints():
    components, parent = [*hinged(0.2, hinge()).components[:1]], "post"
    for i in range(9):
        at = Pose.xyz_rpy((0.0, 0.0, -0.06 if i == 0 else -0.02))
        components.append(
            Component(
                f"c{i}",
                parent,
                at,
                Box((0.02, 0.02, 0.02)),
                0.01,
                joint=hinge(lower=-0.05, upper=0.05, origin=(0, 0, 0.01)),
            )
        )
        parent = f"c{i}"
    check_tool(Tool(tuple(components[:9])), PANDA)
    with pytest.raises(DesignError, match="9 moving joints; at most 8"):
        check_tool(Tool(tuple(components)), PANDA)


def inertia_of(tool):
    return 1 / measure_lightness(tool)[0]


def test_what_a_joint_moves():
    """A rod about its end, with another behind it; a block along its slide."""
    tool = hinged(0.5, ToolJoint("hinge", (1, 0, 0), -1, 1, (0, 0, 0.1)))
    own = 0.1 * (0.2**2 + 0.01**2) / 12 + 0.1 * 0.1**2
    assert inertia_of(tool) == pytest.approx(own)
    more = Component(
        "tip", "rod", Pose.xyz_rpy((0.0, 0.0, -0.11)), Box((0.02, 0.02, 0.02)), 0.05
    )
    both = own + 0.05 * (0.02**2 / 6 + 0.21**2)
    assert inertia_of(Tool((*tool.components, more))) == pytest.approx(both)
    block = sliding(ToolJoint("slider", (0, 0, 1), -0.1, 0.1))
    assert inertia_of(block) == pytest.approx(0.2)


def on_carriage(mass, **resisting):
    """A hammer of 65 g on a slider, borne by a carriage of this mass on another slider."""
    post = Component("post", "tool_mount", Pose.xyz_rpy((0, 0, -0.1)), SMALL, 0.05)
    slide = ToolJoint("slider", (1, 0, 0), -0.005, 0.005)
    carriage = Component("carriage", "post", Pose(), SMALL, mass, joint=slide)
    sprung = replace(slide, **resisting)
    hammer = Component("hammer", "carriage", Pose(), SMALL, 0.065, joint=sprung)
    return Tool((post, carriage, hammer))


SMALL = Box((0.02, 0.02, 0.2))


@pytest.mark.parametrize(
    ("resisting", "fault"),
    [
        ({"stiffness": 40.0}, "swing at 32 Hz, and at most 20 .* of 16 would do"),
        ({"damping": 1.0}, "an inertia of 0.00098; at most 0.098"),
    ],
)
def test_what_bears_a_spring_or_damper_gives_way_too(resisting, fault):
    """Both sides count: between 65 g and 1 g, PyBullet made 100 m/s of half a millijoule."""
    tool = on_carriage(0.001, **resisting)
    with pytest.raises(DesignError, match=f"component 'hammer' has too .*{fault}"):
        check_joints(tool, PANDA, PAPER)
    heavier = on_carriage(0.065, **resisting)
    check_joints(heavier, PANDA, PAPER)


def test_what_bears_a_spring_gives_way_where_it_is_lightest():
    """The hinge of the arm passes the middle of what the slider moves, and no longer at the end of its range."""
    post = Component("post", "tool_mount", Pose.xyz_rpy((0, 0, -0.1)), SMALL, 0.05)
    turns = ToolJoint("hinge", (1, 0, 0), -0.1, 0.1)
    arm = Component("arm", "post", Pose(), SMALL, 0.01, joint=turns)
    slides = ToolJoint("slider", (0, 1, 0), 0.0, 0.1)
    block = Component("block", "arm", Pose(), SMALL, 0.1, joint=slides)
    assert inertia_of(Tool((post, arm, block))) == pytest.approx(0.11 * 0.0101 / 3)


def test_springs_make_nothing_faster_than_engines_can_follow():
    """A paddle of 21 g on 1.9 J was 24 m/s fast: it struck through a wall and back within a look (DislodgeCube)."""
    tool = sprung_paddle(0.021)
    assert bound_speeds(tool) == pytest.approx(23.5, abs=0.1)
    fault = "springs could make 'paddle' 23.5 m/s fast; at most 13 m/s"
    with pytest.raises(DesignError, match=fault):
        check_joints(tool, PANDA, PAPER)
    heavier = sprung_paddle(0.15)
    check_joints(heavier, PANDA, PAPER)


def sprung_paddle(mass):
    post = Component("post", "tool_mount", Pose.xyz_rpy((0, 0, -0.1)), SMALL, 0.05)
    spring = ToolJoint(
        "hinge", (1, 0, 0), 0.0, 2.0, (0, 0, 0.1), stiffness=0.62, rest=2.5
    )
    return Tool((post, Component("paddle", "post", Pose(), SMALL, mass, joint=spring)))


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
        np.testing.assert_allclose(
            (link @ pose).matrix, tool.placed()[component.name][1].matrix, atol=1e-12
        )
