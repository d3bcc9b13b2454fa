"""Follow the robot, or the bodies, of a recorded rollout by themselves."""

from __future__ import annotations

from core.design import Tool
from core.interfaces import Recording
from core.scene import Scene
from core.solids.rollout_solids import ROBOT
from core.solids.tracks import Track, follow
from core.values.robots import Robot


def robot_tracks(robot: Robot, tool: Tool, recording: Recording) -> list[Track]:
    """Follow the links that move, and the tool's components."""
    return follow(Scene(()), robot, tool, recording).items


def body_tracks(scene: Scene, robot: Robot, recording: Recording) -> list[Track]:
    """Follow the collision shapes of all bodies."""
    return [
        track
        for track in follow(scene, robot, Tool(), recording).items
        if track.owner != ROBOT
    ]
