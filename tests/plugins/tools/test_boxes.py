import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, DesignError, Tool
from core.designs.rules import check_tool
from core.geometry import Box, Capsule, Cylinder, Mesh, Pose, Sphere
from plugins.tools.boxes import BoxTools
from tests.support.panda import PANDA, on_panda
from tests.support.refusing import refused
from tests.support.shapes import SAMPLES

TOOLS = on_panda(BoxTools())

lengths = st.floats(0.0005, 2.0)
numbers = st.floats(-1.5, 1.5)
near = st.builds(
    lambda k, d: k * math.pi / 4 + d,
    st.integers(-8, 8),
    st.just(0.0) | st.floats(-3e-5, 3e-5),
)
angles = st.floats(-7, 7) | near
shapes = st.one_of(
    st.builds(Box, st.tuples(lengths, lengths, lengths)),
    st.builds(Cylinder, lengths, lengths),
    st.builds(Capsule, lengths, lengths),
    st.builds(Sphere, lengths),
    st.sampled_from(SAMPLES),
)
poses = st.builds(
    Pose.xyz_rpy,
    st.tuples(numbers, numbers, numbers),
    st.tuples(angles, angles, angles),
)


@st.composite
def tools(draw):
    gripper = draw(st.booleans())
    names = list(GRIPPER_MOUNTS if gripper else [RIGID_MOUNT])
    components = []
    for k in range(draw(st.integers(0, 6))):
        color = (*(draw(st.floats(0, 1)) for _ in "rgb"), 1.0)
        parent = draw(st.sampled_from(names))
        mass = draw(st.floats(1e-6, 1.0))
        components.append(
            Component(f"c{k}", parent, draw(poses), draw(shapes), mass, color)
        )
        names.append(f"c{k}")
    return Tool(tuple(components), gripper)


def box(name="a", **changes):
    return {
        "name": name,
        "shape": "box",
        "size": [0.02, 0.02, 0.1],
        "position": [0, 0, -0.05],
    } | changes


def parse(*items, gripper=False):
    return TOOLS.parse({"tool_components": list(items)}, gripper=gripper)


def test_a_box_needs_only_name_size_and_position():
    (component,) = parse(
        {"name": "a", "size": [0.02, 0.02, 0.1], "position": [0, 0, -0.05]}
    ).components
    wanted = Component(
        "a", RIGID_MOUNT, Pose.xyz_rpy((0, 0, -0.05)), Box((0.02, 0.02, 0.1))
    )
    assert component == wanted
    check_tool(parse(box()), PANDA)


@pytest.mark.parametrize(
    ("item", "shape"),
    [
        ({"shape": "cylinder", "radius": 0.01, "length": 0.2}, Cylinder(0.01, 0.2)),
        ({"shape": "capsule", "radius": 0.01, "length": 0.2}, Capsule(0.01, 0.2)),
        ({"shape": "sphere", "radius": 0.01}, Sphere(0.01)),
    ],
)
def test_round_shapes(item, shape):
    (component,) = parse(
        {"name": "a", "position": [0, 0, 0], "color": "#ff0080", **item}
    ).components
    assert component.shape == shape
    assert component.color == (1.0, 0.0, 128 / 255, 1.0)


def test_poses_are_in_the_frame_of_the_mount_whatever_the_parent():
    turned = {"position": [0.1, 0.02, -0.3], "rpy": [0.3, -0.4, 0.5]}
    tool = parse(
        box("c", parent="b", **turned), box("b", parent="a", rpy=[1, 0.2, 3]), box("a")
    )
    assert [c.name for c in tool.components] == ["a", "b", "c"]  # parents first
    mount, pose = tool.placed()["c"]
    assert mount == RIGID_MOUNT
    np.testing.assert_allclose(
        pose.matrix,
        Pose.xyz_rpy((0.1, 0.02, -0.3), (0.3, -0.4, 0.5)).matrix,
        atol=1e-12,
    )


def test_attachments_name_their_finger():
    tool = parse(
        box("l", parent="left_finger"),
        box("m", parent="panda_rightfinger"),
        gripper=True,
    )
    assert [c.parent for c in tool.components] == list(GRIPPER_MOUNTS)


def test_a_mass_that_is_left_out_is_one_that_can_be():
    assert parse(box()).components[0].mass == 0.005
    # As light as air.
    assert parse(box(size=[0.3, 0.3, 0.3])).components[0].mass == pytest.approx(0.027)


@given(tools())
def test_what_is_written_is_read_as_the_same_tool(tool):
    written = TOOLS.dump(tool)
    json.dumps(written, allow_nan=False)
    back = TOOLS.parse(written, gripper=tool.gripper)
    for a, b in zip(tool.components, back.components, strict=True):
        (mount, pose), (other, moved) = tool.placed()[a.name], back.placed()[b.name]
        assert (a.name, a.parent, mount, type(a.shape)) == (
            b.name,
            b.parent,
            other,
            type(b.shape),
        )
        np.testing.assert_allclose(pose.matrix, moved.matrix, atol=5e-5)
        np.testing.assert_allclose(a.shape.bounds[1], b.shape.bounds[1], atol=3e-5)
        assert a.mass == pytest.approx(b.mass, rel=1e-5)
    assert TOOLS.dump(back) == written


def test_an_elite_is_shown_without_what_goes_without_saying():
    tool = parse(
        box(color="#123456", position=[0, 0, -0.05004]),
        box("b", parent="a", rpy=[0, 0, 1], mass=0.02),
    )
    first, second = TOOLS.abridge(tool)["tool_components"]
    common = {"size": [0.02, 0.02, 0.1], "mass": 0.005}
    assert first == {
        "name": "a",
        "parent": RIGID_MOUNT,
        "position": [0, 0, -0.05],
        **common,
    }
    assert second == {
        **common,
        "name": "b",
        "parent": "a",
        "position": [0, 0, -0.05],
        "rpy": [0, 0, 1],
        "mass": 0.02,
    }
    assert parse(first, second).components[1].shape == Box((0.02, 0.02, 0.1))


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"name": 7}, "E_NAME_MISSING"),
        ({"name": "a b"}, "E_NAME_LETTERS"),
        ({"name": "\ud800"}, "E_NAME_LETTERS"),
        ({"parent": 3}, "E_ENTRY_TEXT"),
        ({"shape": ["box"]}, "E_SHAPE"),
        ({"size": "1 1 1"}, "E_ENTRY_LIST"),
        ({"mass": "5 g"}, "E_ENTRY_NUMBER"),
        ({"color": "red"}, "E_ENTRY_VALUE"),
        ({"position": [0, 0, math.nan]}, "E_ENTRY_RANGE"),
    ],
)
def test_what_replies_mend_is_refused(changes, code):
    with refused(code):
        parse(box(**changes))


def test_a_mesh_can_not_be_written():
    mesh = Mesh.from_trimesh(Box((0.1, 0.1, 0.1)).to_trimesh())
    with pytest.raises(
        DesignError,
        match="'m' is a mesh, which tool=boxes can't write; use tool=solids",
    ):
        TOOLS.dump(Tool((Component("m", RIGID_MOUNT, Pose(), mesh),)))
