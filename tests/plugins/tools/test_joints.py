"""Joints of a tool in every representation that writes them."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.design import DesignError, ToolJoint
from core.plugins import installed
from plugins.conformance.joints import hinge, hinged, sliding
from tests.support.drawn_tools import instructions_of
from tests.support.tongs import tongs

NUMBERS = ("lower", "upper", "damping", "friction", "stiffness", "rest")
SPRUNG = ToolJoint(
    "hinge", (0.6, 0.0, 0.8), -1.0, 2.0, (0.01, 0.02, 0.1), 0.01, 0.02, 0.1, 0.3
)
TOOLS = {
    "tongs": tongs(),
    "rod": hinged(0.4, hinge(stiffness=0.1, damping=0.01, friction=0.02, rest=0.2)),
    "askew": hinged(0.4, SPRUNG),
    "block": sliding(ToolJoint("slider", (0, 0.6, 0.8), -0.05, 0.05, damping=2.0)),
}


def made(name, **settings):
    return installed().create("tool", name, settings)


@pytest.fixture(params=["urdf", "boxes", "solids"])
def representation(request):
    return made(request.param, joints=True)


def is_the_same(one, other):
    assert [c.name for c in one.components] == [c.name for c in other.components]
    for a, b in zip(one.components, other.components, strict=True):
        np.testing.assert_allclose(
            one.placed()[a.name][1].matrix, other.placed()[b.name][1].matrix, atol=2e-5
        )
        assert (a.joint is None) == (b.joint is None)
        if a.joint is not None:
            assert a.joint.kind == b.joint.kind
            np.testing.assert_allclose(a.joint.axis, b.joint.axis, atol=2e-5)
            if a.joint.kind == "hinge":
                np.testing.assert_allclose(a.joint.origin, b.joint.origin, atol=2e-5)
            for name in NUMBERS:
                assert getattr(a.joint, name) == pytest.approx(
                    getattr(b.joint, name), rel=1e-5
                )


@pytest.mark.parametrize("tool", TOOLS.values(), ids=TOOLS)
def test_what_is_written_is_read_again(representation, tool):
    data = json.loads(json.dumps(representation.dump(tool)))
    is_the_same(tool, representation.parse(data, gripper=False))


@given(
    axis=st.tuples(*[st.floats(-1, 1)] * 3).filter(
        lambda axis: np.linalg.norm(axis) > 0.1
    ),
    at=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    ends=st.tuples(st.floats(-3, 0), st.floats(0.01, 3)),
)
@pytest.mark.parametrize("name", ["urdf", "boxes"])
def test_any_hinge(name, axis, at, ends):
    tool = hinged(0.3, ToolJoint("hinge", axis, *ends, at))
    own = made(name, joints=True)
    is_the_same(tool, own.parse(own.dump(tool), gripper=False))


@pytest.mark.parametrize("name", ["urdf", "boxes", "solids"])
def test_joints_are_refused_unless_they_are_allowed(name):
    data = made(name, joints=True).dump(tongs())
    with pytest.raises(DesignError, match=r"tools are rigid|no key 'joint'"):
        made(name).parse(data, gripper=False)


@pytest.mark.parametrize("name", ["urdf", "boxes", "solids"])
def test_a_model_is_told_of_joints_only_where_they_are_allowed(name):
    told, silent = (
        instructions_of(made(name, **settings)) for settings in ({"joints": True}, {})
    )
    assert "spring" in told
    assert "20 Hz" in told
    assert "spring" not in silent


@pytest.mark.parametrize(
    ("joint", "fault"),
    [
        ("hinge", "joint: must be an object"),
        ({}, "joint.kind: is missing"),
        (
            {"kind": "ball", "axis": [0, 0, 1]},
            "joint.kind: must be 'hinge' or 'slider', got 'ball'",
        ),
        ({"kind": "hinge"}, "joint.axis: is missing"),
        (
            {"kind": "hinge", "axis": [0, 0, 0], "lower": -1, "upper": 1},
            "axis needs a length",
        ),
        ({"kind": "hinge", "axis": [0, 0, 1], "lower": 1, "upper": 2}, "must hold 0"),
        (
            {"kind": "hinge", "axis": [0, 0, 1], "upper": 1, "damping": -1},
            "damping must be 0 or more",
        ),
        (
            {"kind": "hinge", "axis": [0, 0, 1], "upper": float("nan")},
            "joint.upper: must be a finite number",
        ),
        (
            {"kind": "hinge", "axis": [0, 0, 1], "upper": 1, "stifness": 1},
            "no key 'stifness' .did you mean 'stiffness'",
        ),
        (
            {"kind": "hinge", "axis": [0, 0, 1], "upper": 1, "at": [0, 0]},
            "joint.at.2: is missing",
        ),
    ],
)
def test_joints_that_make_no_sense(joint, fault):
    own = made("boxes", joints=True)
    data = own.dump(hinged(0.2, hinge()))
    data["tool_components"][1]["joint"] = joint
    with pytest.raises(DesignError, match=f"component 'rod'.*{fault}"):
        own.parse(data, gripper=False)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (('type="revolute"', 'type="continuous"'), "is of type 'continuous'; use type"),
        (('lower="-3"', 'low="-3"'), "needs <limit lower"),
        (('lower="-3"', 'lower="many"'), "lower is 'many'; expected a number"),
        (('lower="-3"', 'lower="1"'), "must hold 0"),
        (('axis xyz="1 0 0"', 'axis xyz="0 0 0"'), "its axis has length 0"),
        (('friction="0"', 'friction="-1"'), "friction must be 0 or more"),
    ],
)
def test_urdf_joints_that_make_no_sense(change, fault):
    own = made("urdf", joints=True)
    text = own.dump(hinged(0.2, hinge()))["tool_urdf"]
    assert change[0] in text
    with pytest.raises(DesignError, match=f"joint 'rod_joint'.*{fault}"):
        own.parse({"tool_urdf": text.replace(*change)}, gripper=False)


def test_a_frame_can_not_move():
    own = made("urdf", joints=True)
    text = own.dump(hinged(0.2, hinge()))["tool_urdf"]
    begin = text.index('<link name="rod">')
    end = text.index('<joint name="rod_joint"')
    with pytest.raises(
        DesignError, match="link 'rod' hangs on a joint that moves, and has no box"
    ):
        own.parse(
            {"tool_urdf": text[:begin] + '<link name="rod"/>' + text[end:]},
            gripper=False,
        )
