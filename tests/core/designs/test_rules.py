import math
import re

import numpy as np
import pytest
import trimesh

from core.design import Component, DesignError, Tool
from core.designs.plan_rules import check_plan
from core.designs.rules import check_tool
from core.designs.start import SpawnRules
from core.errors import UserError
from core.geometry import Box, Cylinder, Mesh, Pose, Sphere
from core.plugins import Plugins
from core.scene import Body, Geom
from tests.core.plugins.offering import Offering
from tests.support.boxes import box, rigid
from tests.support.panda import PANDA, on_panda
from tests.support.refusing import refused
from tests.support.scenes import CubeOnTable

WAYPOINT = [0.5, 0, 0.3, 0, 0, 0]


def test_a_rule_of_a_plugin_that_fails_costs_the_design(monkeypatch):
    plugins = Plugins()
    broken = Offering(tool_rules={"printer": lambda tool, robot, material: 1 / 0})
    plugins.register(broken, "lab", "my-lab")
    monkeypatch.setattr("core.designs.rules.installed", lambda: plugins)
    with pytest.raises(
        DesignError,
        match="tool_rule 'printer' of my-lab raised ZeroDivisionError: division by zero",
    ):
        check_tool(Tool((box(),)), PANDA)


def gripper(*components):
    return Tool(components, gripper=True)


# --- the tool ---------------------------------------------------------------------------------------------------


def test_a_sound_tool_passes():
    check_tool(
        rigid(box(), box("b", (0.1, 0, -0.05), (0.2, 0.02, 0.02), parent="a")), PANDA
    )


def test_number_of_components():
    check_tool(rigid(*(box(f"c{i}") for i in range(100))), PANDA)
    with refused("E_COUNT", count=101, most=100):
        check_tool(rigid(*(box(f"c{i}") for i in range(101))), PANDA)


def test_a_tool_has_components():
    with refused("E_NO_COMPONENTS", mounts="tool_mount"):
        check_tool(Tool(), PANDA)
    with refused("E_NO_COMPONENTS", mounts="left_finger or right_finger"):
        check_tool(Tool(gripper=True), PANDA)


@pytest.mark.parametrize(
    "mass", [0.0, -0.1, 1.001, math.nan, math.inf, 5e-324, 1e-30, 1e-12, 9e-7]
)
def test_masses(mass):
    with refused("E_MASS", component="a", least_kg=1e-6, most_kg=1):
        check_tool(rigid(box(mass=mass)), PANDA)


def test_extent():
    def pole(length):
        return rigid(
            box("a", (0, 0, -0.5), (0.03, 0.03, 1.0)),
            box("b", (0, 0, -length / 2), (0.03, 0.03, length - 1.0), parent="a"),
        )

    check_tool(pole(1.99), PANDA)
    reach = math.hypot(2.01, 0.015, 0.015)
    with refused("E_EXTENT", component="b", reach_m=reach, mount="tool_mount"):
        check_tool(pole(2.01), PANDA)


def bar(length, thickness, pieces=1, slope=0.0):
    """A bar that hangs from the flange, in one piece or many; each is turned against the one before, to and fro."""
    part, components = length / pieces, []
    for i in range(pieces):
        turn = Pose.xyz_rpy(
            (0, 0, 0), (slope * (i > 0) * (-1) ** i * (1 if i == 1 else 2), 0, 0)
        )
        pose = (
            (Pose.xyz_rpy((0, 0, -part / 2)) if i else Pose())
            @ turn
            @ Pose.xyz_rpy((0, 0, -part / 2))
        )
        size = Box((thickness, thickness, part))
        components.append(
            Component(
                f"c{i}", f"c{i - 1}" if i else "tool_mount", pose, size, 0.05 / pieces
            )
        )
    return Tool(tuple(components))


