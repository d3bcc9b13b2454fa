import numpy as np
import pytest

from core.design import Component, Tool
from core.geometry import Box, Pose
from core.interfaces import Recording
from core.plugins import installed
from core.robot.kinematics import arm_of
from plugins.results.workshop.clearance import NEAR_M, clearance, payload, torques
from plugins.results.workshop.motion import Sampled
from tests.support.panda import PANDA
from tests.support.workshop_tools import post

HOME = np.array(PANDA.home)


def still(count=3):
    rows = np.tile(HOME, (count, 1))
    return Sampled(
        np.arange(count) / 100, rows, 0 * rows, 0 * rows, np.full(count, 0.04)
    )


@pytest.mark.parametrize("length", [0.2, 0.35])
def test_a_post_hangs_as_far_above_the_table_as_it_is_short(length):
    task = installed().create("task", "MoveBall")
    scene = task.scene(0)
    count = 3
    state = scene.state()
    states = type(state).stack([state] * count)
    recording = Recording(
        np.arange(count) / 25, np.tile(HOME, (count, 1)), np.zeros((count, 0)), states
    )
    rows = clearance(scene, PANDA, post(length), recording)
    found = {(row.what, row.to): row.metres for row in rows}
    height = arm_of(PANDA).forward(HOME).position[2]
    assert found["tool", "table"] == pytest.approx(
        min(height - length, NEAR_M), abs=2e-3
    )
    assert found["arm", "itself"] > 0
    assert {what for what, _ in found} == {"arm", "tool"}


def test_torques_of_an_arm_at_rest_are_those_of_weights():
    bare, laden = (
        torques(PANDA, tool, still())[0] for tool in (Tool(), post(0.2, 2.0))
    )
    arm = arm_of(PANDA)
    q = HOME.copy()
    step = 1e-4
    for joint in (1, 3, 5):
        ends = []
        for sign in (-1, 1):
            q = HOME.copy()
            q[joint] += sign * step
            ends.append(arm.forward(q).apply(np.array([0, 0, -0.1]))[2])
        # Virtual work: how the weight rises with the joint.
        lever = (ends[1] - ends[0]) / (2 * step)
        assert laden[joint] - bare[joint] == pytest.approx(
            2 * 9.81 * lever, rel=0.01, abs=0.02
        )


def test_a_box_below_the_flange():
    pose = Pose.xyz_rpy((0.0, 0.0, -0.1))
    box = Component("box", "tool_mount", pose, Box((0.1, 0.1, 0.2)), mass=2.0)
    found = payload(PANDA, Tool((box,)))
    assert found["frame"] == "panda_link8"
    assert found["mass_kg"] == pytest.approx(2.0)
    # The flange's z points out, the mount's in.
    assert found["center_m"] == pytest.approx([0, 0, 0.1], abs=1e-6)
    assert np.diag(found["inertia_kg_m2"]) == pytest.approx(
        [2 / 12 * 0.05, 2 / 12 * 0.05, 2 / 12 * 0.02], rel=1e-6
    )
    assert found["share_of_payload"] == pytest.approx(2 / 3, rel=1e-4)
