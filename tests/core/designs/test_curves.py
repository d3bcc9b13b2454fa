"""Curves: one or two numbers of a design, varied over ranges."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import Candidate, Component, DesignError, Tool
from core.designs.curves import Axis, curve_schema, read_curve, vary
from core.geometry import Box, Pose

ROD = Component(
    "rod", "tool_mount", Pose.xyz_rpy((0.0, 0.0, -0.1)), Box((0.02, 0.02, 0.2))
)
PLAN = np.array([[0.5, 0, 0.4, 0, 0, 0], [0.6, 0, 0.4, 0, 0, 0.5]])
BASE = Candidate(Tool((ROD,)), PLAN, 1, 2, 3, 0)


def poses(*axes, count=3):
    return [made.plan.poses for made in vary(BASE, axes, count)]


def test_one_axis_adds_to_all_waypoints_or_to_those_named():
    found = poses(Axis("yaw", -0.1, 0.3))
    assert [pose[:, 5].tolist() for pose in found] == [
        pytest.approx([added, 0.5 + added]) for added in (-0.1, 0.1, 0.3)
    ]
    one = poses(Axis("x", 0.0, 0.2, waypoints=(2,)))
    assert [pose[:, 0].tolist() for pose in one] == [
        pytest.approx([0.5, 0.6 + added]) for added in (0.0, 0.1, 0.2)
    ]
    assert PLAN[1, 0] == 0.6  # the base stays


def test_a_component_is_moved_turned_or_resized_on_its_parent():
    def parts(*axes):
        return [made.tool.components[0] for made in vary(BASE, axes, 2)]

    sizes = [part.shape.size[2] for part in parts(Axis("size_z", 0, 0.1, "rod"))]
    assert sizes == pytest.approx([0.2, 0.3])
    turns = [part.pose.rpy[2] for part in parts(Axis("yaw", 0, 0.384, "rod"))]
    assert turns == pytest.approx([0, 0.384])
    heights = [part.pose.position[2] for part in parts(Axis("z", 0, 0.05, "rod"))]
    assert heights == pytest.approx([-0.1, -0.05])


@pytest.mark.parametrize(("count", "made"), [(1, 4), (4, 4), (20, 20), (24, 20)])
def test_two_axes_make_a_grid_of_about_as_many(count, made):
    axes = (Axis("yaw", -1, 1), Axis("size_x", 0, 0.1, "rod"))
    found = list(vary(BASE, axes, count))
    assert len(found) == made
    added = {candidate.varied.added for candidate in found}
    assert len(added) == made
    assert {(-1, 0), (1, 0.1)} <= added
    assert found[0].varied.names == ("waypoints all yaw", "rod size_x")
    assert {candidate.varied.base for candidate in found} == {BASE.id}


def test_the_designs_of_a_curve_are_one_idea():
    (made, *_) = vary(BASE, (Axis("yaw", 0, 1),), 2)
    moved = replace(made, design=17)
    assert moved.idea == BASE.idea == replace(BASE, action=1).idea
    assert replace(BASE, design=17).idea != BASE.idea


@pytest.mark.parametrize(
    ("axis", "said"),
    [
        (Axis("x", 0, 1, "rad"), "the tool's components are rod"),
        (Axis("x", 0, 1, waypoints=(3,)), "the plan has waypoints 1 to 2"),
        (Axis("x", 0, 1, waypoints=(0,)), "the plan has waypoints 1 to 2"),
        (Axis("size_x", 0, 1), "of waypoints it adds to x, y"),
        (Axis("size_x", -0.02, 0, "rod"), "no side is left"),
    ],
)
def test_a_number_that_a_design_has_not_is_refused(axis, said):
    with pytest.raises(DesignError, match=said):
        list(vary(BASE, (axis,), 3))


def test_a_curve_is_read_as_its_schema_has_it():
    written = {"add_to": "yaw", "low": -1, "high": 1, "component": "", "waypoints": [2]}
    required = curve_schema()["items"]["required"]
    assert sorted(required) == sorted(written)
    assert read_curve({"curve": [written]}) == [Axis("yaw", -1, 1, waypoints=(2,))]
    assert read_curve({"curve": []}) == read_curve({}) == read_curve("text") == []


@pytest.mark.parametrize(
    "written",
    [
        [{"add_to": "speed", "low": 0, "high": 1}],
        [{"add_to": "yaw", "low": 0, "high": float("nan")}],
        [{"add_to": "yaw", "low": 0, "high": 11}],
        [{"add_to": "yaw"}],
        "yaw",
        [{"add_to": "yaw", "low": 0, "high": 1}] * 3,
    ],
)
def test_another_curve_is_refused(written):
    with pytest.raises(DesignError, match="curve"):
        read_curve({"curve": written})
