"""Check joints of tools and of scenes: they swing, spring, slide, stop, latch and follow drives as formulas say."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from core.design import Component, Tool, ToolJoint
from core.geometry import Array, Box, Pose
from core.interfaces import Simulator
from core.scene import Body, Drive, Joint, Latch, Scene, State
from plugins.conformance.cases import Case, Measure, compare, play
from plugins.conformance.checking import between, near
from plugins.conformance.worlds import (
    FAR,
    GRAVITY,
    box,
    cube,
    film,
    ground,
    make_body,
    wait,
)

_TOP = np.array([FAR[0], FAR[1], 1.0])  # of a scene's rod that hangs
_STEP_S = 1e-4  # of the equation of motion
_LONG = 0.2  # m: of a rod that hangs from its end
_WIDE = 0.01  # m
_ROD_KG = 0.1
_ACROSS = (1.0, 0.0, 0.0)  # the axis of its hinge
_END = (0.0, 0.0, _LONG / 2)
_BLOCK_KG = 0.2
_LEANING = (0.0, 0.6, 0.8)  # the axis of a slider, which holds a load across it
# Of the weight: of a level rod, N m, or along the slider, N.
_PULL = {
    "hinge": _ROD_KG * GRAVITY * _LONG / 2,
    "slider": 0.8 * _BLOCK_KG * GRAVITY,
}
_INERTIA = {
    "hinge": _ROD_KG * ((_LONG**2 + _WIDE**2) / 12 + (_LONG / 2) ** 2),
    "slider": _BLOCK_KG,
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
        "pivot", "hinge", "rod", "post", _ACROSS, _END, lower, 3.0, start, **more
    )


def _slider(lower: float = -3.0, **more: Any) -> Joint:
    return Joint(
        "slider", "slider", "block", axis=_LEANING, lower=lower, upper=3.0, **more
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
    half = _LONG / 2
    middle = (0.02, half * math.sin(tilt), -0.05 - half * math.cos(tilt))
    pose = Pose.xyz_rpy(middle, (tilt, 0.0, 0.0))
    size = Box((_WIDE, _WIDE, _LONG))
    rod = Component("rod", "post", pose, size, _ROD_KG, joint=joint)
    return Tool((post, rod))


def hinge(lower: float = -3.0, upper: float = 3.0, **resisting: Any) -> ToolJoint:
    return ToolJoint("hinge", _ACROSS, lower, upper, _END, **resisting)


def sliding(joint: ToolJoint) -> Tool:
    """A post with a block of 0.2 kg beside it that slides up and down."""
    post = box("post", (0.02, 0.02, 0.2), (0.0, 0.0, -0.1), mass=0.05)
    block = box(
        "block",
        (0.03, 0.03, 0.03),
        (0.025, 0.0, 0.0),
        "post",
        mass=_BLOCK_KG,
        joint=joint,
    )
    return Tool((post, block))


def _tool(joint: Joint) -> Tool:
    """A tool with a joint like a scene's; its values count from the start."""
    more: dict[str, Any] = {
        name: getattr(joint, name) for name in ("stiffness", "damping", "friction")
    }
    more |= {
        name: getattr(joint, name) - joint.start for name in ("lower", "upper", "rest")
    }
    if joint.kind == "hinge":
        return hinged(joint.start, hinge(**more))
    return sliding(ToolJoint("slider", _LEANING, **more))


def check_joints_of_tools_move_as_formulas_say(simulator: Simulator) -> None:
    """The arm holds them; they are held until the motion begins."""
    for case in RELEASES:
        tool = _tool(case.joint)
        outcome = wait(
            simulator, tool=tool, seconds=case.seconds, settle_s=0.2, record_hz=100
        )
        recording = film(outcome)
        what = f"a {case.joint.kind} of a tool that {case.what}, rad or m"
        near(what, recording.fingers[:, -1], case.follow(recording.times), case.within)


def _rod(name: str, tilt: float, top: Array = _TOP) -> Body:
    """A rod that hangs from ``top``, turned by ``tilt`` radians about x from hanging straight."""
    pose = Pose.xyz_rpy(top, (tilt, 0.0, 0.0)) @ Pose(np.array([0.0, 0.0, -_LONG / 2]))
    size = Box((_WIDE, _WIDE, _LONG))
    return make_body(name, size, pose.position, mass=_ROD_KG, rpy=(tilt, 0.0, 0.0))


_POST = cube("post", tuple(_TOP), mass=0.0)
_BLOCK = cube("block", (FAR[0], FAR[1], 2.0), mass=_BLOCK_KG)  # high above the ground