@pytest.mark.parametrize(
    ("thickness", "longest"), [(0.005, 0.67), (0.003, 0.34), (0.01, 1.7)]
)
@pytest.mark.parametrize("pieces", [1, 3, 20])
def test_a_bar_of_any_number_of_pieces_is_as_stiff_as_beam_theory_says(
    thickness, longest, pieces
):
    """4 L^3 / (E t^4) per newton for a square bar."""
    check_tool(bar(longest, thickness, pieces), PANDA)
    with refused("E_WEAK", weakness=f"component 'c{pieces - 1}' is not rigid: ..."):
        check_tool(bar(1.04 * longest, thickness, pieces), PANDA)


@pytest.mark.parametrize(
    ("mount", "outward"), [("left_finger", 1), ("right_finger", -1)]
)
def test_a_gap_to_a_finger(mount, outward):
    def tool(z, y=0.0075):
        return gripper(
            box(at=(0, outward * y, z), size=(0.02, 0.015, 0.04), parent=mount)
        )

    check_tool(tool(0.0745), PANDA)
    with refused("E_GAP", component="a", gap_mm=5.5, neighbour=f"mount '{mount}'"):
        check_tool(tool(0.080), PANDA)
    with refused("E_GAP", component="a", neighbour=f"mount '{mount}'"):
        check_tool(tool(0.0745, y=-0.03), PANDA)


# --- the plan ---------------------------------------------------------------------------------------------------


def test_all_faults_of_a_plan_are_named():
    plan = [[9, 0, "a", 0, 0, 0], WAYPOINT, [0, 0, 0.5, 90, 0, 0], 5]
    with pytest.raises(DesignError) as caught:
        check_plan(plan, gripper=False)
    found = [
        (one.values["where"], one.values.get("name")) for one in caught.value.refusals
    ]
    assert found == [
        ("waypoint 1", "x"),
        ("waypoint 1", "z"),
        ("waypoint 3", "roll"),
        ("waypoint 4", None),
    ]
    assert str(caught.value).count(";") >= 3


def test_plans_become_arrays():
    plan = check_plan([WAYPOINT, [1, 2, 0.5, -3.1, 0, 6]], gripper=False)
    assert plan.shape == (2, 6)
    assert plan.dtype == np.float64
    np.testing.assert_array_equal(check_plan(plan, gripper=False), plan)
    assert check_plan([[*WAYPOINT, 1]] * 200, gripper=True).shape == (200, 7)


WHERE = {"where": "waypoint 1"}


@pytest.mark.parametrize(
    ("plan", "code", "values"),
    [
        ("[[1]]", "E_PLAN_LIST", {"given": "the text '[[1]]'"}),
        ([], "E_PLAN_COUNT", {"count": 0}),
        (
            [[2.9 * (-1) ** i, 0, 0.5, 0, 0, 0] for i in range(200)],
            "E_WAY_LENGTH",
            {"way_m": 199 * 5.8, "turn_rad": 0.0, "most": 2000, "step_m": 0.02},
        ),
        (
            [[*WAYPOINT[:3], 0, 0, 3.0 * (i % 2)] for i in range(199)],
            "E_WAY_LENGTH",
            {"way_m": 0.0, "turn_rad": 198 * 3.0},
        ),
        ([[]], "E_WAYPOINT_COUNT", WHERE | {"count": 0}),
        (
            [[*WAYPOINT[:5], "0.1"]],
            "E_WAYPOINT_NUMBER",
            WHERE | {"name": "yaw", "given": "the text '0.1'"},
        ),
        ([[*WAYPOINT[:3], math.nan, 0, 0]], "E_WAYPOINT_RANGE", {"name": "roll"}),
        ([[10**400, *WAYPOINT[1:]]], "E_WAYPOINT_RANGE", {"given": 10**400}),
        (np.zeros((2, 3)), "E_WAYPOINT_COUNT", WHERE | {"count": 3}),
        (np.zeros(6), "E_WAYPOINT_LIST", WHERE),
        (np.zeros((1, 6), dtype=complex), "E_WAYPOINT_NUMBER", {"name": "x"}),
    ],
)
def test_unusable_plans_get_a_reason(plan, code, values):
    with refused(code, **values):
        check_plan(plan, gripper=False)


