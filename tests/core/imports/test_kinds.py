"""What a file of others is, by what is in it."""

from xml.etree.ElementTree import fromstring

import pytest

from core.errors import UserError
from core.imports.kinds import (
    ARM,
    GRIPPER,
    SCENE,
    find_radians,
    tell_kind,
)
from tests.support.hands import hand
from tests.support.text import replaced_all


def urdf(count, kind="revolute", effort=' effort="10" velocity="1"'):
    """A chain of links with so many joints."""
    links = "".join(f'<link name="l{number}"/>' for number in range(count + 1))
    joints = "".join(
        f'<joint name="j{number}" type="{kind}"><parent link="l{number}"/><child link="l{number + 1}"/>'
        f'<axis xyz="0 0 1"/><limit lower="-1" upper="1"{effort}/></joint>'
        for number in range(count)
    )
    return f'<robot name="chain">{links}{joints}</robot>'


def mjcf(count, joint='<joint type="hinge"/>'):
    """Bodies that hang from each other, with a joint each."""
    inside = "<body>" + joint + '<geom size="0.1"/>'
    return (
        f"<mujoco><worldbody>{inside * count}{'</body>' * count}</worldbody></mujoco>"
    )


@pytest.mark.parametrize(
    ("name", "text", "kind"),
    [
        ("a.urdf", urdf(3), ARM),
        ("a.urdf", urdf(2), SCENE),
        ("a.urdf", urdf(3, "prismatic"), ARM),
        ("a.urdf", urdf(3, effort=""), SCENE),  # such as a lamp that nothing drives
        ("a.urdf", hand(), GRIPPER),
        ("a.urdf", hand(second="0 1 0"), SCENE),  # such as two drawers
        ("a.urdf", replaced_all(hand(effort=""), (' velocity="1"', "")), SCENE),
        ("a.xml", mjcf(3), ARM),
        ("a.xml", mjcf(2), SCENE),
        ("a.xml", mjcf(3, "<joint type='free'/>"), SCENE),
        ("a.xml", mjcf(3, "<freejoint/>"), SCENE),
        ("a.STL", "", SCENE),
    ],
)
def test_a_file_is_told_by_its_joints(tmp_path, name, text, kind):
    (tmp_path / name).write_text(text)
    assert tell_kind(tmp_path / name) == kind


def test_what_a_model_includes_counts(tmp_path):
    (tmp_path / "arm.xml").write_text(mjcf(3))
    (tmp_path / "scene.xml").write_text('<mujoco><include file="arm.xml"/></mujoco>')
    assert tell_kind(tmp_path / "scene.xml") == ARM


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.sdf", "<sdf version='1.9'/>", "pip install sdformat-mjcf, then: sdf2mjcf"),
        (
            "a.usda",
            "#usda 1.0",
            "pip install nvidia-srl-usd-to-urdf, then: usd_to_urdf",
        ),
        (
            "a.xacro",
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:a/></robot>',
            "then: xacrodoc",
        ),
        ("a.urdf", '<robot name="a"><link/></robot>', "a <link> has no name"),
    ],
)
def test_what_is_not_read_names_the_command(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    with pytest.raises(UserError, match=said):
        tell_kind(tmp_path / name)


@pytest.mark.parametrize(
    ("ranges", "compiler", "radians"),
    [
        ("-1.57 3.14", "", True),
        ("-90 90", "", False),
        ("0 6.2", "", True),
        ("0 6.4", "", False),
        ("-1.57 3.14", '<compiler angle="degree"/>', False),
        ("", "", False),
    ],
)
def test_ranges_that_look_like_radians(ranges, compiler, radians):
    joint = f'<joint range="{ranges}"/>' if ranges else "<joint/>"
    text = f"<mujoco>{compiler}<worldbody><body>{joint}</body></worldbody></mujoco>"
    assert find_radians(fromstring(text)) == radians
