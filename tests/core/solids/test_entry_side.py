"""Sheets that cut through bodies where the least way out is short, and what only looks like it."""

import coal
import numpy as np
import pytest

from core.design import Tool
from core.geometry import Box, Cylinder, Pose, Sphere
from core.scene import Body, Geom, Scene, table
from core.solids.penetration import findings
from plugins.results.workshop.tracks import robot_tracks
from tests.support.panda import ARM, PANDA
from tests.support.recordings import ROD, body, penetrations, recording, straight

HZ = 400.0
SIDE = 0.05
THIN = pytest.mark.parametrize("thick", [0.0005, 0.001, 0.002])


def sheet(thick, low=0.0, rpy=(0, 0, 0)):
    """A square-edged sheet on the table, whose front edge is 10 mm before the cube, and its path into it."""
    return body(
        "sheet", Box((0.2, 0.2, thick)), (0.5 - 0.135, 0.0, low + thick / 2), rpy=rpy
    )


def cube(low=0.0):
    return body("cube", Box((SIDE, SIDE, SIDE)), (0.5, 0.0, low + SIDE / 2), mass=1.0)


def pushed(scene, way, lifts, hz=HZ, count=80, speed=1.0):
    """What is found as the sheet moves ahead by ``way`` and the cube by ``lifts``: (share of the way, x, z), rising."""
    shares = np.minimum(np.arange(count) * speed / hz / way, 1.0)
    at, x, z = np.array(lifts, dtype=float).T
    start, other = scene["sheet"].pose.position, scene.free[1].pose.position
    path = start + np.outer(shares * way, (1.0, 0.0, 0.0))
    moved = other + np.column_stack(
        [np.interp(shares, at, x), 0 * shares, np.interp(shares, at, z)]
    )
    tilted = {"sheet": scene["sheet"].pose.quaternion}
    return penetrations(
        scene,
        recording(
            scene, {"sheet": path, scene.free[1].name: moved}, hz=hz, quaternions=tilted
        ),
    )


# --- what cuts --------------------------------------------------------------------------------------------------


@THIN
@pytest.mark.parametrize("speed", [0.2, 1.0, 3.0])
def test_a_sheet_that_goes_through_the_lowest_layer(thick, speed):
    """The cube stays where it is, and is on top of the sheet after 10 mm."""
    scene = Scene((table(), sheet(thick), cube()))
    lifts = [(0.0, 0, 0), (0.2, 0, 0), (0.4, 0, thick), (1.0, 0, thick)]
    (found,) = pushed(
        scene, 0.05, lifts, speed=speed, count=round(0.06 / speed * HZ) + 8
    )
    assert found.startswith("'sheet' cut into 'cube'")


@THIN
def test_a_sheet_stuck_between_touching_parts_of_a_body(thick):
    """A little more than half of it is in the foot, the rest in the disc, that have no gap between them."""
    foot = Geom(Cylinder(0.03, 0.02), Pose.xyz_rpy((0.0, 0.0, 0.01)))
    disc = Geom(Cylinder(0.05, 0.01), Pose.xyz_rpy((0.0, 0.0, 0.025)))
    plate = Body("plate", Pose.xyz_rpy((0.525, 0.0, 0.0)), 0.5, (), (foot, disc))
    scene = Scene((table(), sheet(thick, low=0.02 - 0.52 * thick), plate))
    (found,) = pushed(scene, 0.06, [(0, 0, 0), (1, 0, 0)])
    assert "'plate'" in found


def test_a_sheet_that_stands_on_its_edge():
    """A knife through a cube's corner: the least way out is to the side."""
    knife = body("sheet", Box((0.2, 0.001, 0.2)), (0.5 - 0.135, SIDE / 2 - 0.0005, 0.1))
    (found,) = pushed(Scene((table(), knife, cube())), 0.06, [(0, 0, 0), (1, 0, 0)])
    assert "cut into" in found


