"""What fits a tool to an arm, against the flange's drawing and the finger."""

import math

import numpy as np
import pytest

from core.design import Component, Tool
from core.geometry import Box, Cylinder, Mesh, Pose
from core.interfaces import Material
from core.robot.solids import corners, robot_solids
from core.values.printers import Printer
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.solid import manifold
from plugins.results.workshop.tool import make_tool
from tests.support.panda import PANDA

WIDE = Printer(plate_mm=[500.0, 500.0, 500.0])


def made(*components, robot=PANDA, fit=None, gripper=False):
    return make_tool(
        Tool(components, gripper=gripper), robot, Material(), WIDE, fit or Fit()
    )


def box(name, at, size, parent="tool_mount"):
    return Component(name, parent, Pose(np.array(at)), Box(size))


POST = Component(
    "post", "tool_mount", Pose.xyz_rpy((0.0, 0.0, -0.06)), Cylinder(0.012, 0.12)
)


def circles(solid, height):
    """Holes of a section: middles (N, 2) and diameters, millimetres."""
    rings = [np.array(ring) for ring in solid.slice(height).to_polygons()]
    area = [
        np.sum(
            ring[:, 0] * np.roll(ring[:, 1], -1) - ring[:, 1] * np.roll(ring[:, 0], -1)
        )
        / 2
        for ring in rings
    ]
    holes = [ring for ring, of in zip(rings, area, strict=True) if of < 0]
    return [
        (ring.mean(axis=0), 2 * np.hypot(*(ring - ring.mean(axis=0)).T).mean())
        for ring in holes
    ]


def check(found, name):
    return next(check for check in found.checks if check.name == name)


def test_bores_are_where_the_panda_has_threads():
    """Its drawing has four M6 at 45 degrees on a circle of 50 mm, and a pin of 6 mm at 90 degrees, from outside."""
    found = made(POST)
    assert check(found, "screws").passed
    holes = circles(found.parts[0].solid, -3.5)
    turn = PANDA.mount.rotation.as_matrix()[:2, :2]
    at = {round(diameter, 1): [] for _, diameter in holes}
    for middle, diameter in holes:
        assert np.hypot(*middle) == pytest.approx(25, abs=0.01)
        x, y = turn @ middle
        at[round(diameter, 1)].append(round(math.degrees(math.atan2(y, x))))
    assert {size: sorted(angles) for size, angles in at.items()} == {
        6.6: [-135, -45, 45, 135],
        6.1: [90],
    }


def test_the_plate_is_below_the_face_and_its_boss_in_the_recess():
    solid = made(POST).parts[0].solid
    assert solid.slice(-0.01).area() == pytest.approx(
        math.pi * (31.5**2 - 4 * 3.3**2 - 3.05**2), rel=0.01
    )
    boss = solid.trim_by_plane((0, 0, 1), 0.01)
    low, high = np.reshape(boss.bounding_box(), (2, 3))
    assert high - low == pytest.approx([31.3, 31.3, 2.99], abs=0.02)
    for way in range(4):  # a key's way to each head, which rests on the plate
        x = 25 * math.cos(way * math.pi / 2)
        y = 25 * math.sin(way * math.pi / 2)
        assert not solid.ray_cast((x, y, -200), (x, y, 10))
        (hit,) = (
            hit
            for hit in solid.ray_cast((x + 4.5, y, -100), (x + 4.5, y, -1))
            if hit.normal[2] < 0
        )
        assert hit.position[2] == pytest.approx(-7)


def test_a_beam_is_held_by_long_screws_through_it():
    found = made(box("beam", (0.1, 0, -0.01), (0.3, 0.03, 0.02)))
    assert sorted(found.hardware[:2]) == ["2 x M6 x 12", "2 x M6 x 25"]
    assert check(found, "screws").passed
    below = circles(found.parts[0].solid, -19)
    assert sorted(round(middle[0]) for middle, _ in below) == [-25, 25]
    assert all(diameter == pytest.approx(6.6, abs=0.05) for _, diameter in below)


def test_what_is_above_the_face_cut_by_where_the_arm_is():
    found = made(box("cap", (0, 0, 0.0), (0.06, 0.06, 0.02)))
    assert not check(found, "clear of the arm").passed
    solid = found.parts[0].solid
    assert solid.slice(5.0).area() < 60**2 - math.pi * 31.5**2 + 1
    assert check(made(POST), "clear of the arm").passed


@pytest.mark.parametrize("mount", ["left_finger", "right_finger"])
def test_a_sleeve_slides_over_the_finger_and_does_not_meet_it(mount):
    side = 1 if mount == "left_finger" else -1
    found = made(
        box("pad", (0, side * 0.007, 0.08), (0.016, 0.014, 0.08), mount), gripper=True
    )
    assert {check.name for check in found.checks if not check.passed} <= {"weight"}
    sleeve = found.parts[0].solid
    finger = [
        manifold(Mesh.hull_of(1000 * s.pose.apply(corners(s.geometry))).to_trimesh())
        for s in robot_solids(PANDA, True)
        if s.name == mount
    ]
    assert len(finger) == 4
    for back in np.linspace(0, 40, 9):  # mm on its way from the tip to its place
        assert all(
            (sleeve.translate((0, 0, back)) ^ part).volume() < 1e-6 for part in finger
        )
    tip = max(part.bounding_box()[5] for part in finger)
    # It comes to rest at the tip.
    assert max((sleeve.translate((0, 0, -0.5)) ^ part).volume() for part in finger) > 1
    low, high = np.reshape(sleeve.bounding_box(), (2, 3))
    assert low[2] < tip - 24
    (bore,) = {round(d, 1) for _, d in circles(sleeve.rotate((0, -90, 0)), high[0] - 1)}
    assert bore == pytest.approx(4.0, abs=0.1)
