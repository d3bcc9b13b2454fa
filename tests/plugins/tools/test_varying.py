from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.design import RIGID_MOUNT, Component, DesignError, Tool, ToolJoint
from core.designs.reading import load_designs, read_designs
from core.designs.rules import check_tool
from core.geometry import Box, Capsule, Cylinder, Pose, Sphere
from core.interfaces import Numbers, Waypoints
from core.plugins import installed
from plugins.tools.varying import tool_change, tool_numbers, vary_tool
from tests.support.panda import PANDA

ROOT = Path(__file__).parents[2] / "tasks"
SHAPES = (
    Box((0.1, 0.04, 0.02)),
    Cylinder(0.02, 0.1),
    Capsule(0.02, 0.06),
    Sphere(0.03),
)


def solution(folder, name, tool):
    task = installed().create("task", name)
    return read_designs(
        load_designs(ROOT / folder / f"{name}.json"),
        installed().create("tool", tool),
        task,
    )[0]


def chain(shapes):
    """Shapes on the mount and one on the other, each where the last one ends."""
    parts = [
        Component(
            "part0",
            RIGID_MOUNT,
            Pose.xyz_rpy((0.0, 0.0, -shapes[0].bounds[1][2] / 2)),
            shapes[0],
            0.05,
        )
    ]
    for number, shape in enumerate(shapes[1:], start=1):
        down = -(shapes[number - 1].bounds[1][2] + shape.bounds[1][2]) / 2
        parts.append(
            Component(
                f"part{number}",
                f"part{number - 1}",
                Pose.xyz_rpy((0.0, 0.0, down)),
                shape,
                0.05,
            )
        )
    return Tool(tuple(parts))


@settings(max_examples=60, deadline=None)
@given(
    shapes=st.lists(st.sampled_from(SHAPES), min_size=1, max_size=4),
    seed=st.integers(0, 2**32 - 1),
)
def test_components_go_on_touching_and_keep_their_density(shapes, seed):
    tool = chain(shapes)
    numbers = tool_numbers(tool)
    drawn = np.random.default_rng(seed).uniform(-1, 1, len(numbers)).reshape(-1, 3, 3)
    if any(not isinstance(shape, Box) for shape in shapes):
        drawn[:, 1] = 0  # what is round may slide off an edge
        drawn[:, 2] = 0
    varied = vary_tool(tool, numbers.steps * drawn.ravel())
    for before, after in zip(tool.components, varied.components, strict=True):
        assert after.mass / after.shape.volume == pytest.approx(
            before.mass / before.shape.volume
        )
        assert after.shape != before.shape
    try:
        check_tool(varied, PANDA)
    except DesignError as error:
        assert "away from its" not in str(error)  # noqa: PT017


@pytest.mark.parametrize(
    ("folder", "tool"), [("solutions", "urdf"), ("anchored", "boxes")]
)
@pytest.mark.parametrize("name", ["BringCube", "LiftBox", "ScoreGoal"])
def test_no_change_is_the_same_design(folder, tool, name):
    candidate = solution(folder, name, tool)
    numbers = tool_numbers(candidate.tool)
    same = vary_tool(candidate.tool, numbers.values)
    for one, other in zip(candidate.tool.components, same.components, strict=True):
        assert other.shape == one.shape
        np.testing.assert_allclose(other.pose.matrix, one.pose.matrix, atol=1e-9)
    actions = installed().create("action", candidate.plan.action)
    values = actions.parameters(candidate.plan).values
    assert (
        actions.with_parameters(candidate.plan, values).dump() == candidate.plan.dump()
    )
    assert len(values) >= 6 * len(candidate.plan.dump())


def test_an_anchored_plans_tempo_varies():
    plan = solution("anchored", "BringCube", "boxes").plan
    actions = installed().create("action", "anchored")
    numbers = actions.parameters(plan)
    faster = actions.with_parameters(
        plan,
        numbers.values + np.log(2) * (np.arange(len(numbers)) >= 6 * len(plan.steps)),
    )
    speeds = [
        (before.speed, after.speed)
        for before, after in zip(plan.steps, faster.steps, strict=True)
    ]
    assert [after for _, after in speeds] == pytest.approx(
        [2 * before for before, _ in speeds]
    )
    assert (numbers.lower <= numbers.values).all()
    assert (numbers.values <= numbers.upper).all()


def test_tools_with_joints_and_plans_of_another_representation_have_no_numbers():
    part = Component("part", RIGID_MOUNT, Pose(), Box((0.1, 0.1, 0.1)))
    hinged = replace(
        part, name="flap", parent="part", joint=ToolJoint("hinge", (1, 0, 0), -1, 1)
    )
    assert len(tool_numbers(Tool((part, hinged)))) == 0
    plan = solution("anchored", "BringCube", "boxes").plan
    assert len(installed().create("action", "waypoints").parameters(plan)) == 0
    assert len(Numbers() + Numbers()) == 0


ACTIONS = installed().create("action", "waypoints")


@settings(max_examples=40, deadline=None)
@given(
    shapes=st.lists(st.sampled_from(SHAPES), min_size=1, max_size=4),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_change_to_a_varied_tool_makes_it_again(shapes, seed):
    tool = chain(shapes)
    numbers = tool_numbers(tool)
    varied = vary_tool(
        tool, numbers.steps * np.random.default_rng(seed).uniform(-1, 1, len(numbers))
    )
    change = tool_change(tool, varied)
    for after, again in zip(
        varied.components, vary_tool(tool, change).components, strict=True
    ):
        np.testing.assert_allclose(
            again.shape.bounds[1], after.shape.bounds[1], rtol=1e-9
        )
        np.testing.assert_allclose(again.pose.matrix, after.pose.matrix, atol=1e-9)
    halfway = vary_tool(tool, change / 2).components[0].shape.bounds[1]
    expected = np.sqrt(
        tool.components[0].shape.bounds[1] * varied.components[0].shape.bounds[1]
    )
    np.testing.assert_allclose(halfway, expected, rtol=0.01)


def test_tools_of_another_structure_are_no_change_of_each_other():
    box = SHAPES[0]
    ball = SHAPES[3]
    tool = chain([box, box, box])
    fan = replace(
        tool,
        components=(*tool.components[:2], replace(tool.components[2], parent="part0")),
    )
    for other in (chain([box, box]), chain([box, box, ball]), fan):
        assert tool_change(tool, other) is None
    renamed = replace(tool.components[0], name="root", color=(1, 0, 0, 1))
    assert not tool_change(chain([box]), Tool((renamed,), name="other")).any()


def test_plans_with_as_many_waypoints_lead_to_each_other():
    plan, other, longer = (
        Waypoints(np.full((n, 6), at)) for n, at in ((2, 0.1), (2, 0.3), (3, 0.3))
    )
    assert (
        ACTIONS.with_parameters(plan, ACTIONS.toward(plan, other)).dump()
        == other.dump()
    )
    assert ACTIONS.toward(plan, longer) is None
