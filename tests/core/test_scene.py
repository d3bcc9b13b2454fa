import math

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from core.geometry import Box, Cylinder, Mesh, Pose, Sphere
from core.scene import Body, Geom, Scene, State, floor, table

RED = (1, 0, 0, 1)


def box_moments(mass, x, y, z):
    return mass / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])


def compound(*parts, mass=1.0, pose=None):
    return Body("compound", pose or Pose(), mass, (), parts)


def tensor(inertia):
    """About the centre of mass, along the body's axes."""
    axes = inertia.frame.rotation.as_matrix()
    return axes @ np.diag(inertia.moments) @ axes.T


# --- inertia ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shape", "moments", "tolerance"),
    [
        (Box((0.1, 0.2, 0.3)), box_moments(2, 0.1, 0.2, 0.3), 1e-9),
        (Sphere(0.2), np.full(3, 2 / 5 * 2 * 0.2**2), 0.01),
        (Cylinder(0.1, 0.4), 2 * np.array([0.01 / 4 + 0.16 / 12, 0.01 / 4 + 0.16 / 12, 0.01 / 2]), 0.01),
    ],
)
def test_inertia_of_a_shape(shape, moments, tolerance):
    inertia = Body.of("body", shape, (3, 4, 5), mass=2, color=RED, rpy=(1, 2, 3)).inertia()
    assert inertia.mass == 2
    np.testing.assert_allclose(inertia.frame.position, 0, atol=1e-9)
    np.testing.assert_allclose(tensor(inertia), np.diag(moments), rtol=tolerance, atol=tolerance * moments.max())


def test_inertia_of_two_boxes_by_the_parallel_axis_theorem():
    sizes, at = ((0.4, 0.1, 0.1), (0.1, 0.1, 0.2)), np.array([[0.2, 0, 0], [0.05, 0, 0.15]])
    masses = 3 * np.array([math.prod(size) for size in sizes]) / sum(math.prod(size) for size in sizes)
    centre = masses @ at / 3
    expected = np.zeros((3, 3))
    for size, mass, place in zip(sizes, masses, at, strict=True):
        arm = place - centre
        expected += np.diag(box_moments(mass, *size)) + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))

    parts = [Geom(Box(size), Pose(place)) for size, place in zip(sizes, at, strict=True)]
    inertia = compound(*parts, mass=3).inertia()
    np.testing.assert_allclose(inertia.frame.position, centre, atol=1e-12)
    np.testing.assert_allclose(tensor(inertia), expected, rtol=1e-9, atol=1e-12)
    assert np.abs(expected[0, 2]) > 1e-4  # the axes are tilted: the eigenvectors count


@given(st.tuples(*[st.floats(-3, 3)] * 3))
def test_a_turned_part_has_turned_principal_axes(rpy):
    pose = Pose.xyz_rpy((0.1, -0.2, 0.3), rpy)
    inertia = compound(Geom(Box((0.1, 0.2, 0.3)), pose), mass=2).inertia()
    axes = pose.rotation.as_matrix()
    np.testing.assert_allclose(tensor(inertia), axes @ np.diag(box_moments(2, 0.1, 0.2, 0.3)) @ axes.T, atol=1e-9)
    np.testing.assert_allclose(inertia.frame.position, pose.position, atol=1e-9)
    assert sorted(inertia.moments) == pytest.approx(sorted(box_moments(2, 0.1, 0.2, 0.3)))


def test_a_mesh_weighs_as_its_convex_hull():
    shell = trimesh.creation.box((0.1, 0.2, 0.3))
    hollow = trimesh.util.concatenate([shell, trimesh.creation.box((0.05, 0.1, 0.15))])
    inertia = compound(Geom(Mesh.from_trimesh(hollow)), mass=2).inertia()
    np.testing.assert_allclose(tensor(inertia), np.diag(box_moments(2, 0.1, 0.2, 0.3)), atol=1e-9)


# --- bodies and scenes ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mass", [-1, math.nan, math.inf])
def test_masses_that_are_none(mass):
    with pytest.raises(ValueError, match="body 'cube': the mass must be 0"):
        Body.of("cube", Box((1, 1, 1)), (0, 0, 0), mass=mass, color=RED)


