"""The table of a layout holds the numbers of the scene."""

import re
from dataclasses import dataclass

import numpy as np
import pytest

from core.geometry import Pose
from core.interfaces import Task
from core.plugins import installed
from core.scene import Body, Box, Cylinder, Geom, Mesh, Scene, Sphere
from plugins.conformance.shared import ready
from plugins.vlms.context.layout_table import layout_table

RED = (1.0, 0.0, 0.0, 1.0)


def rows_of(*bodies):
    """The rows of a scene's table by the name of the body."""

    @dataclass
    class Still(Task):  # which can't be hashed, like a task of a third party
        name = "Still"
        description = "Nothing happens."
        goals = ()

        def scene(self, seed):
            return Scene(bodies)

        def reward(self, start, end):
            return np.zeros(len(end.positions))

    lines = layout_table(Still(), 0).splitlines()[2:]
    return {
        cells[0]: cells
        for line in lines
        for cells in [[cell.strip() for cell in line.strip("|").split("|")]]
    }


def test_a_turned_box_and_a_lying_cylinder():
    rows = rows_of(
        Body.of(
            "book",
            Box((0.2, 0.1, 0.04)),
            (0.5, 0.1, 0.02),
            mass=0.5,
            color=RED,
            rpy=(0, 0, np.pi / 2),
        ),
        Body.of(
            "can",
            Cylinder(0.03, 0.2),
            (0.5, 0, 0.03),
            mass=0.1,
            color=RED,
            rpy=(0, np.pi / 2, 0),
            friction=0.3,
        ),
        Body.of(
            "ball",
            Sphere(0.05),
            (1, 0, 0.05),
            mass=1,
            color=RED,
            rpy=(0.3, 0.4, 0),
            rolling_friction=0.001,
        ),
    )
    assert rows["book"][1:] == [
        *(
            "0.5 0.1 0.02 yaw 1.571",
            "box 0.2 0.1 0.04",
            "0.45 to 0.55",
            "0 to 0.2",
            "0 to 0.04",
            "0.5 kg",
            "0.5",
        )
    ]
    assert rows["can"][1:] == [
        *("0.5 0 0.03 rpy 0 1.571 0", "cylinder, radius 0.03, length 0.2"),
        *("0.4 to 0.6", "-0.03 to 0.03", "0 to 0.06", "0.1 kg", "0.3"),
    ]
    assert rows["ball"][3:] == [
        "0.95 to 1.05",
        "-0.05 to 0.05",
        "0 to 0.1",
        "1 kg",
        "0.5, rolling 0.001",
    ]


def walls(size, thickness, bottom):
    """A box of walls, open on top, with or without a bottom; its frame is in the middle."""
    x, y, z = np.array(size) / 2
    parts = [
        Geom(Box((thickness, 2 * y, 2 * z)), Pose.xyz_rpy((side * x, 0, 0)))
        for side in (-1, 1)
    ]
    parts += [
        Geom(Box((2 * x, thickness, 2 * z)), Pose.xyz_rpy((0, side * y, 0)))
        for side in (-1, 1)
    ]
    parts += [Geom(Box((2 * x, 2 * y, thickness)), Pose.xyz_rpy((0, 0, -z)))] * bottom
    return tuple(parts)


def test_the_inside_of_a_hollow_body():
    box, frame = walls((0.4, 0.3, 0.2), 0.02, True), walls((0.4, 0.3, 0.2), 0.02, False)
    rows = rows_of(
        Body("bin", Pose.xyz_rpy((1.0, 0.5, 0.1)), 0.0, box, box),
        Body("frame", Pose.xyz_rpy((1.0, -0.5, 0.1), (0, 0, 0.3)), 1.0, frame, frame),
        Body("stack", Pose(), 1.0, box[:3], (Geom(Box((1, 1, 1))), *box[:2])),
    )
    assert rows["bin"][2] == (
        "5 boxes; hollow, free through its middle: x 0.81 to 1.19, y 0.36 to 0.64, z 0.01 to open"
    )
    assert rows["frame"][2] == (
        "4 boxes, 0.42 0.32 0.2 along its own axes; "
        "hollow, free through its middle in its own frame: x -0.19 to 0.19, y -0.14 to 0.14, z open to open"
    )
    assert rows["stack"][2] == "3 boxes"  # its middle is solid


def test_bodies_alike_share_a_row():
    cubes = [
        Body.of(
            f"c{i}",
            Box((0.1, 0.1, 0.1)),
            (i, 0, 0.05),
            mass=0.1,
            color=(i / 9, 0, 0, 1),
        )
        for i in range(5)
    ]
    heavier = Body.of("heavy", Box((0.1, 0.1, 0.1)), (9, 0, 0.05), mass=0.2, color=RED)
    mark = Body.mark("mark", (0.5, 0, 0), 0.05, RED)
    rows = rows_of(
        *cubes,
        heavier,
        mark,
        *[Body.of(n, Sphere(0.1), (0, 0, 1), mass=1, color=RED) for n in "ab"],
    )
    assert list(rows) == ["5 alike: c0 ... c4", "heavy", "mark", "a", "b"]
    assert (
        rows["5 alike: c0 ... c4"][1]
        == "0 0 0.05; 1 0 0.05; 2 0 0.05; 3 0 0.05; 4 0 0.05"
    )
    assert rows["5 alike: c0 ... c4"][3] == "-0.05 to 4.05"
    assert rows["mark"][2] == "a mark: nothing touches it"
    assert rows["mark"][-2:] == ["fixed", "-"]


def test_a_hull_of_points():
    wedge = Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0.5]]),
        np.array([[0, 1, 2], [0, 1, 3]]),
    )
    assert rows_of(Body.of("wedge", wedge, (0, 0, 1), mass=1, color=RED))["wedge"][
        2:6
    ] == [*("1 convex part", "0 to 1", "0 to 1", "1 to 1.5")]


@pytest.mark.parametrize("name", ready("task"))
def test_every_body_of_a_task_is_there(name):
    task = installed().create("task", name)
    table = layout_table(task, 3)
    for body in task.scene(3).bodies:
        x, y, z = (f"{round(float(v), 3) + 0.0:g}" for v in body.pose.position)
        assert f" {x} {y} {z}" in table
        assert re.search(rf"\b{body.name}\b", table) or re.search(r"alike: ", table)


def test_another_seed_is_another_layout():
    task = installed().create("task", "CleanTable")
    assert layout_table(task, 0) != layout_table(task, 1)
