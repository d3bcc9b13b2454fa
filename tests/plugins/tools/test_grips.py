"""Components that grip: written, read, told of only where they are wanted, and refused."""

import json
from dataclasses import replace

import pytest

from core.design import Component, DesignError, Fixture, Tool, ToolJoint
from core.designs.reading import dump_design, read_designs
from core.geometry import Box, Cylinder, Pose
from core.plugins import installed
from core.values.grips import GRIPS
from core.values.materials import PAPER
from plugins.tools.grip_rules import check_grips
from tests.support.drawn_tools import instructions_of
from tests.support.panda import PANDA, on_panda
from tests.support.scenes import CubeOnTable

GRIP = {"kind": "suction", "face": "bottom", "area_mm2": 300}
STEM = {"name": "stem", "size": [0.03, 0.03, 0.1], "position": [0, 0, -0.05]}
SEVEN = [[0.5, 0, 0.4, 0, 0, 0, 0], [0.5, 0, 0.35, 0, 0, 0, 1]]


def made(name="boxes", **settings):
    return installed().create("tool", name, settings)


def stem(shape=None, joint=None, grip=None):
    pose = Pose.xyz_rpy((0, 0, -0.05))
    grip = grip or GRIPS["suction"]("bottom", 300)
    shape = shape or Box((0.03, 0.03, 0.1))
    return Component("stem", "tool_mount", pose, shape, 0.05, joint=joint, grips=grip)


def read(representation, plan=SEVEN, **changes):
    design = {
        "gripper": False,
        "tool_components": [STEM | changes],
        "action_sets": [plan],
    }
    (found,) = read_designs(
        {"strategies": [design]}, representation, on_panda(CubeOnTable())
    )
    return found


@pytest.mark.parametrize("name", ["boxes", "solids"])
@pytest.mark.parametrize("kind", GRIPS)
def test_what_is_written_is_read_again(name, kind):
    representation = made(name, grips=True)
    tool = Tool((stem(grip=GRIPS[kind]("left", 250.5)),))
    data = json.loads(json.dumps(representation.dump(tool)))
    (component,) = representation.parse(data, gripper=False).components
    assert component.grips == GRIPS[kind]("left", 250.5)


def test_a_design_with_a_grip_is_read_with_the_switch_in_its_plan():
    found = read(made(grips=True), grips=GRIP)
    assert found.problem is None
    assert found.tool.components[0].grips == GRIPS["suction"]("bottom", 300)
    assert found.plan.grips.tolist() == [0, 1]
    design = dump_design(found, made(grips=True))
    (again,) = read_designs(
        {"strategies": [design]}, made(grips=True), on_panda(CubeOnTable())
    )
    assert again.content == found.content


def test_poses_alone_leave_suction_off():
    found = read(made(grips=True), [row[:6] for row in SEVEN], grips=GRIP)
    assert found.problem is None
    assert not found.plan.closes


def test_without_the_setting_there_are_no_grips():
    assert "waypoint" in read(made()).problem
    plain = made()
    assert "grips" not in json.dumps(plain.schema())
    assert "suction" not in instructions_of(plain)
    assert "grips" not in plain.dump(Tool((stem(),)))["tool_components"][0]

    gripping = made(grips=True)
    assert "grips" in json.dumps(gripping.schema())
    text = instructions_of(gripping)
    assert all(f'"{kind}"' in text for kind in GRIPS)


def test_grips_that_differ_are_different_tools():
    first = Tool((stem(),))
    other = Tool((stem(grip=GRIPS["magnet"]("bottom", 300)),))
    assert first.content != other.content


HINGE = ToolJoint("hinge", (0, 1, 0), -0.1, 0.1)
ROUND = stem(Cylinder(0.015, 0.1), grip=GRIPS["magnet"]("front", 300))
PAD = replace(stem(), parent="left_finger")
MANY = [replace(stem(), name=f"stem_{number}") for number in range(17)]
FIXTURE = Fixture(Tool((stem(),)), Pose())
REFUSED = {
    "E_GRIP_FLAT": Tool((ROUND,)),
    "E_GRIP_AREA": Tool((stem(grip=GRIPS["magnet"]("bottom", 710)),)),
    "E_GRIP_MOVES": Tool((stem(joint=HINGE),)),
    "E_GRIP_COUNT": Tool(tuple(MANY)),
    "E_GRIP_OF_FINGERS": Tool((PAD,), gripper=True),
    "E_GRIP_OF_FIXTURE": Tool((replace(stem(), grips=None),), fixture=FIXTURE),
}


@pytest.mark.parametrize("code", REFUSED)
def test_a_grip_that_can_not_be_made_is_refused(code):
    with pytest.raises(DesignError) as caught:
        check_grips(REFUSED[code], PANDA, PAPER)
    assert code in [refusal.code for refusal in caught.value.refusals]


@pytest.mark.parametrize(
    "tool",
    [
        Tool((stem(grip=GRIPS["magnet"]("bottom", 700)),)),
        Tool((stem(Cylinder(0.015, 0.1)),)),
        Tool(tuple(MANY[:16])),
    ],
)
def test_a_grip_that_can_be_made_is_not(tool):
    check_grips(tool, PANDA, PAPER)
