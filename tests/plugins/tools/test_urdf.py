from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from core.design import DesignError
from core.designs.reading import dump_design, read_designs
from core.designs.rules import check_tool
from core.geometry import Box, Pose
from core.interfaces import Material
from core.plugins import installed
from core.robot import description as robot
from plugins.tools.urdf.building import DEFAULT_COLOR
from plugins.tools.urdf.representation import UrdfTools
from tasks.one_book import OneBook
from tests.support.drawn_tools import instructions_of, tools
from tests.support.panda import PANDA, on_panda

URDF = on_panda(UrdfTools())
BOX = '<geometry><box size="0.02 0.02 0.1"/></geometry>'


def link(name, inside=f"<collision>{BOX}</collision>"):
    return f'<link name="{name}">{inside}</link>'


def joint(parent, child, *, kind="fixed", origin='<origin xyz="0 0 -0.05"/>'):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{parent}-{child}" type="{kind}">{ends}{origin}</joint>'


def parse(text, *, gripper=False):
    return URDF.parse({"tool_urdf": text}, gripper=gripper)


def shape(tag, geometry=BOX, origin="", material=""):
    return f"<{tag}>{origin}{geometry}{material}</{tag}>"


HELD = joint("tool_mount", "a")
A = link("a") + HELD


def held(*inside):
    """A link with elements that the mount holds."""
    return link("a", "".join(inside)) + HELD


def geometry(inside):
    return shape("collision", f"<geometry>{inside}</geometry>")


def test_schema_names_the_field_that_parse_reads_and_dump_writes():
    assert set(URDF.schema()) == {"tool_urdf"} == set(URDF.dump(parse(A)))


@pytest.mark.parametrize(
    "wrap",
    [
        "{}",
        "<robot name='t'>{}</robot>",
        "<?xml version='1.0'?>\n<robot>{}</robot>",
        "<!-- x -->{}",
    ],
)
def test_a_root_and_a_declaration_may_be_there(wrap):
    (component,) = parse(wrap.format(A)).components
    assert (component.name, component.parent, component.mass) == (
        "a",
        "tool_mount",
        0.005,
    )
    assert component.shape == Box((0.02, 0.02, 0.1))
    np.testing.assert_allclose(component.pose.position, [0, 0, -0.05])


def test_a_missing_origin_is_zero():
    (component,) = parse(link("a") + joint("tool_mount", "a", origin="")).components
    assert component.pose == Pose()


def test_the_order_of_elements_does_not_matter():
    tool = parse(joint("a", "b") + link("b") + A)
    assert [component.name for component in tool.components] == ["a", "b"]


def test_attachments_hang_from_both_fingers():
    text = (
        link("l") + link("r") + joint("left_finger", "l") + joint("right_finger", "r")
    )
    tool = parse(text, gripper=True)
    assert tool.gripper
    assert [c.parent for c in tool.components] == ["left_finger", "right_finger"]


@pytest.mark.parametrize(
    ("alias", "mount"),
    [
        ("panda_virtual", "tool_mount"),
        ("panda_leftfinger", "left_finger"),
        ("panda_rightfinger", "right_finger"),
    ],
)
def test_a_robots_other_names_of_mounts_are_read(alias, mount):
    gripper = mount != "tool_mount"
    named, usual = (
        parse(link("a") + joint(parent, "a"), gripper=gripper)
        for parent in (alias, mount)
    )
    assert named == usual
    assert [c.parent for c in named.components] == [mount]
    ur5 = installed().create("tool", "urdf", robot=installed().create("robot", "ur5"))
    with pytest.raises(DesignError, match=f"no link '{alias}'"):
        ur5.parse({"tool_urdf": link("a") + joint(alias, "a")}, gripper=gripper)


def test_a_visual_alone_collides_too():
    (component,) = parse(held(shape("visual"))).components
    assert component.shape == Box((0.02, 0.02, 0.1))


def test_mass_is_shared_by_volume():
    low = '<origin xyz="0 0 -0.2"/>'
    tool = parse(
        held(
            geometry('<box size="0.1 0.1 0.1"/>'),
            shape("collision", '<geometry><box size="0.1 0.1 0.3"/></geometry>', low),
            '<inertial><mass value="0.08"/></inertial>',
        )
    )
    assert [c.mass for c in tool.components] == pytest.approx([0.02, 0.06])


@pytest.mark.parametrize(
    ("material", "color"),
    [
        ('<material name="m"><color rgba="1 0 0.5 0.5"/></material>', (1, 0, 0.5, 0.5)),
        ('<material name="green"/>', (0, 1, 0, 1)),
        ('<material name="nowhere"/>', DEFAULT_COLOR),
        (
            '<material name="m"><color rgba="255 0 0 0"/></material>',
            (1, 0, 0, 0.2),
        ),  # always visible
        ("", DEFAULT_COLOR),
    ],
)
def test_color(material, color):
    top = '<material name="green"><color rgba="0 1 0 1"/></material>'
    both = held(shape("visual", material=material), shape("collision"))
    (component,) = parse(top + both).components
    assert component.color == color


def test_boxes_of_a_link_and_its_children_keep_their_places():
    turned = '<origin xyz="0 0 -0.1" rpy="0.3 -0.2 0.9"/>'
    boxes = shape("collision", origin=turned) + shape(
        "collision", origin='<origin xyz="0.1 0 0"/>'
    )
    text = link("a", boxes) + joint(
        "tool_mount", "a", origin='<origin xyz="0.01 0.02 0.03" rpy="1 0.5 0.2"/>'
    )
    text += link("b") + joint("a", "b", origin='<origin xyz="0 0.2 0" rpy="0 0 1.5"/>')
    tool = parse(text)
    assert [c.name for c in tool.components] == ["a", "a_2", "b"]
    frame = Pose.xyz_rpy((0.01, 0.02, 0.03), (1, 0.5, 0.2))
    wanted = {
        "a": frame @ Pose.xyz_rpy((0, 0, -0.1), (0.3, -0.2, 0.9)),
        "a_2": frame @ Pose.xyz_rpy((0.1, 0, 0)),
        "b": frame @ Pose.xyz_rpy((0, 0.2, 0), (0, 0, 1.5)),
    }
    for name, (mount, pose) in tool.placed().items():
        assert mount == "tool_mount"
        np.testing.assert_allclose(pose.matrix, wanted[name].matrix, atol=1e-12)


