"""Where goals want bodies in a layout, as the embedded designer sees it."""

import numpy as np
import pytest

from core.goals import Away, JointAt, Placed, Turned
from core.scene import Body, Box, Joint, Scene
from plugins.vlms.offline.targets import Target, find_targets
from tasks.dislodge_cube import DislodgeCube

CUBE = Body.of("cube", Box((0.1, 0.1, 0.1)), (0.5, 0, 0.05), mass=1, color=(1, 0, 0, 1))


def test_a_goal_in_the_frame_of_a_body():
    task = DislodgeCube("wide")
    scene = task.scene(3)
    (target,) = find_targets(task.goals[0], scene)
    there = scene["pipe"].pose.apply([*task.goals[0].place[:2], 0.0])
    assert target.reference == "pipe"
    assert target.place == (pytest.approx(there[0]), pytest.approx(there[1]), None)
    apart = Away(("cube",), away=0.1)
    assert find_targets(apart, scene) == [Target(("cube",), away=0.1)]


def test_bodies_with_places_of_their_own_are_targets_of_their_own():
    places = ((0.5, 0.1, None), (0.5, 0.3, None))
    goal = Placed(("left", "right"), places=places, rest=True)
    scene = DislodgeCube().scene(0)
    assert [(target.bodies, target.place) for target in find_targets(goal, scene)] == [
        (("left",), places[0]),
        (("right",), places[1]),
    ]


def test_a_turn_at_a_place_and_a_joint():
    slide = Joint("slide", "slider", "cube", axis=(1, 0, 0), lower=0, upper=1)
    scene = Scene((CUBE,), (slide,))
    turned = Turned(axis=(0, 0, 1), points=(1, 0, 0), at="cube")
    (target,) = find_targets(Placed(("cube",), place=(0, 0, 1), also=(turned,)), scene)
    assert (target.place, target.axis) == ((0, 0, 1), (0, 0, 1))
    assert np.allclose(target.points, (1, 0, 0))
    (target,) = find_targets(JointAt(joint="slide", to=0.2), scene)
    assert (target.bodies, target.joint, target.to) == (("cube",), "slide", 0.2)
    assert target.place == pytest.approx((0.7, 0, 0.05))
