"""A thing can be brought to its start where some way leads out; past what encloses it none does."""

import numpy as np
import pytest

from core.geometry import Box, Cylinder, Pose
from core.robot.solids import Obstacles, Solid, solid_geometry
from core.solids.escape import find_trap


def box(name, size, at, rpy=(0, 0, 0)):
    return Solid(name, solid_geometry(Box(size)), Pose.xyz_rpy(at, rpy))


FLOOR = box("floor", (10, 10, 0.1), (0, 0, -0.05))
POST = box("post", (0.02, 0.02, 0.3), (0, 0, 0.15))


def roofed(open_below):
    """A case of 0.2 m with walls of 5 mm; one side is open, or none."""
    sides = [(axis, sign) for axis in range(3) for sign in (-1, 1)]
    walls = []

    for axis, sign in sides:
        if open_below and (axis, sign) == (0, -1):
            continue
        size = np.full(3, 0.21)
        size[axis] = 0.005
        at = np.array([0.0, 0.0, 0.5])
        at[axis] += sign * 0.1025
        walls.append(box("case", tuple(size), at))

    return walls


@pytest.mark.parametrize(
    ("obstacles", "parts", "free"),
    [
        pytest.param([FLOOR], [((0.1, 0.1, 0.1), (0, 0, 0.05))], True, id="stands"),
        pytest.param(
            roofed(True), [((0.05, 0.05, 0.05), (0, 0, 0.5))], True, id="open"
        ),
        pytest.param(
            roofed(False),
            [((0.05, 0.05, 0.05), (0, 0, 0.5))],
            False,
            id="closed",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            [*roofed(True), box("plug", (0.02, 0.19, 0.19), (-0.05, 0, 0.5))],
            [((0.05, 0.15, 0.15), (0.05, 0, 0.5))],
            False,
            id="behind",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            [*roofed(True), box("plug", (0.02, 0.06, 0.06), (-0.05, -0.06, 0.44))],
            [((0.02, 0.04, 0.04), (0.05, 0.05, 0.55))],
            True,
            id="beside",
        ),
        pytest.param(
            [*roofed(True), box("plug", (0.02, 0.06, 0.19), (-0.05, 0, 0.5))],
            [((0.02, 0.05, 0.18), (0.05, 0, 0.5))],
            True,
            id="around",
        ),
    ],
)
def test_what_is_enclosed_was_not_brought(obstacles, parts, free):
    solids = [box("part", size, at) for size, at in parts]
    trap = find_trap(solids, Obstacles(obstacles))

    assert (trap is None) == free
    if trap is not None:
        assert trap.part == "part"


@pytest.mark.parametrize(
    ("room", "free"),
    [pytest.param(-0.004, False, marks=pytest.mark.slow), (0.004, True)],
)
def test_a_plate_gets_past_a_gap_by_a_little(room, free):
    """A lid over the case leaves a slot that is wider or narrower than the plate by a little."""
    case = roofed(True)
    gap = 0.03 + room
    low = box("low", (0.02, 0.21, 0.1 - gap / 2), (-0.11, 0, 0.45 - gap / 4))
    high = box("high", (0.02, 0.21, 0.1 - gap / 2), (-0.11, 0, 0.55 + gap / 4))
    plate = box("plate", (0.1, 0.15, 0.03), (0, 0, 0.5))

    trap = find_trap([plate], Obstacles([*case, low, high]))
    assert (trap is None) == free


@pytest.mark.slow
def test_a_closed_ring_about_a_bar_was_not_brought_and_an_open_one_was():
    ends = [box("stand", (0.02, 0.3, 0.3), (x, 0, 0.45)) for x in (-0.31, 0.31)]
    bar = Solid(
        "bar",
        solid_geometry(Cylinder(0.01, 0.6)),
        Pose.xyz_rpy((0, 0, 0.5), (0, np.pi / 2, 0)),
    )
    sides = [
        box("left", (0.02, 0.01, 0.1), (0, -0.045, 0.5)),
        box("right", (0.02, 0.01, 0.1), (0, 0.045, 0.5)),
        box("top", (0.02, 0.1, 0.01), (0, 0, 0.545)),
        box("bottom", (0.02, 0.1, 0.01), (0, 0, 0.455)),
    ]
    standing = Obstacles([*ends, bar])

    assert find_trap(sides, standing) is not None
    assert find_trap(sides[:3], standing) is None