@THIN
def test_a_sheet_that_is_pressed_into_a_thick_block(thick):
    """It is wholly inside of the block, 5 mm below its face, and may come out below something on the block."""
    block = body("block", Box((0.5, 0.5, 0.2)), (0.5, 0.0, 0.1), mass=0.0)
    scene = Scene(
        (block, body("sheet", Box((0.2, 0.2, thick)), (0.5, 0.0, 0.2 + thick / 2)))
    )
    down = np.repeat(0.2 + thick / 2 - np.array([0.0, 0.0025, 0.005, 0.0]), 40)
    path = np.column_stack([np.full(160, 0.5), np.zeros(160), down])
    (found,) = penetrations(scene, recording(scene, {"sheet": path}, hz=HZ))
    assert "deep inside" in found


# --- what only looks like it ------------------------------------------------------------------------------------


@THIN
def test_a_sheet_that_slides_into_a_gap(thick):
    """It touches the cube from below, a little deeper than engines let things rest, and the cube slides off it."""
    scene = Scene((table(), sheet(thick), cube(low=0.8 * thick)))
    assert pushed(scene, 0.1, [(0, 0, 0), (1, 0, 0)], count=120) == []


@THIN
def test_a_sheet_that_pushes_the_cube_ahead(thick):
    """Its edge is as deep in the cube as two of its thicknesses: less than a cut."""
    scene = Scene((table(), sheet(thick), cube()))
    deep = 0.01 + 2 * thick
    assert (
        pushed(scene, 0.06, [(0, 0, 0), (deep / 0.06, 0, 0), (1, 0.06 - deep, 0)]) == []
    )


@pytest.mark.parametrize("pitch", [0.1, 0.3])
def test_a_wedge_that_lifts_the_cube(pitch):
    """A tilted plate under the cube's edge: the cube rides up on it, 0.3 mm deep, on and on."""
    size, tilt = (0.2, 0.2, 0.002), (0.0, pitch, 0.0)
    # The upper front edge, from the middle.
    edge = Pose.xyz_rpy((0.0, 0.0, 0.0), tilt).apply((0.1, 0.0, 0.001))
    wedge = body("sheet", Box(size), np.array([0.465, 0.0, 0.0003]) - edge, rpy=tilt)
    scene = Scene((wedge, cube()))
    rise = 0.05 * np.tan(pitch)
    assert pushed(scene, 0.06, [(0, 0, 0), (1 / 6, 0, 0), (1, 0, rise)]) == []


def test_a_cube_that_falls_onto_a_thin_wall_and_slides_off():
    """A fall of a metre takes it 10 mm into the wall within a step; then it is beside the wall."""
    wall = body("wall", Box((0.015, 0.5, 0.2)), (0.5, 0.0, 0.1), mass=0.0)
    scene = Scene((wall, body("cube", Box((SIDE, SIDE, SIDE)), (0.52, 0.0, 0.5))))
    low = SIDE / 2 + 0.2
    fall = straight((0.52, 0, 0.5), (0.52, 0, low - 0.006), 26)
    path = np.vstack(
        [fall, straight((0.5275, 0, low - 0.006), (0.5325, 0, low - 0.05), 20)]
    )
    assert findings(scene, PANDA, ROD, recording(scene, {"cube": path}, hz=HZ)) == []


# Where the middle of a leg's knob is from the inner edge of a rim, (aside, up), mm, a step of 2.5 ms after the other.
GLANCE = [
    (2.4, 18.8),
    (2.07, 11.3),
    (0.66, 3.87),
    (0.95, 0.83),
    (2.12, -1.5),
    (3.47, -4.0),
    (5.01, -7.0),
    (7.6, -10.0),
]


@pytest.mark.parametrize(("aside", "texts"), [(0.0, 0), (-0.003, 1)])
def test_a_ball_that_falls_onto_a_rim_and_glances_off_it(aside, texts):
    """At 3 m/s it is 8 mm deep in two steps, and rounds the edge; 3 mm farther in its middle goes through the rim."""
    rim = body("rim", Box((0.5, 0.006, 0.1)), (0.5, -0.003, 0.05), mass=0.0)
    scene = Scene((rim, body("ball", Sphere(0.009), (0.5, 0.0, 0.2))))
    glance = 0.001 * np.array(GLANCE) + (aside, 0.1)
    along = np.full(len(glance), 0.5)
    path = np.column_stack([along, glance])
    fall = straight((*path[0, :2], path[0, 2] + 0.1), path[0], 14)
    found = penetrations(scene, recording(scene, {"ball": [*fall, *path]}, hz=HZ))
    assert len(found) == texts


