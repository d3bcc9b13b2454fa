"""The embedded designer knows an arm by its data: where it stands, and how far it reaches."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Pose
from plugins.vlms.offline.workspace import workspace_of
from tests.panda import PANDA


def test_it_moves_with_the_base():
    base = Pose.xyz_rpy((1.0, 0.5, 0.2), (0.0, 0.0, np.pi))
    here, there = workspace_of(PANDA), workspace_of(replace(PANDA, base=base))
    assert (here.inner, here.outer, here.stretch) == (
        there.inner,
        there.outer,
        there.stretch,
    )
    points = np.random.default_rng(0).uniform(
        (-0.7, -0.7, 0.2), (0.7, 0.7, 1.6), (20, 3)
    )
    for point in points:
        assert there.strain(base.apply(point)[None]) == pytest.approx(
            here.strain(point[None])
        )
    assert there.direction(np.array([1.0, 1.0, 0.0])) == pytest.approx(np.pi / 2)
