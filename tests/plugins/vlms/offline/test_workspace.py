"""The embedded designer knows an arm by its data: where it stands, and how far it reaches."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Pose
from plugins.vlms.offline.workspace import compute_workspace
from tests.panda import PANDA


def test_it_moves_with_the_base():
    base = Pose.xyz_rpy((1.0, 0.5, 0.2), (0.0, 0.0, np.pi))
    here, there = compute_workspace(PANDA), compute_workspace(replace(PANDA, base=base))
    assert (here.inner, here.outer, here.stretch) == (
        there.inner,
        there.outer,
        there.stretch,
    )
    points = np.random.default_rng(0).uniform(
        (-0.7, -0.7, 0.2), (0.7, 0.7, 1.6), (20, 3)
    )
    for point in points:
        assert there.excess(base.apply(point)[None]) == pytest.approx(
            here.excess(point[None])
        )
    assert there.direction(np.array([1.0, 1.0, 0.0])) == pytest.approx(np.pi / 2)
