"""What slips between the nodes of a soft solid is a penetration; what presses it is none."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Box, Cylinder, Pose, Sphere
from core.robot.kinematics import arm_of
from core.scene import Elastic, Filling, Scene, Soft
from core.solids.penetration import findings
from tests.support.boxes import LENGTH_M, hanging
from tests.support.panda import PANDA
from tests.support.recordings import recording

ARM = arm_of(PANDA)
SOFT = Elastic(150, 20000)


def play(shape, deep, seconds):
    """Hold a tool's tip so deep in a soft ball for a while."""
    tip = ARM.forward(ARM.home).apply((0.0, 0.0, -LENGTH_M))
    ball = Filling(Sphere(0.05))
    at = tip - [0.0, 0.0, 0.05 - deep]
    soft = Soft.make("ball", ball, SOFT, Pose(at), color=(1, 1, 1, 1))
    scene = Scene((soft,))

    count = round(seconds * 100) + 1
    arms = np.tile(ARM.home, (count, 1))
    paths = {"ball": np.tile(at, (count, 1))}
    seen = recording(scene, paths, hz=100.0, arms=arms)
    nodes = np.repeat((ball.nodes + at)[None], len(seen.times), axis=0)
    states = replace(seen.states, soft={"ball": nodes})
    tool = hanging(shape)

    return [
        finding.text
        for finding in findings(scene, PANDA, tool, replace(seen, states=states))
        if finding.penetration
    ]


@pytest.mark.parametrize(
    "shape",
    [
        Box((0.003, 0.05, LENGTH_M)),
        Box((0.002, 0.002, LENGTH_M)),
        Cylinder(0.001, LENGTH_M),
    ],
    ids=["blade", "needle", "round"],
)
@pytest.mark.parametrize(("deep", "found"), [(0.005, False), (0.02, True)])
def test_a_thin_part_may_press_and_not_cut(shape, deep, found):
    texts = play(shape, deep, seconds=0.5)
    assert bool(texts) == found
    assert all("deep inside the soft 'ball'" in text for text in texts)


def test_a_blow_is_none():
    assert play(Box((0.003, 0.05, LENGTH_M)), 0.02, seconds=0.05) == []
