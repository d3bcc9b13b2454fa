import numpy as np
import pytest

from core.design import Component, Tool
from core.geometry import Box, Pose
from plugins.results.workshop.payload import payload
from tests.panda import PANDA


def test_a_box_below_the_flange():
    pose = Pose(np.array([0.0, 0.0, -0.1]))
    box = Component("box", "tool_mount", pose, Box((0.1, 0.1, 0.2)), mass=2.0)
    found = payload(PANDA, Tool((box,)))
    assert found["frame"] == "panda_link8"
    assert found["mass_kg"] == pytest.approx(2.0)
    assert found["center_m"] == pytest.approx([0, 0, 0.1], abs=1e-6)  # the flange's z points out, the mount's in
    assert np.diag(found["inertia_kg_m2"]) == pytest.approx([2 / 12 * 0.05, 2 / 12 * 0.05, 2 / 12 * 0.02], rel=1e-6)
    assert found["moment_nm"] == pytest.approx(2 * 9.80665 * 0.1, rel=1e-4)
    assert found["share_of_payload"] == pytest.approx(2 / 3, rel=1e-4)