@pytest.mark.parametrize("value", [-0.01, 1.01, 10**400])
def test_gripper_values(value):
    limits = {"name": "gripper", "given": value, "least": 0, "most": 1}
    with refused("E_WAYPOINT_RANGE", **limits):
        check_plan([[*WAYPOINT, value]], gripper=True)


# --- the spawn --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def spawn():
    return SpawnRules(on_panda(CubeOnTable()), 0)


def test_tools_that_start_clear_pass(spawn):
    spawn.check(Tool())
    spawn.check(rigid(box(), box("b", (0.3, 0, -0.1), (0.6, 0.02, 0.02), parent="a")))
    spawn.check(
        gripper(
            box(at=(0, 0.0075, 0.07), size=(0.02, 0.015, 0.04), parent="left_finger")
        )
    )


def test_a_tool_in_the_arm(spawn):
    # Inside the link that carries it.
    spawn.check(rigid(box(at=(0, 0, 0.01), size=(0.02, 0.02, 0.02))))
    with refused("E_START_INSIDE", component="a", other="the arm (panda_link6)"):
        spawn.check(rigid(box(at=(0.05, 0, 0.11), size=(0.2, 0.02, 0.02))))
    with refused("E_START_INSIDE", component="b", other="the arm (..."):
        spawn.check(rigid(box(), box("b", (-0.5, 0, 0.1), (0.2, 0.2, 0.3), parent="a")))


@pytest.mark.parametrize(
    ("bottom", "depth", "mend"),
    [
        (0.002, None, ""),
        (0.0, "touching", "..."),
        (-0.005, "5.0 mm inside", "; move it by (0, 0, 0.006) m..."),
    ],
)
def test_a_tool_at_the_table(spawn, bottom, depth, mend):
    length = 0.5 - bottom
    tool = rigid(box(at=(0, 0, -length / 2), size=(0.02, 0.02, length)))
    if depth is None:
        spawn.check(tool)
        return

    table = "'table' of the scene"
    with refused("E_START_INSIDE", component="a", depth=depth, other=table, mend=mend):
        spawn.check(tool)


def test_all_overlaps_are_named_and_one_way_clears_them(spawn):
    """All of a rigid tool moves together: each component by itself would ask for a way of its own."""
    places = {"a": (0, 0, -0.255), "b": (0.05, 0, -0.2575), "c": (0.025, 0, -0.02)}
    sizes = {"a": (0.02, 0.02, 0.5), "b": (0.02, 0.02, 0.505), "c": (0.1, 0.02, 0.02)}

    def tool(way):
        placed = [
            box(name, np.add(at, way), sizes[name]) for name, at in places.items()
        ]
        return rigid(*placed)

    with pytest.raises(DesignError) as caught:
        spawn.check(tool((0, 0, 0)))
    words = str(caught.value)
    assert "'a' starts 5.0 mm inside 'table'" in words
    assert "'b' starts 10.0 mm inside 'table'" in words
    (way,) = re.findall(r"move all of these components by \((.*?)\) m", words)
    spawn.check(tool([float(number) for number in way.split(",")]))


def test_where_no_way_clears_all_overlaps_none_is_said():
    """A bar sticks in two walls, each of which it would have to leave towards the other."""
    part = (Geom(Box((0.02, 0.4, 0.4))),)
    walls = [
        Body(name, Pose.xyz_rpy((x, 0, 0.3)), 1.0, part, part)
        for name, x in (("left", 0.4), ("right", 0.6))
    ]
    rules = SpawnRules(on_panda(CubeOnTable(*walls)), 0)
    bar = rigid(box(at=(0, 0, -0.2), size=(0.19, 0.3, 0.02)))
    with pytest.raises(DesignError, match="no move of the whole tool helps") as caught:
        rules.check(bar)
    assert "move all" not in str(caught.value)


def test_a_tool_in_a_body(spawn):
    with refused("E_START_INSIDE", depth_mm=20.0, other="'cube' of the scene"):
        spawn.check(rigid(box(at=(0.3, 0, -0.225), size=(0.02, 0.02, 0.45))))


