"""Answer every request with a stick that points forward, and a poke with it."""

import json

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import VLM, Reply


class Echo(VLM):
    """Answers at once, at no cost."""

    def __init__(self, reach: float = 0.3):
        self.model = "echo"
        self.reach = reach

    def complete(self, requests):
        for request in requests:
            yield Reply(
                request.id,
                json.dumps(self.answer(request.brief)),
                self.model,
                cost_usd=0.0,
            )

    def answer(self, brief):
        kind = [0.0] if brief.gripper else []
        plans = [
            [[x, 0.0, 0.05, 0, 0, 0, *kind] for x in (0.45, 0.6 + 0.02 * n)]
            for n in range(brief.n_action)
        ]
        strategy = {
            "strategy_name": "poke",
            "gripper": brief.gripper,
            "action_sets": plans,
        }
        strategy |= brief.representation.dump(self.stick(brief.gripper))
        return {"strategies": [strategy] * brief.n_tool}

    def stick(self, gripper):
        mount = GRIPPER_MOUNTS[0] if gripper else RIGID_MOUNT
        size = (0.01, 0.01, 0.1) if gripper else (self.reach, 0.02, 0.02)
        at = Pose(
            np.array([0.0, 0.02, 0.09] if gripper else [self.reach / 2, 0.0, -0.01])
        )
        stick = Component("stick", mount, at, Box(size))
        return Tool((stick,), gripper=gripper, name="stick")
