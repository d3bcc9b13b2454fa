"""Bounds of the gaps between solids, against Coal."""

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from core.geometry import Box, Cylinder, Mesh, Sphere
from core.scene import Scene
from core.simulation.gaps import gap_bounds
from core.simulation.tracks import body_tracks
from tests.core.simulation.test_penetration import body, recording

SHAPES = [Box((0.1, 0.02, 0.3)), Box((0.2, 0.2, 0.001)), Sphere(0.05), Cylinder(0.05, 0.1), Cylinder(0.1, 0.01)]


def tracks(one, other, turns, paths):
    scene = Scene((body("one", one, paths["one"][0]), body("other", other, paths["other"][0])))
    return body_tracks(scene, recording(scene, paths, quaternions=turns))


@given(one=st.sampled_from(SHAPES), other=st.sampled_from(SHAPES), seed=st.integers(0, 2**32 - 1))
def test_no_gap_is_smaller_than_its_bound(one, other, seed):
    random = np.random.default_rng(seed)
    count = 20
    turns = {name: Rotation.random(count, rng=random).as_quat(scalar_first=True) for name in ("one", "other")}
    paths = {"one": random.uniform(-0.2, 0.2, (count, 3)), "other": np.zeros((count, 3))}
    a, b = tracks(one, other, turns, paths)
    bounds = gap_bounds(a, b, np.arange(count))
    distance = coal.ComputeDistance(a.geometry, b.geometry)
    for k, bound in enumerate(bounds):
        result = coal.DistanceResult()
        gap = distance(a.at(k, 0.0)[0], b.at(k, 0.0)[0], coal.DistanceRequest(), result)
        assert bound <= (gap + 1e-6 if gap > 0 else 0.9 * gap)  # how deep round ones are, Coal knows to a few percent


@pytest.mark.parametrize("other", SHAPES)
@pytest.mark.parametrize("one", SHAPES)
def test_side_by_side_they_are_exact(one, other):
    """One above the other, apart and overlapping."""
    heights = np.array([0.5, 0.32])
    paths = {"one": np.array([[0, 0, z] for z in heights]), "other": np.zeros((2, 3))}
    a, b = tracks(one, other, {}, paths)
    half = [
        shape.radius
        if isinstance(shape, Sphere)
        else np.array([*getattr(shape, "size", [shape.__dict__.get("length", 0)])])[-1] / 2
        for shape in (one, other)
    ]
    assert gap_bounds(a, b, np.arange(2)) == pytest.approx(heights - sum(half))


def test_hulls_have_none():
    hull = Mesh.from_trimesh(Box((0.1, 0.1, 0.1)).to_trimesh())
    a, b = tracks(hull, Sphere(0.1), {}, {"one": np.zeros((1, 3)), "other": np.ones((1, 3))})
    assert gap_bounds(a, b, np.arange(1)) is None
