"""What overlaps, falls or is left behind in a layout, and how fast things get that move by themselves."""

from dataclasses import replace

import numpy as np
import pytest

from core.errors import UserError
from core.interfaces import Ability, Outcome, Recording
from core.plugins import installed
from core.scene import Body, Box, Scene, Sphere, State, table
from core.simulation.engines import (
    find_steps_hz,
    list_scene_needs,
    refuse_hurried,
)
from core.solids.standing import (
    find_falls,
    find_fast,
    find_layout_warnings,
    find_left_behind,
    find_overlaps,
    find_rate,
    list_flights,
)
from tests.support.text import replaced_all

GREY = (0.5, 0.5, 0.5, 1.0)
SCENE = """
name: Press
description: A button sits on a post beside a crate, and a cube lies on the table. Press the button.
bodies:
  - {name: post, fixed: true, box: [0.05, 0.05, 0.06], position: [0.72, 0.1, 0.03]}
  - {name: button, cylinder: {radius: 0.015, length: 0.02}, position: [0.72, 0.1, 0.0725], mass: 0.05}
  - {name: cube, box: [0.05, 0.05, 0.05], position: [0.5, 0.12, 0.0251], rpy_deg: [0, 0, 0], mass: 0.2}
  - {name: crate, fixed: true, box: [0.1, 0.1, 0.1], position: [0.5, -0.2, 0.05]}
joints:
  - {name: press, kind: slider, body: button, axis: [0, 0, -1], lower: 0, upper: 0.01, friction: 1, damping: 5}
goals:
  - {joint: press, to: "> 0.008", ever: true}
variations:
  wide:
    RANGES
"""


def cube(name, x, z, side=0.05, mass=0.1, shape=Box):
    form = Sphere(side / 2) if shape is Sphere else Box((side, side, side))
    return Body.of(name, form, (x, 0.0, z), mass=mass, color=GREY)


def warnings_of(tmp_path, ranges, scene=SCENE):
    file = tmp_path / "press.yaml"
    file.write_text(replaced_all(scene, ("RANGES", ranges)))
    task = installed().create("task", "file", file=str(file), variation="wide")
    return list(find_layout_warnings(task))


@pytest.mark.parametrize(("sunk", "overlaps"), [(0.0009, 0), (0.0011, 1)])
def test_what_is_deeper_than_a_millimetre_overlaps(sunk, overlaps):
    scene = Scene((table(), cube("low", 0.6, 0.025), cube("high", 0.6, 0.075 - sunk)))
    assert len(list(find_overlaps(scene))) == overlaps


@pytest.mark.parametrize(("gap", "falls"), [(0.0019, 0), (0.0021, 1)])
def test_what_is_higher_than_two_millimetres_falls(gap, falls):
    scene = Scene((table(), cube("low", 0.6, 0.025 + gap)))
    assert len(list(find_falls(scene))) == falls


@pytest.mark.parametrize(("way", "left"), [(0.0, 0), (0.002, 0), (0.004, 1)])
def test_what_stays_while_its_bearer_moves_is_left_behind(way, left):
    nominal = Scene((cube("post", 0.6, 0.025, mass=0.0), cube("cup", 0.6, 0.0751)))
    moved = Scene((cube("post", 0.6 + way, 0.025, mass=0.0), cube("cup", 0.6, 0.0751)))
    assert len(list(find_left_behind(moved, nominal))) == left


@pytest.mark.parametrize(
    ("ranges", "said"),
    [
        ("bodies.cube.position.x: [0.48, 0.52]", None),
        ("bodies.cube.rpy_deg.yaw: [-20, 20]", None),
        ("bodies.post.position.y: [0.02, 0.15]", "button stays where it is while post"),
        ("bodies.button.position.y: [0.06, 0.14]", None),  # its joint takes it along
        ("bodies.cube.position.z: [0.03, 0.2]", "cube begins in the air"),
        ("bodies.cube.position.z: [-0.01, 0.0]", "table and cube overlap"),
        ("bodies.cube.position.y: [-0.2, -0.1]", "cube and crate overlap"),
        ("bodies.cube.box.2: [0.03, 0.04]", "cube begins in the air"),
    ],
)
def test_layouts_are_looked_at_as_the_nominal_one_is(tmp_path, ranges, said):
    found = warnings_of(tmp_path, ranges)
    assert bool(found) == (said is not None), found
    assert said is None or said in found[0]
    assert said is None or "of variation wide" in found[0]


