import numpy as np
import pytest
import trimesh

from core.geometry import Box, Cylinder, Mesh, Sphere
from core.robot.solids import Obstacles, body_solids, robot_solids, signed_distance
from core.scene import Body
from plugins.tools.solids.making import farthest_from_surface
from tests.support.panda import PANDA

CUBE = Box((1, 1, 1))


def solid(shape, *at):
    body = Body.of("body", shape, at, mass=1.0, color=(1, 1, 1, 1))
    (found,) = body_solids(body)
    return found


@pytest.mark.parametrize(
    ("shape", "distance"),
    [(Sphere(0.5), 1.0), (Box((1, 2, 3)), 1.0), (Cylinder(0.5, 3.0), 1.0)],
)
def test_distances_are_negative_where_solids_overlap(shape, distance):
    assert signed_distance(
        solid(shape, 0, 0, 0), solid(CUBE, 2, 0, 0)
    ) == pytest.approx(distance, abs=1e-4)
    assert signed_distance(
        solid(shape, 0, 0, 0), solid(CUBE, 0.9, 0, 0)
    ) == pytest.approx(-0.1, abs=1e-4)


def test_a_mesh_counts_as_its_convex_hull():
    walls = [
        trimesh.creation.box(
            (0.2, 1, 1), trimesh.transformations.translation_matrix((x, 0, 0))
        )
        for x in (0, 1)
    ]
    both = trimesh.util.concatenate(walls)
    middle = solid(Sphere(0.1), 0.5, 0, 0)
    assert signed_distance(solid(Mesh(both.vertices, both.faces), 0, 0, 0), middle) < 0


def test_near_solids_are_selected_by_their_bounds():
    leaning = Body.of(
        "rod",
        Box((2, 0.1, 0.1)),
        (0, 0, 1),
        mass=1.0,
        color=(1, 1, 1, 1),
        rpy=(0, np.pi / 4, 0),
    )
    (rod,) = body_solids(leaning)
    center, half = rod.bounds()
    np.testing.assert_allclose(center, [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(
        half, [1.05 / np.sqrt(2), 0.05, 1.05 / np.sqrt(2)], atol=1e-9
    )
    solids = Obstacles([rod, solid(CUBE, 5, 0, 0)])
    ball = solid(Sphere(0.1), 0, 0.2, 1)
    assert list(solids.near(ball, margin=0.06)) == [rod]
    assert list(solids.near(ball, margin=0.04)) == []


def test_the_robots_solids_are_those_of_its_description():
    arm, with_gripper = (
        {one.name for one in robot_solids(PANDA, gripper)} for gripper in (False, True)
    )
    assert {f"panda_link{number}" for number in range(8)} <= arm
    assert {"left_finger", "right_finger"} <= with_gripper


def test_the_farthest_point_from_a_surface():
    cube = trimesh.creation.box((2.0, 2.0, 2.0))
    points = np.array([[0.0, 0.0, 0.9], [3.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    assert farthest_from_surface(points, cube.vertices, cube.faces) == pytest.approx(
        2.0
    )
    assert farthest_from_surface(
        points[2:], cube.vertices, cube.faces
    ) == pytest.approx(0.5)  # inside, too
