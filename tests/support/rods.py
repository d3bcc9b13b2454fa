"""A representation of rods, and a designs document of them."""

from core.design import Component, DesignError, Tool
from core.geometry import Box, Pose
from core.interfaces import ToolRepresentation
from tests.support.panda import on_panda
from tests.support.scenes import CubeOnTable


class Rod(ToolRepresentation):
    """A tool is the length of a rod that hangs from the mount."""

    def __init__(self):
        self.parsed = 0

    def instructions(self, brief):
        return "Give the length of a rod."

    def schema(self):
        return {"length": {"type": "number"}}

    def parse(self, data, *, gripper):
        self.parsed += 1
        length = data.get("length")
        if (
            isinstance(length, bool)
            or not isinstance(length, int | float)
            or not 0 < length < 10
        ):
            raise DesignError("length must be a number between 0 and 10")
        if gripper:
            rods = ("left_finger", 1), ("right_finger", -1)
            return Tool(
                tuple(
                    self._rod(m, length, (0, y * 0.0075, 0.05 + length / 2))
                    for m, y in rods
                ),
                gripper=True,
            )
        return Tool((self._rod("tool_mount", length, (0, 0, -length / 2)),))

    def _rod(self, mount, length, at):
        return Component(
            f"rod_{mount[0]}", mount, Pose.xyz_rpy(at), Box((0.01, 0.01, length))
        )

    def dump(self, tool):
        return {"length": tool.components[0].shape.size[2]}


TASK = on_panda(CubeOnTable())


PLAN = [[0.5, 0, 0.4, 0, 0, 0], [0.6, 0, 0.4, 0, 0, 0.5]]


STRATEGY = {
    "strategy_name": "poke",
    "strategy_description": "Poke it.",
    "tool_name": "rod",
    "tool_description": "A rod.",
    "length": 0.2,
    "action_description": "Forward.",
    "action_sets": [PLAN, PLAN[:1]],
}
