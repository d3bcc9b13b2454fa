"""Which solids may meet in which intervals, against Coal."""

import numpy as np
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Box, Cylinder, Mesh, Sphere
from core.scene import Scene
from core.solids.near_pairs import may_meet
from core.solids.tracks import Pair, follow
from tests.support.panda import PANDA
from tests.support.recordings import body, recording, straight

HULL = Mesh.from_trimesh(
    trimesh.creation.icosphere(subdivisions=1, radius=0.05).apply_scale([2.0, 1.0, 0.5])
)
SHAPES = [
    Box((0.1, 0.02, 0.3)),
    Box((0.2, 0.2, 0.001)),
    Sphere(0.05),
    Cylinder(0.05, 0.1),
    Cylinder(0.1, 0.01),
]


def tracks(one, other, turns, paths):
    """The tracks of all solids; the last two are the bodies'."""
    scene = Scene(
        (body("one", one, paths["one"][0]), body("other", other, paths["other"][0]))
    )
    return follow(scene, PANDA, Tool(), recording(scene, paths, quaternions=turns))


def may(both, least, count):
    pair = np.array([[len(both.items) - 2, len(both.items) - 1]])
    (found,) = may_meet(
        both, pair, np.array([least]), np.ones((1, count - 1), dtype=bool)
    )
    return found


@given(
    one=st.sampled_from([*SHAPES, HULL]),
    other=st.sampled_from([*SHAPES, HULL]),
    seed=st.integers(0, 2**32 - 1),
)
def test_solids_do_not_meet_where_they_may_not(one, other, seed):
    """At ten instants between samples, of motions of some 5 cm and 30 degrees from one to the next."""
    random = np.random.default_rng(seed)
    count = 12
    least = (
        random.choice([0.0, 0.002, 0.01])
        if isinstance(one, Box) and isinstance(other, Box)
        else 0.0
    )
    paths, turns = {}, {}
    for name in ("one", "other"):
        paths[name] = np.cumsum(
            random.normal(0, 0.03, (count, 3)), axis=0
        ) + random.uniform(-0.1, 0.1, 3)
        steps = Rotation.from_rotvec(random.normal(0, 0.3, (count, 3)))
        turning = [Rotation.random(rng=random)]
        for step in steps:
            turning.append(step * turning[-1])
        turns[name] = Rotation.concatenate(turning[1:]).as_quat(scalar_first=True)
    both = tracks(one, other, turns, paths)
    *_, a, b = both.items
    for k in np.flatnonzero(~may(both, least, count)).tolist():
        for share in np.linspace(0.0, 1.0, 10, endpoint=False).tolist():
            assert Pair(a, b).look(k + share).depth <= least + 1e-6


def test_what_slides_along_a_surface_does_not_come_nearer():
    paths = {
        "one": straight((-0.3, 0.0, 0.02), (0.3, 0.0, 0.02), 8),
        "other": np.zeros((8, 3)),
    }
    both = tracks(Box((0.1, 0.1, 0.02)), Box((1.0, 1.0, 0.02)), {}, paths)
    assert not may(both, 0.001, 8).any()
    assert may(both, 0.0, 8).all()