_wedge = trimesh.convex.convex_hull([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2]])


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.05),
        Cylinder(0.05, 0.1),
        Mesh.from_trimesh(_wedge),
        Box((0.1, 0.1, 0.1)),
    ],
)
def test_every_shape_of_a_scene_collides(shape):
    part = (Geom(shape),)
    thing = Body("thing", Pose.xyz_rpy((0.5, 0, 0.2)), 1.0, part, part)
    below = rigid(box(at=(0.001, 0.001, -0.15), size=(0.02, 0.02, 0.3)))
    beside = rigid(box(at=(0, 0.3, -0.3)))
    rules = SpawnRules(on_panda(CubeOnTable(thing)), 0)
    with refused("E_START_INSIDE", other="'thing' of the scene"):
        rules.check(below)
    rules.check(beside)
    SpawnRules(on_panda(CubeOnTable()), 0).check(below)


def slab(name, low, high):
    sides = tuple(np.subtract(high, low).tolist())
    middle = tuple((np.add(low, high) / 2).tolist())
    return Body.of(name, Box(sides), middle, mass=0, color=(1, 0, 0, 1))


@pytest.mark.slow
@pytest.mark.parametrize(("hole", "free"), [(0.05, False), (0.13, True)])
def test_what_the_last_joint_moves_is_brought_with_the_tool(hole, free):
    """In a box without a door, with a hole in its roof: the tool alone would pass either, and the flange is wider."""
    walls = [
        slab("left", (0.3, 0.14, 0), (0.7, 0.16, 0.7)),
        slab("right", (0.3, -0.16, 0), (0.7, -0.14, 0.7)),
        slab("front", (0.64, -0.14, 0), (0.66, 0.14, 0.7)),
        slab("back", (0.34, -0.14, 0), (0.36, 0.14, 0.7)),
    ]
    roof = [
        slab("roof left", (0.3, hole, 0.6), (0.7, 0.14, 0.7)),
        slab("roof right", (0.3, -0.14, 0.6), (0.7, -hole, 0.7)),
        slab("roof front", (0.5 + hole, -0.14, 0.6), (0.66, 0.14, 0.7)),
        slab("roof back", (0.34, -0.14, 0.6), (0.5 - hole, 0.14, 0.7)),
    ]
    rules = SpawnRules(on_panda(CubeOnTable(*walls, *roof)), 0)
    tool = rigid(box(at=(0, 0, -0.05), size=(0.02, 0.02, 0.1)))

    if free:
        rules.check(tool)
        return

    with refused("E_TRAPPED", part="the arm (panda_link7)", body="roof..."):
        rules.check(tool)


def test_an_attachment_may_be_in_its_own_finger_only(spawn):
    spawn.check(
        gripper(box(at=(0, 0.01, 0.045), size=(0.02, 0.01, 0.02), parent="left_finger"))
    )
    # The fingers are open: their inner faces are 0.08 m apart, and left's -y is toward the right one.
    across = gripper(
        box(at=(0, -0.04, 0.045), size=(0.02, 0.1, 0.01), parent="left_finger")
    )
    with refused("E_START_INSIDE", depth="10...", other="the arm (right_finger)"):
        spawn.check(across)
    wide = ("l", "left_finger", -0.03), ("r", "right_finger", 0.03)
    with refused("E_START_INSIDE", component="r", other="'l' on the other finger"):
        spawn.check(
            gripper(
                *(
                    box(name, (0, y, 0.06), (0.02, 0.06, 0.02), parent=mount)
                    for name, mount, y in wide
                )
            )
        )


def test_a_home_out_of_reach_is_an_error():
    class Far(CubeOnTable):
        home = Pose.xyz_rpy((2.0, 0.0, 0.5))

    with pytest.raises(UserError, match=r"can't reach the task's home \(2, 0, 0.5\)"):
        SpawnRules(on_panda(Far()), 0)
