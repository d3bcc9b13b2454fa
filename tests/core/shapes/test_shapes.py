import math
from dataclasses import dataclass

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from core.geometry import Box, Capsule, Compound, Cylinder, Mesh, Primitive, Sphere
from tests.support.shapes import SAMPLES, bowl, prism, within

ROUND = [Sphere(0.1), Cylinder(0.05, 0.3), Capsule(0.05, 0.3)]
SHAPES = [
    *(Box((0.1, 0.2, 0.3)), *ROUND, prism(7, 0.1, 0.2), bowl(0.1, 0.01)),
    *SAMPLES,
]
sides = st.floats(0.01, 1.0)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_a_shape_of_its_own_size_stays_the_same(shape):
    again = shape.resized(shape.bounds[1])
    assert type(again) is type(shape)
    np.testing.assert_allclose(again.bounds, shape.bounds, atol=1e-12)
    assert again.volume == pytest.approx(shape.volume)


@given(
    st.tuples(sides, sides, sides),
    st.sampled_from([Box((1, 1, 1)), prism(7, 0.1, 0.2), bowl(0.1, 0.01)]),
)
def test_boxes_and_meshes_get_the_sides_and_keep_their_middle(size, shape):
    changed = shape.resized(size)
    np.testing.assert_allclose(changed.bounds[1], size)
    np.testing.assert_allclose(changed.bounds[0], shape.bounds[0], atol=1e-12)
    if isinstance(changed, Compound):
        points = np.concatenate([part.vertices for part in changed.parts])
        np.testing.assert_allclose(np.ptp(points, axis=0), size)


@pytest.mark.parametrize("shape", ROUND, ids=lambda shape: type(shape).__name__)
def test_what_is_round_stays_round(shape):
    changed = shape.resized((0.1, 0.3, 0.6))
    assert type(changed) is type(shape)
    width = changed.bounds[1]
    assert (
        width[0]
        == width[1]
        == pytest.approx(1 / 3 if isinstance(shape, Sphere) else 0.2)
    )
    assert isinstance(shape, Sphere) or width[2] == pytest.approx(0.6)


def test_a_capsule_is_at_least_its_ends():
    assert Capsule(0.1, 0.1).resized((0.2, 0.2, 0.1)).length > 0


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_measures_are_those_of_the_triangles(shape):
    """Within what a sphere of triangles lacks."""
    mesh = shape.to_trimesh()
    assert mesh.is_volume
    assert shape.volume == pytest.approx(mesh.volume, rel=0.01)
    assert shape.area == pytest.approx(mesh.area, rel=0.01)
    middle, size = shape.bounds
    np.testing.assert_allclose(
        [middle - size / 2, middle + size / 2], mesh.bounds, atol=1e-9
    )
    center, tensor = shape.inertia(2.0)
    np.testing.assert_allclose(center, mesh.center_mass, atol=1e-9)
    np.testing.assert_allclose(
        tensor, 2.0 * mesh.moment_inertia / mesh.volume, rtol=0.01, atol=1e-6
    )
    ways = np.random.default_rng(0).normal(size=(50, 3))
    for way in ways / np.linalg.norm(ways, axis=1)[:, None]:
        reach = (mesh.vertices @ way).max()
        assert shape.extent(way) == pytest.approx(reach, rel=0.01, abs=1e-4)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_what_collides_fills_the_shape(shape):
    mesh = shape.to_trimesh()
    points = np.random.default_rng(0).uniform(*mesh.bounds, size=(2000, 3))
    hulls = [part.hull() for part in shape.convex_parts()]
    filled = np.any([within(hull, points) for hull in hulls], axis=0)
    assert np.mean(filled != within(mesh, points)) < 0.03


@pytest.mark.parametrize("shape", SAMPLES, ids=lambda shape: shape.kind)
def test_a_kind_of_shape_is_made_of_its_numbers(shape):
    assert type(shape).of(*shape.numbers) == shape
    half = shape.scaled(0.5)
    assert half.numbers == tuple(number / 2 for number in shape.numbers)
    assert half.volume == pytest.approx(shape.volume / 8)


@dataclass(frozen=True)
class Cone(Primitive):
    """A kind that gives its triangles, and no more."""

    kind = "cone"
    wording = " with `radius` and `height`"
    means = "A cone along its z"

    radius: float
    height: float

    def to_trimesh(self):
        return trimesh.creation.cone(self.radius, self.height)


def test_a_kind_that_gives_its_triangles_is_a_hull_of_them():
    cone = Cone(0.03, 0.06)
    assert cone.urdf_parts() == ((cone.triangles, None),)
    assert cone.volume == pytest.approx(math.pi * 0.03**2 * 0.02, rel=0.02)
    assert cone.bounds[0] == pytest.approx((0, 0, 0.03))
    # Contacts with a hull count from farther.
    assert cone.is_hull
    assert not any(shape.is_hull for shape in ROUND)


@pytest.mark.parametrize("length", [0, -1, math.nan, math.inf])
@pytest.mark.parametrize(
    ("shape", "name"),
    [
        (lambda x: Box((x, 1, 1)), "x"),
        (lambda x: Box((1, 1, x)), "z"),
        (lambda x: Sphere(x), "radius"),
        (lambda x: Cylinder(x, 1), "radius"),
        (lambda x: Cylinder(1, x), "length"),
    ],
)
def test_what_is_no_shape(shape, name, length):
    with pytest.raises(ValueError, match=f": {name} must be a positive length"):
        shape(length)


@pytest.mark.parametrize(
    ("vertices", "faces", "reason"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]], r"vertices \(V, 3\)"),
        (np.zeros((3, 3)), [[0, 1]], r"faces \(F, 3\)"),
        (np.zeros((3, 3)), [[0, 1, 3]], "of their numbers"),
        (np.zeros((3, 3)), [[0, 1, -1]], "of their numbers"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "finite"),
    ],
)
def test_what_is_no_mesh(vertices, faces, reason):
    with pytest.raises(ValueError, match=reason):
        Mesh(vertices, faces)
