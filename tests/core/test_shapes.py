import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.geometry import Box, Capsule, Compound, Cylinder, Sphere, resized
from tests.shapes import bowl, prism

ROUND = [Sphere(0.1), Cylinder(0.05, 0.3), Capsule(0.05, 0.3)]
SHAPES = [Box((0.1, 0.2, 0.3)), *ROUND, prism(7, 0.1, 0.2), bowl(0.1, 0.01)]
sides = st.floats(0.01, 1.0)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_a_shape_of_its_own_size_stays_the_same(shape):
    again = resized(shape, shape.bounds[1])
    assert type(again) is type(shape)
    np.testing.assert_allclose(again.bounds, shape.bounds, atol=1e-12)
    assert again.volume == pytest.approx(shape.volume)


@given(
    st.tuples(sides, sides, sides),
    st.sampled_from([Box((1, 1, 1)), prism(7, 0.1, 0.2), bowl(0.1, 0.01)]),
)
def test_boxes_and_meshes_get_the_sides_and_keep_their_middle(size, shape):
    changed = resized(shape, size)
    np.testing.assert_allclose(changed.bounds[1], size)
    np.testing.assert_allclose(changed.bounds[0], shape.bounds[0], atol=1e-12)
    if isinstance(changed, Compound):
        points = np.concatenate([part.vertices for part in changed.parts])
        np.testing.assert_allclose(np.ptp(points, axis=0), size)


@pytest.mark.parametrize("shape", ROUND, ids=lambda shape: type(shape).__name__)
def test_what_is_round_stays_round(shape):
    changed = resized(shape, (0.1, 0.3, 0.6))
    assert type(changed) is type(shape)
    width = changed.bounds[1]
    assert (
        width[0]
        == width[1]
        == pytest.approx(1 / 3 if isinstance(shape, Sphere) else 0.2)
    )
    assert isinstance(shape, Sphere) or width[2] == pytest.approx(0.6)


def test_a_capsule_is_at_least_its_ends():
    assert resized(Capsule(0.1, 0.1), (0.2, 0.2, 0.1)).length > 0
