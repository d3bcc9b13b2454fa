"""The depth of each two shapes in each other is the shortest way out, as sampled directions have it.

Along any direction two solids part after as far as both extend along it. So no direction may lead out sooner than the
depth says, in any pose. Along the direction that comes with it they must part after just that depth: Coal ends its
search too early in about one of 1,000 poses.
"""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from core.geometry import Box, Capsule, Cylinder, Mesh, Pose, Sphere
from core.robot.solids import Solid, contact, solid_geometry
from tests.support.rare import rare
from tests.support.shapes import prism

LEAST_M = 0.002
MOST_M = 0.1
EXACT_M = 1e-5
ROUND_M = 1e-4  # at round rims, along the direction that comes with a depth
EARLY = 0.002  # the share of poses in which Coal may end too early
DIRECTIONS = 300
KINDS = ("box", "sphere", "cylinder", "capsule", "mesh")
PAIRS = list(combinations_with_replacement(KINDS, 2))


def draw(kind, rng):
    """Draw a shape whose sides are thin or thick."""
    x, y, z = np.exp(rng.uniform(np.log(LEAST_M), np.log(MOST_M), 3)).tolist()

    match kind:
        case "box":
            return Box((x, y, z))
        case "sphere":
            return Sphere(x)
        case "cylinder":
            return Cylinder(x, y)
        case "capsule":
            return Capsule(x, y)

    return prism(int(rng.integers(3, 9)), x, y)


def reach(shape, directions):
    """How far a shape extends along directions (N, 3) in its frame."""
    x, y, z = np.abs(directions).T

    match shape:
        case Box(size):
            return np.abs(directions) @ np.divide(size, 2)
        case Sphere(radius):
            return np.full(len(directions), radius)
        case Cylinder(radius, length):
            return radius * np.hypot(x, y) + length / 2 * z
        case Capsule(radius, length):
            return radius + length / 2 * z
        case Mesh():
            return (directions @ shape.vertices.T).max(axis=1)


def own_directions(shape):
    """The directions in which a shape has sides."""
    sides = np.eye(3)
    if isinstance(shape, Mesh):
        sides = shape.to_trimesh().face_normals
    return np.concatenate([sides, -sides])


def sample(rng):
    directions = rng.normal(size=(DIRECTIONS, 3))
    return directions / np.linalg.norm(directions, axis=1)[:, None]


def find_faults(kinds, shapes, poses, seed):
    """Measure pairs of shapes in many poses; return which depths are too large, and which may be too small."""
    rng = np.random.default_rng(seed)
    deeper = []
    early = []
    overlapping = 0

    for _ in range(shapes):
        first, second = (draw(kind, rng) for kind in kinds)
        geometries = solid_geometry(first), solid_geometry(second)
        still = Solid("second", geometries[1], Pose(), second)
        spread = [max(first.bounds[1]) + max(side, 0.01) for side in second.bounds[1]]

        for turn in Rotation.random(poses, random_state=rng):
            place = rng.uniform(-0.5, 0.5, 3) * spread
            moved = Solid(
                "first", geometries[0], Pose.from_rotation(place, turn), first
            )
            gap, _, away = contact(still, moved)
            back = turn.as_matrix()
            length = np.linalg.norm(place) or 1.0
            ways = [
                sample(rng),
                own_directions(first) @ back.T,
                own_directions(second),
                [place / length, away],
            ]
            ways = np.concatenate(ways)
            needed = reach(first, -ways @ back) + reach(second, ways) - ways @ place

            if gap >= 0:
                if needed.min() < -EXACT_M - gap:
                    deeper.append(f"{first} {second} {place}: {gap} apart")
                continue

            overlapping += 1
            depth = f"{first}, {second}: {-gap:.6f} m, but"
            if needed.min() < -gap - EXACT_M:
                deeper.append(f"{depth} out after {needed.min():.6f} m")
            if abs(needed[-1] + gap) > ROUND_M:
                early.append(f"{depth} {needed[-1]:.6f} m along its way out")

    assert overlapping > shapes * poses / 20
    return deeper, early


@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_a_depth_is_the_shortest_way_out(kinds):
    deeper, early = find_faults(kinds, shapes=10, poses=10, seed=0)
    assert deeper == []
    assert len(early) <= 1


@pytest.mark.thorough
@pytest.mark.parametrize("shapes", rare([40, 200], 40, mark="weekly"))
@pytest.mark.parametrize("kinds", PAIRS, ids="-".join)
def test_a_depth_is_the_shortest_way_out_in_thousands_of_poses(kinds, shapes):
    deeper, early = find_faults(kinds, shapes=shapes, poses=50, seed=1)
    assert deeper == []
    assert len(early) <= EARLY * shapes * 50


@pytest.mark.parametrize("depth", [0.001, 0.004, 0.007, 0.009])
def test_a_ball_in_a_disc_comes_out_through_the_near_end(depth):
    """The floor of a cup, and a grain that is pressed into it."""
    disc = Solid("disc", solid_geometry(Cylinder(0.046, 0.01)), Pose())
    middle = Pose.xyz_rpy((0.02, 0.01, 0.005 + 0.007 - depth))
    ball = Solid("ball", solid_geometry(Sphere(0.007)), middle)
    gap, _, away = contact(disc, ball)

    assert gap == pytest.approx(-depth, abs=1e-6)
    assert away == pytest.approx([0, 0, 1], abs=1e-4)
