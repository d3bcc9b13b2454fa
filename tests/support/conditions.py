"""Conditions of BringCube, and plans that suit some of them."""

import numpy as np

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import Condition, RolloutSettings, Waypoints
from core.plugins import PluginPart

QUICK = RolloutSettings(segment_s=0.2, settle_s=0.05, hold_s=0.1)


WIDE = Condition(
    PluginPart("task", "BringCube", (("variation", "wide"),)),
    PluginPart("sim", "mujoco"),
    3,
    QUICK,
)


STICK = Tool(
    (
        Component(
            "stick",
            "tool_mount",
            Pose.xyz_rpy((0.0, 0.0, -0.1)),
            Box((0.02, 0.02, 0.2)),
            0.005,
        ),
    )
)


STAY = Candidate(STICK, Waypoints(np.array([[0.5, 0.0, 0.5, 0.0, 0.0, 0.0]])))


COARSE = {"name": "pybullet", "time_step": 0.004}


TASK = PluginPart("task", "BringCube")


CONDITION = Condition(TASK, PluginPart("sim", "pybullet"))
