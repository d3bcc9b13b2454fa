"""A strike that sends a puck 2 m away, which no plan that rests at its waypoints can."""

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.geometry import Box, Cylinder, Pose
from core.interfaces import RolloutSettings, Task
from core.plugins import installed
from core.scene import Body, Scene
from plugins.actions.anchored import AnchoredActions
from tests.support.panda import on_panda
from tests.support.playing import evaluate_batch

pytestmark = pytest.mark.slow

GRAY, FAR_M = (0.6, 0.6, 0.6, 1.0), 2.0
PADDLE = Tool(
    (
        Component(
            "shaft",
            "tool_mount",
            Pose.xyz_rpy((0.0, 0.0, -0.13)),
            Box((0.03, 0.03, 0.26)),
            0.1,
        ),
        Component(
            "blade",
            "shaft",
            Pose.xyz_rpy((0.0, 0.0, -0.145)),
            Box((0.12, 0.03, 0.05)),
            0.05,
        ),
    )
)


class Strike(Task):
    name = "Strike"
    description = "Strike the puck so that it comes to rest on the mark."
    goals = ()

    def scene(self, seed):
        ground = Body.of(
            "ground", Box((8.0, 8.0, 0.1)), (0.0, 0.0, -0.05), mass=0.0, color=GRAY
        )
        puck = Body.of(
            "puck",
            Cylinder(0.05, 0.04),
            (0.6, 0.0, 0.0201),
            mass=0.2,
            color=GRAY,
            friction=0.02,
        )
        return Scene(
            (
                ground,
                puck,
                Body.mark("mark", (0.6, FAR_M, 0.0), 0.15, (1.0, 0.2, 0.2, 1.0)),
            )
        )

    def reward(self, start, end):
        missed = np.linalg.norm(
            end.position("puck")[..., :2] - np.array([0.6, FAR_M]), axis=-1
        )
        return np.clip(1 - missed / FAR_M, 0, 1)


def swing(tempo):
    """Nine waypoints on an arc of 0.6 m about the arm's base."""
    turns = np.radians(np.linspace(-70, 40, 9)).tolist()
    places = [
        {
            "offset": [0.6 * np.cos(turn), 0.6 * np.sin(turn), 0.31],
            "rpy": [0.0, 0.0, turn],
        }
        for turn in turns
    ]
    fast = [
        place | {"speed": 1.6, "through": tempo and k < 8}
        for k, place in enumerate(places[1:], start=1)
    ]
    return AnchoredActions().parse(
        [places[0], *(fast if tempo else places[1:])], gripper=False
    )


@pytest.mark.parametrize("engine", ["pybullet", "sapien", "mujoco"])
def test_a_strike_needs_its_tempo(engine):
    # As fast as a straight way allows.
    stroke = np.array([[0.6, y, 0.31, 0.0, 0.0, 0.0] for y in (-0.4, 0.4)])
    candidates = [
        Candidate(PADDLE, plan)
        for plan in (swing(tempo=True), swing(tempo=False), stroke)
    ]
    settings, sim = RolloutSettings(hold_s=4.0), installed().create("sim", engine)
    struck, *pushed = evaluate_batch(
        on_panda(Strike()), sim, candidates, settings=settings
    )
    assert struck.reward > 0.9
    assert all(
        evaluation.status == "ok" and evaluation.reward < 0.4 for evaluation in pushed
    )
