"""The inertia of bodies, against handbooks and the parallel axis theorem."""

import math

import numpy as np
import pytest
import trimesh

from core.geometry import Box, Cylinder, Mesh, Pose, Sphere
from core.scene import Body, Geom
from plugins.simulators.inertia import inertia_of

RED = (1, 0, 0, 1)


def box_moments(mass, x, y, z):
    return mass / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])


def compound(*parts, mass=1.0, pose=None):
    return Body("compound", pose or Pose(), mass, (), parts)


def tensor(inertia):
    """About the centre of mass, along the body's axes."""
    axes = inertia.frame.rotation.as_matrix()
    return axes @ np.diag(inertia.moments) @ axes.T


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
    body = Body.of("body", shape, (3, 4, 5), mass=2, color=RED, rpy=(1, 2, 3))
    inertia = inertia_of(body)
    assert inertia.mass == 2
    assert inertia.frame == Pose()  # to the last bit: engines convert other frames
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
    inertia = inertia_of(compound(*parts, mass=3))
    np.testing.assert_allclose(inertia.frame.position, centre, atol=1e-12)
    np.testing.assert_allclose(tensor(inertia), expected, rtol=1e-9, atol=1e-12)
    assert np.abs(expected[0, 2]) > 1e-4  # the axes are tilted: the eigenvectors count


def test_a_mesh_weighs_as_its_convex_hull():
    shell = trimesh.creation.box((0.1, 0.2, 0.3))
    hollow = trimesh.util.concatenate([shell, trimesh.creation.box((0.05, 0.1, 0.15))])
    inertia = inertia_of(compound(Geom(Mesh.from_trimesh(hollow)), mass=2))
    np.testing.assert_allclose(
        tensor(inertia), np.diag(box_moments(2, 0.1, 0.2, 0.3)), atol=1e-9
    )
