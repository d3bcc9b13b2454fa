import math
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from core.design import Component, Tool, ToolJoint
from core.designs.rules import check_tool
from core.designs.springs import bound_speeds, measure_lightness
from core.designs.start import SpawnRules
from core.geometry import Box, Pose
from core.values.materials import PAPER, Material
from plugins.conformance.joints import hinged, sliding
from plugins.tools.joint_rules import check_joints
from tests.support.panda import PANDA, on_panda
from tests.support.refusing import refused
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


def test_a_spring_is_no_stronger_than_what_is_printed_bears():
    sprung = hinge(stiffness=0.6, lower=-0.1, upper=0.1, rest=1)
    check_joints(heavy(sprung), PANDA, PAPER)
    with refused("E_SPRING_STRONG", load=0.66, load_unit="N m", most=0.45067):
        check_joints(heavy(sprung), PANDA, PLA)


def test_all_springs_of_a_tool_share_an_energy():
    one = heavy(hinge(stiffness=1.4, lower=-0.1, upper=0.1, rest=1.4))
    check_joints(one, PANDA, PAPER)
    again = replace(
        one.components[1], name="other", pose=Pose.xyz_rpy((-0.05, 0.0, 0.0))
    )
    with refused("E_SPRINGS_ENERGY", energy_j=3.15, component="block"):
        check_joints(Tool((*one.components, again)), PANDA, PAPER)


@pytest.mark.parametrize(
    ("reach", "is_refused"),
    [(0.0, False), (0.09, False), (0.099, False), (0.103, True), (0.2, True)],
)
def test_what_swings_stays_clear_of_the_plate_that_shields_it(reach, is_refused):
    """The block of 0.2 m slides up the post, and a plate on the post is 0.1 m above its upper side."""
    slides = heavy(ToolJoint("slider", (0, 0, 1), -0.04, max(reach, 0.01)))
    post, block = slides.components
    plate = Component(
        "plate", "post", Pose.xyz_rpy((0.06, 0, 0.171)), Box((0.1, 0.2, 0.002)), 0.05
    )
    at = block.pose.position - [0, 0, 0.03]
    lower = replace(block, pose=Pose(at))
    tool = replace(slides, components=(post, plate, lower))
    check_passage(tool, is_refused, component="block", other="plate")


@pytest.mark.parametrize(
    ("degrees", "upper", "is_refused"),
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
    degrees, upper, is_refused
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
    check_passage(tool, is_refused, component="paddle", other="plate")


def check_passage(tool, is_refused, **values):
    """Check that what moves is refused for going through another part, or passes every rule of joints."""
    with refused("E_JOINT_THROUGH", **values) if is_refused else nullcontext():
        check_joints(tool, PANDA, PAPER)


def test_the_stiffness_that_is_proposed_is_taken():
    with refused("E_SPRING_STIFF", component="rod") as caught:
        check_tool(hinged(0.2, hinge(stiffness=1000, lower=-0.1, upper=0.1)), PANDA)
    (refusal,) = caught.value.refusals
    proposed = refusal.values["would_do"]
    check_tool(
        hinged(0.2, hinge(stiffness=0.95 * proposed, lower=-0.1, upper=0.1)), PANDA
    )


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
    ("resisting", "code", "values"),
    [
        ({"stiffness": 40.0}, "E_SPRING_STIFF", {"rate_hz": 32.08, "would_do": 15.55}),
        ({"damping": 1.0}, "E_DAMPING_FAST", {"inertia": 0.00098485, "most": 0.098485}),
    ],
)
def test_what_bears_a_spring_or_damper_gives_way_too(resisting, code, values):
    """Both sides count: between 65 g and 1 g, PyBullet made 100 m/s of half a millijoule."""
    tool = on_carriage(0.001, **resisting)
    with refused(code, component="hammer", **values):
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
    with refused("E_SPRINGS_SPEED", component="paddle", speed_m_s=23.53, most_m_s=13):
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