def test_a_layout_in_which_a_post_stops_its_button(tmp_path):
    scene = SCENE.replace("0.1, 0.03]", "0.1, 0.02]")  # it has 12.5 mm of way
    (line,) = warnings_of(tmp_path, "bodies.post.position.z: [0.02, 0.03]", scene)
    assert "of variation wide, joint press (goal 0): button meets post" in line


@pytest.mark.parametrize(
    "path",
    ["bodies.cube.position.yaw", "bodies.cube.rpy_deg.z", "bodies.cube.box.yaw"],
)
def test_an_axis_belongs_to_its_key(tmp_path, path):
    with pytest.raises(UserError, match="there is no such number"):
        warnings_of(tmp_path, f"{path}: [0.1, 0.2]")


def test_what_falls_or_is_thrown_has_a_speed_and_meets_the_thinnest_in_its_way():
    plate = Body.of(
        "plate", Box((0.2, 0.2, 0.002)), (0.6, 0, 0.2), mass=0.0, color=GREY
    )
    aside = Body.of(
        "wire", Box((0.2, 0.001, 0.001)), (0.6, 0.3, 0.2), mass=0.0, color=GREY
    )
    ball = cube("ball", 0.6, 0.5, side=0.02, shape=Sphere)
    rests = cube("rests", 0.9, 0.0251)
    (flight,) = list_flights(Scene((table(), plate, aside, ball, rests)))
    assert flight.body == "ball"
    assert flight.thin == pytest.approx(0.002)
    assert flight.speed == pytest.approx(np.sqrt(2 * 9.81 * 0.289), rel=1e-3)


@pytest.mark.parametrize(("thick", "warned"), [(0.0006, 0), (0.0003, 1)])
def test_what_no_step_is_fine_enough_for_is_warned_of(thick, warned):
    foil = Body.of("foil", Box((0.2, 0.2, thick)), (0.6, 0, 0.2), mass=0.0, color=GREY)
    ball = cube("ball", 0.6, 0.5, side=0.02, shape=Sphere)
    assert len(list(find_fast(Scene((foil, ball))))) == warned


@pytest.mark.parametrize(
    ("side", "speed", "rate"), [(0.003, 0.6, 400), (0.003, 3.0, 2000), (0.05, 3.0, 120)]
)
def test_small_things_need_as_many_steps_as_they_are_fast(side, speed, rate):
    scene = Scene((cube("small", 0.6, 0.5, side), cube("still", 0.9, 0.0251)))
    states = State.stack([scene.state()] * 3)
    states.linear_velocities[1, 0] = [0, 0, -speed]
    assert find_rate(scene, states) == pytest.approx(rate)


@pytest.mark.parametrize(("speed", "finer"), [(0.59, 0), (0.61, 800), (1.3, 1600)])
def test_a_rollout_with_coarse_steps_is_told_from_one_with_fine_ones(speed, finer):
    scene = Scene((cube("small", 0.6, 0.5, 0.003),))
    states = State.stack([scene.state()] * 2)
    states.linear_velocities[1, 0] = [0, 0, -speed]
    taken = Recording(np.arange(2.0), np.zeros((2, 7)), np.zeros((2, 2)), states)
    outcome = Outcome(None, None, recording=taken, time_step=1 / 400)
    assert find_steps_hz(scene, outcome) == pytest.approx(finer)
    refused = refuse_hurried(scene, outcome).error
    assert (refused is None) == (finer == 0)
    assert find_steps_hz(scene, replace(outcome, time_step=1 / 1600)) == 0


@pytest.mark.parametrize(("side", "needed"), [(0.003, True), (0.05, False)])
def test_a_scene_in_which_small_things_fall_needs_fine_steps(side, needed):
    scene = Scene((table(), cube("small", 0.6, 0.5, side)))
    needs = [ability for ability, _ in list_scene_needs(scene)]
    assert (Ability.FINE_STEPS in needs) == needed