def test_boxes_hang_from_the_box_that_they_touch():
    row = (
        shape("collision", origin=f'<origin xyz="0 0 {z}"/>') for z in (0, -0.1, -0.2)
    )
    tool = parse(
        held(*row) + link("b") + joint("a", "b", origin='<origin xyz="0 0 -0.3"/>')
    )
    assert [(c.name, c.parent) for c in tool.components] == [
        ("a", "tool_mount"),
        ("a_2", "a"),
        ("a_3", "a_2"),
        ("b", "a_3"),
    ]
    check_tool(tool, PANDA)


def test_further_boxes_do_not_take_the_name_of_another_link():
    tool = parse(held(shape("collision") * 2) + link("a_2") + joint("a", "a_2"))
    assert sorted(c.name for c in tool.components) == ["a", "a_2", "a_3"]


def test_a_link_without_boxes_is_composed_away():
    text = link("frame", "") + joint(
        "tool_mount",
        "frame",
        origin='<origin xyz="0 0 -0.1" rpy="0 1.5707963267948966 0"/>',
    )
    (component,) = parse(text + link("a") + joint("frame", "a")).components
    assert component.parent == "tool_mount"
    np.testing.assert_allclose(component.pose.position, [-0.05, 0, -0.1], atol=1e-12)


def test_collision_boxes_count_in_the_colours_of_as_many_visual_ones():
    red = '<material><color rgba="1 0 0 1"/></material>'
    high = '<origin xyz="0 0 0.1"/>'
    low = '<origin xyz="0 0 0"/>'
    visuals = shape("visual", origin=high, material=red) + shape("visual", origin=low)
    shapes = visuals + shape("collision", origin=high) + shape("collision", origin=low)
    tool = parse(held(shapes))
    assert [c.color for c in tool.components] == [(1, 0, 0, 1), DEFAULT_COLOR]
    (component,) = parse(held(visuals, shape("collision"))).components
    assert (component.pose.position.tolist(), component.color) == (
        [0, 0, -0.05],
        DEFAULT_COLOR,
    )


@settings(max_examples=60, deadline=None)
@given(tools())
def test_dump_and_parse_give_the_same_tool(tool):
    again = URDF.parse(URDF.dump(tool), gripper=tool.gripper)
    before = tool.placed()
    after = again.placed()
    for component, other in zip(tool.components, again.components, strict=True):
        assert (other.name, other.parent) == (component.name, component.parent)
        np.testing.assert_allclose(
            [other.mass, *other.color, *other.shape.size],
            [component.mass, *component.color, *component.shape.size],
            rtol=0,
            atol=1e-9,
        )
        mount, here = before[component.name]
        same_mount, there = after[component.name]
        assert same_mount == mount
        np.testing.assert_allclose(there.matrix, here.matrix, rtol=0, atol=1e-9)
    assert URDF.dump(again) == {"tool_urdf": robot.tool_urdf(again)}


def test_a_saved_tool_comes_back_to_the_last_bit():
    """Poses of a chain depend in their last bits on how the numbers were written."""
    odd = '<origin xyz="0.0123456789 0 -0.03" rpy="3.14159265359 0.123456789 -2.7"/>'
    links = A + link("b") + joint("a", "b", origin=odd)
    task = on_panda(OneBook())
    plan = [{"position": [0.5, 0, z], "rpy": [0, 0, 0]} for z in (0.5, 0.6)]
    (first,) = read_designs(
        {"strategies": [{"tool_urdf": links, "action_sets": [plan]}]}, URDF, task
    )
    saved = dump_design(first, URDF)
    assert saved["tool_urdf"] == links
    (again,) = read_designs({"strategies": [saved]}, URDF, task)
    assert again.tool.content == first.tool.content
    shorter = replace(first.tool, components=first.tool.components[:1])
    assert (
        'name="b"' not in dump_design(replace(first, tool=shorter), URDF)["tool_urdf"]
    )


def test_of_a_real_material_a_mass_is_neither_asked_for_nor_read():
    made_of_pla = on_panda(UrdfTools())
    made_of_pla.robot = PANDA
    made_of_pla.material = Material("pla", 1240)
    text = instructions_of(made_of_pla)
    assert "Tools are made of pla, 1240 kg/m^3, solid." in text
    assert "bend it by more than 10 mm or 10 N would break it." in text
    assert "mass value" not in text
    assert "A few grams per box" not in text
    heavy = '<inertial><mass value="as much as you like"/></inertial>'
    data = {"tool_urdf": held(shape("collision"), heavy)}
    assert len(made_of_pla.parse(data, gripper=False).components) == 1
    with pytest.raises(
        DesignError, match="value is 'as much as you like'; expected a number"
    ):
        URDF.parse(data, gripper=False)


def test_of_paper_the_instructions_are_as_ever():
    text = instructions_of(URDF)
    assert '- The inertial needs <mass value="..."/> in kilograms' in text
    assert (
        "more than 10 mm even if it were of steel, as it would a bar of 2 mm thickness and 0.25 m length."
        in text
    )
    assert '<inertial><mass value="0.005"/></inertial>' in text