def test_a_body_that_moves_can_be_felt():
    with pytest.raises(ValueError, match=r"body 'ghost'.* needs collision parts"):
        Body("ghost", Pose(), 1.0, (Geom(Box((1, 1, 1))),), ())


def test_a_mark_is_seen_and_not_felt():
    mark = Body.mark("mark", (1, 2, 0), 0.05, RED)
    assert mark.fixed
    assert not mark.collisions
    (disc,) = mark.visuals
    low = (mark.pose @ disc.pose).position[2] - disc.shape.length / 2
    assert low == pytest.approx(0)  # on the table, not in it
    assert disc.shape.radius == 0.05


def test_names_taken_twice():
    cube = Body.of("cube", Box((1, 1, 1)), (0, 0, 0), mass=1, color=RED)
    with pytest.raises(ValueError, match="two bodies in the scene have the same name: cube, table"):
        Scene((cube, table(), cube, table(), floor()))


def test_bodies_by_name():
    scene = Scene((table(), Body.of("cube", Box((1, 1, 1)), (0, 0, 0), mass=1, color=RED)))
    assert scene["cube"].mass == 1
    with pytest.raises(KeyError, match="no body 'ball' in the scene; there are: table, cube"):
        scene["ball"]


def test_the_table_has_its_top_at_zero():
    top, low = [], []
    for part in table().collisions:
        corners = (table().pose @ part.pose).apply(np.asarray(part.shape.to_trimesh().vertices))
        top.append(corners.max(axis=0))
        low.append(corners.min(axis=0))
    np.testing.assert_allclose(np.max(top, axis=0), [1.35, 0.5, 0])
    np.testing.assert_allclose(np.min(low, axis=0), [-0.15, -0.5, -0.625])


# --- states -----------------------------------------------------------------------------------------------------


def state(seed, names=("a", "b")):
    rng = np.random.default_rng(seed)
    count = len(names)
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    return State(names, rng.normal(size=(count, 3)), quaternions, *rng.normal(size=(2, count, 3)))


def test_a_scene_as_placed_is_a_state_of_its_free_bodies_at_rest():
    cube = Body.of("cube", Box((1, 1, 1)), (1, 2, 3), mass=1, color=RED, rpy=(0.1, 0.2, 0.3))
    ball = Body.of("ball", Sphere(1), (4, 5, 6), mass=1, color=RED)
    found = Scene((table(), cube, floor(), ball)).state()
    assert found.names == ("cube", "ball")
    assert found.pose("cube") == cube.pose
    assert found.position("ball").tolist() == [4, 5, 6]
    assert not found.linear_velocities.any()
    assert not found.angular_velocities.any()
    assert Scene((table(),)).state().positions.shape == (0, 3)


def test_stacked_states_are_worlds_along_a_new_first_axis():
    states = [state(seed) for seed in range(3)]
    worlds = State.stack(states)
    assert worlds.positions.shape == (3, 2, 3)
    assert worlds.quaternions.shape == (3, 2, 4)
    for i, one in enumerate(states):
        assert worlds[i].names == ("a", "b")
        np.testing.assert_array_equal(worlds[i].positions, one.positions)
        np.testing.assert_array_equal(worlds[i].quaternions, one.quaternions)
        np.testing.assert_array_equal(worlds[i].linear_velocities, one.linear_velocities)
        np.testing.assert_array_equal(worlds[i].angular_velocities, one.angular_velocities)
        np.testing.assert_array_equal(worlds.position("b")[i], one.positions[1])
        np.testing.assert_array_equal(worlds.quaternion("b")[i], one.quaternions[1])
        np.testing.assert_array_equal(worlds.linear_velocity("a")[i], one.linear_velocities[0])


def test_states_of_other_bodies_cannot_be_stacked():
    for states in ([state(0), state(0, ("b", "a"))], []):
        with pytest.raises(ValueError, match="same bodies"):
            State.stack(states)


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


def test_a_body_that_the_state_does_not_speak_of():
    with pytest.raises(KeyError, match="no body 'c' that moves in the state; there are: a, b"):
        state(0).position("c")