def check_joints_of_scenes_move_as_formulas_say(simulator: Simulator) -> None:
    """A hinge's rod hangs from a fixed body that it overlaps."""
    for case in RELEASES:
        bodies: tuple[Body, ...] = (_BLOCK,)
        if case.joint.kind == "hinge":
            bodies = (_POST, _rod("rod", case.joint.start))
        played = play(simulator, Scene(bodies, (case.joint,)), case.seconds)
        way = played.states.joint(case.joint.name).position - case.joint.start
        what = f"a {case.joint.kind} of a scene that {case.what}, rad or m"
        near(what, way, case.follow(played.times), case.within)
        _check_together(played.states)


def check_chain_stays_together(simulator: Simulator) -> None:
    """A hinge and a ball joint below it swing wildly."""
    top = _rod("upper", 1.5)
    bottom = _rod("lower", 2.0, top.pose.apply([0.0, 0.0, -_LONG / 2]))
    hinge = Joint("upper", "hinge", "upper", None, _ACROSS, _END)
    ball = Joint("lower", "ball", "lower", "upper", _ACROSS, _END)
    states = play(simulator, Scene((top, bottom), (hinge, ball)), 2.0).states
    fastest = states.linear_velocities.max()
    between("the largest speed of a chain that swings, m/s", fastest, 1.0)

    for number in range(0, 200, 10):
        upper = states[number].pose("upper")
        lower = states[number].pose("lower")
        near("where the top of a chain is, m", upper.apply(_END), _TOP, 0.001)
        middle = upper.apply(np.negative(_END))
        near("where the middle of a chain is, m", lower.apply(_END), middle, 0.001)


def _check_together(states: State) -> None:
    """Check that bodies are where their joints' values and their parents have them: they have no other motion."""
    for name, placed in states.joints.items():
        value = states.joint(name).position
        parent = states.placement(placed.joint.parent)
        due = placed.carry(value, np.zeros_like(value), parent)
        position = states.position(placed.joint.body)
        what = f"where the body of joint {name!r} is, m"
        near(what, position, due.position, 0.001)


def _value(joint: str) -> Measure:
    """A joint's value at the end, m or rad."""
    return lambda played: played.states.joint(joint).position[-1]


@compare
def check_latch_opens_at_its_force() -> Iterator[Case]:
    """A latch of 1.03 times a block's weight holds it, where its force is the weight; one of 0.97 lets it go."""
    width = 0.02
    hangs = -width / math.pi * math.asin(1 / 1.03)
    for share, due, within in ((1.03, hangs, 0.001), (0.97, -0.275, 0.225)):
        latch = Latch(0.0, share * _BLOCK_KG * GRAVITY, width)
        free = Joint("s", "slider", "block", lower=-0.5, upper=0.5, damping=20.0)
        joint = replace(free, latches=(latch,))
        what = f"where a block hangs from a latch of {share} times its weight, m"
        yield Case(what, (_BLOCK,), _value("s"), due, within, 3.0, (joint,))


def check_drive_keeps_its_schedule(simulator: Simulator) -> None:
    """A gate waits until the motion begins, follows its drive, and begins again."""
    drive = Drive((0.0, 0.5, 1.0), (0.1, 0.3, 0.1), 200.0, repeats=True)
    # m or rad: what the slowest servo that is allowed trails behind at its speed.
    lag = 0.4 / 50.0
    joint = Joint("gate", "slider", "block", start=0.1, drive=drive)
    played = play(simulator, Scene((_BLOCK,), (joint,)), 2.0, settle_s=0.3)
    found = played.states.joint("gate").position
    near("where a driven slider is, m", found, drive.sample(played.times), lag + 0.004)


def check_launched_body_flies(simulator: Simulator) -> None:
    """A cube rests until the motion begins; then it flies along its parabola and spins as it was told."""
    velocity = np.array([1.0, 0.5, 3.0])
    spin = (0.0, 0.0, 4.0)
    resting = cube("cube", (FAR[0], FAR[1], 0.0501))
    thrown = replace(resting, velocity=tuple(velocity), spin=spin)
    played = play(simulator, Scene((ground(), thrown)), 0.5, settle_s=0.3)

    due = thrown.pose.position + velocity * 0.5 + [0, 0, -GRAVITY / 2 * 0.5**2]
    position = played.states.position("cube")[-1]
    near("where a cube is 0.5 s after its launch, m", position, due, 0.03)
    turning = played.states.angular_velocities[-1, 0]
    near("the spin of a launched cube, rad/s", turning, spin, 0.08)