def test_a_sheet_that_cuts_into_a_finger_is_found():
    """Parts of the fingers are boxes, other than the arm's links, which are hulls."""
    tool, count = Tool(gripper=True), 80
    arms = np.tile(ARM.home, (count, 1))
    cut = body("cut", Box((0.05, 0.05, 0.001)), (0.0, 0.0, 2.0), mass=0.1)
    still = recording(
        Scene((cut,)), {"cut": np.tile([0.0, 0.0, 2.0], (count, 1))}, hz=HZ, arms=arms
    )
    boxes = (
        track
        for track in robot_tracks(PANDA, tool, still)
        if isinstance(track.geometry, coal.Box)
    )
    fingers = [track for track in boxes if track.name == "left_finger"]
    lowest = min(fingers, key=lambda track: track.low[0, 2])
    middle = (lowest.low[0] + lowest.high[0]) / 2
    path = np.linspace(middle - [0.06, 0.0, 0.0], middle - [0.01, 0.0, 0.0], count)
    found = penetrations(
        Scene((cut,)), recording(Scene((cut,)), {"cut": path}, hz=HZ, arms=arms), tool
    )
    assert any("'left_finger' " in text for text in found)


# --- blows ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("deep", "texts"), [(0.009, 0), (0.02, 0), (0.046, 1)])
def test_a_blow_ends_at_the_far_side_of_a_wall(deep, texts):
    """A rod pokes at a wall of 10 mm for 40 ms, and comes back; a body that falls gets in by 20 mm too."""
    wall = body("wall", Box((0.01, 0.5, 0.5)), (0.5, 0.0, 0.25), mass=0.0)
    scene = Scene((wall, body("rod", Box((0.2, 0.02, 0.02)), (0.3, 0.0, 0.25))))
    shares = np.interp(np.arange(80), [0, 30, 38, 46, 80], [0, 0, 1, 0, 0])
    path = np.array([0.39, 0.0, 0.25]) + np.outer(shares, (0.005 + deep, 0.0, 0.0))
    found = penetrations(scene, recording(scene, {"rod": path}, hz=HZ))
    assert len(found) == texts
    assert all("deep inside 'wall'" in text for text in found)


def test_a_blow_of_the_robot_ends_at_the_far_side_of_a_thinner_wall():
    """A stick of 20 mm turns into a wall of 5 mm, about the arm's first axis, and back within 30 ms."""
    turns = np.interp(np.arange(80), [0, 30, 36, 42, 80], [0.3, 0.3, 0.0, 0.3, 0.3])
    arms = np.tile(ARM.home, (80, 1))
    arms[:, 0] += turns
    tip = ARM.forward(ARM.home).apply((0.0, 0.0, -0.19))
    wall = body("wall", Box((0.06, 0.005, 0.06)), tip - (0.0, 0.004, 0.0), 0.0)
    found = penetrations(
        Scene((wall,)), recording(Scene((wall,)), {}, hz=HZ, arms=arms)
    )
    (text,) = found
    assert text.startswith("'rod' was ")
    assert "deep inside 'wall'" in text


@pytest.mark.parametrize(("looks", "texts"), [(1, 0), (2, 0), (10, 1)])
def test_no_single_look_decides_where_an_engine_pushes_a_body_out(looks, texts):
    """A body jumps beyond the far side of another, and is back one, two or ten steps of 2.5 ms later."""
    wall = body("wall", Box((0.01, 0.5, 0.5)), (0.5, 0.0, 0.25), mass=0.0)
    scene = Scene((wall, body("rod", Box((0.2, 0.02, 0.02)), (0.3, 0.0, 0.25))))
    path = np.tile([0.39, 0.0, 0.25], (80, 1))
    path[40 : 40 + looks, 0] += 0.04
    assert len(penetrations(scene, recording(scene, {"rod": path}, hz=HZ))) == texts
