import math

import numpy as np
import pytest

from core.geometry import Box, Pose
from core.scene import Body, Cloth, Elastic, Geom, Scene, Soft, State, floor, table

RED = (1, 0, 0, 1)


@pytest.mark.parametrize("mass", [-1, math.nan, math.inf])
def test_masses_that_are_none(mass):
    with pytest.raises(ValueError, match="body 'cube': the mass must be 0"):
        Body.of("cube", Box((1, 1, 1)), (0, 0, 0), mass=mass, color=RED)


def test_a_body_that_moves_can_be_felt():
    with pytest.raises(ValueError, match=r"body 'ghost'.* needs collision parts"):
        Body("ghost", Pose(), 1.0, (Geom(Box((1, 1, 1))),), ())


def test_names_taken_twice():
    cube = Body.of("cube", Box((1, 1, 1)), (0, 0, 0), mass=1, color=RED)
    with pytest.raises(
        ValueError, match="two bodies in the scene have the same name: cube, table"
    ):
        Scene((cube, table(), cube, table(), floor()))


# --- states -----------------------------------------------------------------------------------------------------


def state(seed, names=("a", "b")):
    rng = np.random.default_rng(seed)
    count = len(names)
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return State(
        names, rng.normal(size=(count, 3)), quaternions, *rng.normal(size=(2, count, 3))
    )


def test_a_completed_state_has_the_places_of_what_does_not_move():
    scene = Scene(
        (
            table(),
            Body.of("a", Box((0.1,) * 3), (0.3, 0, 0.1), mass=0.1, color=RED),
            Body.mark("goal", (0.5, 0.2, 0), 0.1, RED),
        )
    )
    worlds = State.stack([scene.complete(state(seed, ("a",))) for seed in range(3)])
    np.testing.assert_array_equal(worlds.position("goal"), [[0.5, 0.2, 0]] * 3)
    np.testing.assert_array_equal(worlds.quaternion("table"), [[1, 0, 0, 0]] * 3)
    assert worlds[1].position("goal").shape == (3,)
    np.testing.assert_array_equal(scene.state().position("goal"), [0.5, 0.2, 0])
    assert worlds.position("a").shape == (3, 3)


def test_bodies_say_where_they_are_and_what_is_touched_of_them():
    """A soft one as its middle moved, and its surface."""
    lies = Pose.xyz_rpy((0.4, 0, 0.2), (0, 0, 1))
    cloth = Soft.make(
        "b", Cloth((0.1, 0.2)), Elastic(300.0, 1e5), lies, color=(1.0, 0.0, 0.0, 1.0)
    )
    box = Body.of("a", Box((0.1,) * 3), (0.3, 0, 0.1), mass=0.1, color=RED)
    mark = Body.mark("goal", (0.5, 0.2, 0), 0.1, RED)
    found = Scene((cloth, box, mark)).complete(state(0))
    assert box.pose_in(found) == found.pose("a")
    assert mark.pose_in(found) == mark.pose
    moved = cloth.pose_in(found)
    np.testing.assert_allclose(
        moved.position - lies.position, found.position("b") - cloth.center
    )
    assert moved.rotation_matrix == pytest.approx(lies.rotation_matrix)
    touched = [len(body.touched) for body in (cloth, box, mark)]
    assert touched == [1, 1, 0]


def test_a_body_that_the_state_does_not_speak_of():
    with pytest.raises(
        KeyError, match="no body 'c' that moves in the state; there are: a, b"
    ):
        state(0).position("c")
