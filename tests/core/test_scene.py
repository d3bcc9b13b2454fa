import math

import numpy as np
import pytest
import trimesh

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
        (
            Cylinder(0.1, 0.4),
            2 * np.array([0.01 / 4 + 0.16 / 12, 0.01 / 4 + 0.16 / 12, 0.01 / 2]),
            0.01,
        ),
    ],
)
def test_inertia_of_a_shape(shape, moments, tolerance):
    inertia = Body.of(
        "body", shape, (3, 4, 5), mass=2, color=RED, rpy=(1, 2, 3)
    ).inertia()
    assert inertia.mass == 2
    np.testing.assert_allclose(inertia.frame.position, 0, atol=1e-9)
    np.testing.assert_allclose(
        tensor(inertia),
        np.diag(moments),
        rtol=tolerance,
        atol=tolerance * moments.max(),
    )


def test_inertia_of_two_boxes_by_the_parallel_axis_theorem():
    sizes, at = (
        ((0.4, 0.1, 0.1), (0.1, 0.1, 0.2)),
        np.array([[0.2, 0, 0], [0.05, 0, 0.15]]),
    )
    masses = (
        3
        * np.array([math.prod(size) for size in sizes])
        / sum(math.prod(size) for size in sizes)
    )
    centre = masses @ at / 3
    expected = np.zeros((3, 3))
    for size, mass, place in zip(sizes, masses, at, strict=True):
        arm = place - centre
        expected += np.diag(box_moments(mass, *size)) + mass * (
            arm @ arm * np.eye(3) - np.outer(arm, arm)
        )

    parts = [
        Geom(Box(size), Pose(place)) for size, place in zip(sizes, at, strict=True)
    ]
    inertia = compound(*parts, mass=3).inertia()
    np.testing.assert_allclose(inertia.frame.position, centre, atol=1e-12)
    np.testing.assert_allclose(tensor(inertia), expected, rtol=1e-9, atol=1e-12)
    assert np.abs(expected[0, 2]) > 1e-4  # the axes are tilted: the eigenvectors count


def test_a_mesh_weighs_as_its_convex_hull():
    shell = trimesh.creation.box((0.1, 0.2, 0.3))
    hollow = trimesh.util.concatenate([shell, trimesh.creation.box((0.05, 0.1, 0.15))])
    inertia = compound(Geom(Mesh.from_trimesh(hollow)), mass=2).inertia()
    np.testing.assert_allclose(
        tensor(inertia), np.diag(box_moments(2, 0.1, 0.2, 0.3)), atol=1e-9
    )


# --- bodies and scenes ------------------------------------------------------------------------------------------


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


def test_a_body_that_the_state_does_not_speak_of():
    with pytest.raises(
        KeyError, match="no body 'c' that moves in the state; there are: a, b"
    ):
        state(0).position("c")
