"""Briefs and elites for prompts."""

from dataclasses import replace

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Candidate, Component, Tool
from core.geometry import Box, Pose
from core.goals import Away
from core.interfaces import (
    Brief,
    Task,
    ToolRepresentation,
)
from core.scene import Body, Scene, floor, table
from plugins.actions.waypoints import WaypointActions
from plugins.conformance.evaluations import tried_once
from tests.support.panda import on_panda


class PushCube(Task):
    name = "PushCube"
    description = "A small cube stands on the table. Push it {{ off }} the far edge."  # braces are text here, not Jinja
    goals = (Away(bodies=("cube",), away=0.5),)
    home = Pose.xyz_rpy((0.4, -0.2, 0.2))

    def scene(self, seed):
        cube = Body.of(
            "cube",
            Box((0.05, 0.05, 0.05)),
            (1.2, 0.0, 0.025),
            mass=0.1,
            color=(1, 0, 0, 1),
        )
        return Scene((floor(), table(), cube))

    def reward(self, start, end):
        moved = end.position("cube")[..., 0] - start.position("cube")[..., 0]
        return np.clip(moved / 0.5, 0.0, 1.0)


class Bar(ToolRepresentation):
    """A tool is one bar, written as XML."""

    def instructions(self, brief):
        return f"The tool is one bar on {' and '.join(GRIPPER_MOUNTS) if brief.gripper else RIGID_MOUNT}."

    def schema(self):
        return {"xml": {"type": "string", "description": "the bar"}}

    def parse(self, data, *, gripper):
        raise NotImplementedError

    def dump(self, tool):
        return {"xml": f'<bar name="{tool.components[0].name}"/>\n'}


def make_brief(**changes):
    counts = {
        "gripper": False,
        "n_tool": 3,
        "n_action": 4,
        "generation": 0,
        "agent": 0,
        "seed": 0,
    }
    brief = Brief(on_panda(PushCube()), 7, Bar(), **counts, actions=WaypointActions())
    return replace(brief, **changes)


def make_elite(strategy, reward, *, gripper=False, solved=False):
    mount = GRIPPER_MOUNTS[0] if gripper else RIGID_MOUNT
    bar = Component(
        f"bar{strategy}",
        mount,
        Pose.xyz_rpy((0.0, 0.0, -0.1)),
        Box((0.01, 0.01, 0.2)),
    )
    tool = Tool((bar,), gripper, name=f"Bar {strategy}", description="A long bar.")
    candidate = Candidate(
        tool,
        np.zeros((1, 7 if gripper else 6)),
        design=strategy,
        design_name=f"Push {strategy}",
    )
    return tried_once(candidate, "ok", reward=reward, solved=solved)
