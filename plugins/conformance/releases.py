"""Provide joints that are let go, what they bear, and how they move by their equation of motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from core.design import Component, Tool, ToolJoint
from core.geometry import Array, Box, Pose
from core.scene import Body, Joint
from plugins.conformance.scenery import FAR, box, cube, make_body
from plugins.conformance.worlds import GRAVITY

_STEP_S = 1e-4  # of the equation of motion
TOP = np.array([FAR[0], FAR[1], 1.0])  # of a scene's rod that hangs
ROD_M = 0.2  # m: of a rod that hangs from its end
ROD_WIDTH_M = 0.01  # m
ROD_KG = 0.1
ACROSS = (1.0, 0.0, 0.0)  # the axis of its hinge
ROD_END = (0.0, 0.0, ROD_M / 2)
BLOCK_KG = 0.2
LEANING = (0.0, 0.6, 0.8)  # the axis of a slider, which holds a load across it
# Of the weight: of a level rod, N m, or along the slider, N.
_PULL = {
    "hinge": ROD_KG * GRAVITY * ROD_M / 2,
    "slider": 0.8 * BLOCK_KG * GRAVITY,
}
_INERTIA = {
    "hinge": ROD_KG * ((ROD_M**2 + ROD_WIDTH_M**2) / 12 + (ROD_M / 2) ** 2),
    "slider": BLOCK_KG,
}


@dataclass(frozen=True)
class Release:
    """A joint that is let go: weight pulls at what it bears, and a spring, a damper and dry friction resist.

    Attributes:
        what: it does, in words.
        joint: of a scene. A hinge bears a rod that is tilted by ``start`` from hanging straight, a slider a block.
        seconds: how long it is played.
        within: the largest distance from the equation of motion at any time, rad or m.
    """

    what: str
    joint: Joint
    seconds: float
    within: float

    def follow(self, times: Array) -> Array:
        """Integrate the equation of motion from rest; how far the joint is from its start at times (T,)."""
        joint = self.joint
        value = joint.start
        speed = 0.0
        values = [value]
        step = _STEP_S / _INERTIA[joint.kind]
        most = joint.friction * step  # that friction changes the speed by in a step

        for _ in range(round(self.seconds / _STEP_S)):
            pull = _PULL[joint.kind]
            if joint.kind == "hinge":
                pull *= math.sin(value)

            spring = joint.stiffness * (joint.rest - value)
            speed += (spring - joint.damping * speed - pull) * step
            speed -= min(max(speed, -most), most)
            inside = joint.lower <= value + speed * _STEP_S <= joint.upper
            speed *= inside
            value += speed * _STEP_S
            values.append(value)

        return np.interp(times, np.arange(len(values)) * _STEP_S, values) - joint.start


def _hinge(start: float, lower: float = -3.0, **more: Any) -> Joint:
    """A hinge of a scene's rod, at its upper end, on a post."""
    return Joint(
        "pivot", "hinge", "rod", "post", ACROSS, ROD_END, lower, 3.0, start, **more
    )


def _slider(lower: float = -3.0, **more: Any) -> Joint:
    return Joint(
        "slider", "slider", "block", axis=LEANING, lower=lower, upper=3.0, **more
    )


RELEASES = [
    Release("swings", _hinge(0.5), 2.0, 0.1),
    Release(
        "is on a spring and a damper",
        _hinge(0.5, stiffness=0.5, damping=0.02, rest=0.8),
        2.0,
        0.02,
    ),
    Release("stops at its limit", _hinge(0.8, lower=0.6), 2.0, 0.04),
    Release("is held by friction", _hinge(0.5, friction=0.056), 2.0, 0.01),
    Release("is slowed by friction", _hinge(0.5, friction=0.038), 2.0, 0.02),
    Release(
        "rings down on a spring and a damper",
        _slider(stiffness=47.0, damping=1.6),
        1.5,
        0.003,
    ),
    Release("sinks on a damper", _slider(damping=12.0), 1.5, 0.01),
    Release("stops at its limit", _slider(lower=-0.05), 1.0, 0.005),
]


def hinged(tilt: float, joint: ToolJoint) -> Tool:
    """A post with a rod on a hinge at its side, the rod turned by ``tilt`` radians about x from hanging straight."""
    post = box("post", (0.03, 0.02, 0.1), (0.0, 0.0, -0.05), mass=0.05)
    half = ROD_M / 2
    middle = (0.02, half * math.sin(tilt), -0.05 - half * math.cos(tilt))
    pose = Pose.xyz_rpy(middle, (tilt, 0.0, 0.0))
    size = Box((ROD_WIDTH_M, ROD_WIDTH_M, ROD_M))
    rod = Component("rod", "post", pose, size, ROD_KG, joint=joint)
    return Tool((post, rod))


def hinge(lower: float = -3.0, upper: float = 3.0, **resisting: Any) -> ToolJoint:
    return ToolJoint("hinge", ACROSS, lower, upper, ROD_END, **resisting)


def sliding(joint: ToolJoint) -> Tool:
    """A post with a block of 0.2 kg beside it that slides up and down."""
    post = box("post", (0.02, 0.02, 0.2), (0.0, 0.0, -0.1), mass=0.05)
    block = box(
        "block",
        (0.03, 0.03, 0.03),
        (0.025, 0.0, 0.0),
        "post",
        mass=BLOCK_KG,
        joint=joint,
    )
    return Tool((post, block))


def tool_with(joint: Joint) -> Tool:
    """A tool with a joint like a scene's; its values count from the start."""
    more: dict[str, Any] = {
        name: getattr(joint, name) for name in ("stiffness", "damping", "friction")
    }
    more |= {
        name: getattr(joint, name) - joint.start for name in ("lower", "upper", "rest")
    }
    if joint.kind == "hinge":
        return hinged(joint.start, hinge(**more))

    return sliding(ToolJoint("slider", LEANING, **more))


def make_rod(name: str, tilt: float, top: Array = TOP) -> Body:
    """A rod that hangs from ``top``, turned by ``tilt`` radians about x from hanging straight."""
    pose = Pose.xyz_rpy(top, (tilt, 0.0, 0.0)) @ Pose(np.array([0.0, 0.0, -ROD_M / 2]))
    size = Box((ROD_WIDTH_M, ROD_WIDTH_M, ROD_M))
    return make_body(name, size, pose.position, mass=ROD_KG, rpy=(tilt, 0.0, 0.0))


POST = cube("post", tuple(TOP), mass=0.0)
BLOCK = cube("block", (FAR[0], FAR[1], 2.0), mass=BLOCK_KG)  # high above the ground
