"""Check joints of tools and of scenes: they swing, spring, slide, stop, latch and follow drives as formulas say."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from core.design import Component, Tool, ToolJoint
from core.geometry import Array, Box, Pose
from core.interfaces import Simulator
from core.scene import Body, Drive, Joint, Latch
from plugins.conformance.sample_tools import box
from plugins.conformance.shared import between, near
from plugins.conformance.worlds import FAR, GRAVITY, Film, cube, make_body, watch

_STEP_S = 1e-4  # of the equation of motion
_TOP = np.array([FAR[0], FAR[1], 1.0])  # of a scene's rod that hangs
_ROD_M = 0.2  # m: of a rod that hangs from its end
_ROD_WIDTH_M = 0.01
_ROD_KG = 0.1
_ROD = Box((_ROD_WIDTH_M, _ROD_WIDTH_M, _ROD_M))
_ROD_END = (0.0, 0.0, _ROD_M / 2)
_ACROSS = (1.0, 0.0, 0.0)  # the axis of its hinge
_BLOCK_KG = 0.2
_BLOCK = cube("block", (FAR[0], FAR[1], 2.0), mass=_BLOCK_KG)
_POST = cube("post", tuple(_TOP), mass=0.0)
_LEANING = (0.0, 0.6, 0.8)  # the axis of a slider, which holds a load across it
_AIR = (0.75, 0.3, 1.0)
_PLATE_KG = 0.05


# --- joints that are let go -------------------------------------------------------------------------------------


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

    def check(self, film: Film, found: Array, whose: str) -> None:
        """Compare how far the joint got from its start at each time with its equation of motion."""
        near(
            f"a {self.joint.kind} of a {whose} that {self.what}, rad or m",
            found,
            self._follow(film.times),
            self.within,
        )

    def _follow(self, times: Array) -> Array:
        """Integrate the equation of motion from rest; how far the joint is from its start at times (T,)."""
        joint = self.joint
        inertia = _BLOCK_KG
        if joint.kind == "hinge":
            width = (_ROD_M**2 + _ROD_WIDTH_M**2) / 12
            inertia = _ROD_KG * (width + (_ROD_M / 2) ** 2)

        value = joint.start
        speed = 0.0
        values = [value]
        step = _STEP_S / inertia
        most = joint.friction * step  # that friction changes the speed by in a step

        for _ in range(round(self.seconds / _STEP_S)):
            pull = 0.8 * _BLOCK_KG * GRAVITY
            if joint.kind == "hinge":
                pull = _ROD_KG * GRAVITY * _ROD_M / 2 * math.sin(value)

            spring = joint.stiffness * (joint.rest - value)
            speed += (spring - joint.damping * speed - pull) * step
            speed -= min(max(speed, -most), most)
            inside = joint.lower <= value + speed * _STEP_S <= joint.upper
            speed *= inside
            value += speed * _STEP_S
            values.append(value)

        return np.interp(times, np.arange(len(values)) * _STEP_S, values) - joint.start


def _releases() -> list[Release]:
    free = Joint("pivot", "hinge", "rod", "post", _ACROSS, _ROD_END, -3.0, 3.0, 0.5)
    load = Joint("slider", "slider", "block", axis=_LEANING, lower=-3.0, upper=3.0)
    sprung = replace(free, stiffness=0.5, damping=0.02, rest=0.8)
    ringing = replace(load, stiffness=47.0, damping=1.6)
    return [
        Release("swings", free, 2.0, 0.1),
        Release("is on a spring and a damper", sprung, 2.0, 0.02),
        Release("stops at its limit", replace(free, start=0.8, lower=0.6), 2.0, 0.04),
        Release("is held by friction", replace(free, friction=0.056), 2.0, 0.01),
        Release("is slowed by friction", replace(free, friction=0.038), 2.0, 0.02),
        Release("rings down on a spring and a damper", ringing, 1.5, 0.003),
        Release("sinks on a damper", replace(load, damping=12.0), 1.5, 0.01),
        Release("stops at its limit", replace(load, lower=-0.05), 1.0, 0.005),
    ]


def hinged(tilt: float, joint: ToolJoint) -> Tool:
    """A post with a rod on a hinge at its side, the rod turned by ``tilt`` radians about x from hanging straight."""
    post = box("post", (0.03, 0.02, 0.1), (0.0, 0.0, -0.05), mass=0.05)
    half = _ROD_M / 2
    middle = (0.02, half * math.sin(tilt), -0.05 - half * math.cos(tilt))
    pose = Pose.xyz_rpy(middle, (tilt, 0.0, 0.0))
    return Tool((post, Component("rod", "post", pose, _ROD, _ROD_KG, joint=joint)))


def hinge(lower: float = -3.0, upper: float = 3.0, **resisting: Any) -> ToolJoint:
    return ToolJoint("hinge", _ACROSS, lower, upper, _ROD_END, **resisting)


def sliding(joint: ToolJoint) -> Tool:
    """A post with a block of 0.2 kg beside it that slides up and down."""
    post = box("post", (0.02, 0.02, 0.2), (0.0, 0.0, -0.1), mass=0.05)
    side = (0.03, 0.03, 0.03)
    block = box("block", side, (0.025, 0.0, 0.0), "post", mass=_BLOCK_KG, joint=joint)
    return Tool((post, block))


def _tool_with(joint: Joint) -> Tool:
    """A tool with a joint like a scene's; its values count from the start."""
    resisting: dict[str, Any] = {
        "lower": joint.lower - joint.start,
        "upper": joint.upper - joint.start,
        "rest": joint.rest - joint.start,
        "stiffness": joint.stiffness,
        "damping": joint.damping,
        "friction": joint.friction,
    }
    if joint.kind == "hinge":
        return hinged(joint.start, hinge(**resisting))

    return sliding(ToolJoint("slider", _LEANING, **resisting))


def check_joints_of_tools_move_as_formulas_say(simulator: Simulator) -> None:
    """The arm holds them; they are held until the motion begins."""
    for case in _releases():
        tool = _tool_with(case.joint)
        played = watch(simulator, tool=tool, settle_s=0.2, hold_s=case.seconds)
        case.check(played, played.recording.fingers[:, -1], "tool")


def _make_rod(name: str, tilt: float, top: Array = _TOP) -> Body:
    """A rod that hangs from ``top``, turned by ``tilt`` radians about x from hanging straight."""
    pose = Pose.xyz_rpy(top, (tilt, 0.0, 0.0)) @ Pose(np.negative(_ROD_END))
    return make_body(name, _ROD, pose.position, _ROD_KG, rpy=(tilt, 0.0, 0.0))


def check_joints_of_scenes_move_as_formulas_say(simulator: Simulator) -> None:
    """A hinge's rod hangs from a fixed body that it overlaps. Bodies have no motion but that of their joints."""
    for case in _releases():
        bodies: tuple[Body, ...] = (_BLOCK,)
        if case.joint.kind == "hinge":
            bodies = (_POST, _make_rod("rod", case.joint.start))

        played = watch(simulator, *bodies, joints=(case.joint,), hold_s=case.seconds)
        states = played.states
        value = states.joint(case.joint.name).position
        case.check(played, value - case.joint.start, "scene")

        placed = states.joints[case.joint.name]
        parent = states.placement(case.joint.parent)
        due = placed.carry(value, np.zeros_like(value), parent).position
        near(
            f"where the body of joint {case.joint.name!r} is, m",
            states.position(case.joint.body),
            due,
            0.001,
        )


def check_chain_stays_together(simulator: Simulator) -> None:
    """A hinge and a ball joint below it swing wildly."""
    top = _make_rod("upper", 1.5)
    middle = np.negative(_ROD_END)
    bottom = _make_rod("lower", 2.0, top.pose.apply(middle))
    hinge = Joint("upper", "hinge", "upper", None, _ACROSS, _ROD_END)
    ball = Joint("lower", "ball", "lower", "upper", _ACROSS, _ROD_END)
    states = watch(simulator, top, bottom, joints=(hinge, ball), hold_s=2.0).states
    fastest = states.linear_velocities.max()
    between("the largest speed of a chain that swings, m/s", fastest, 1.0)

    for number in range(0, 200, 10):
        upper = states[number].pose("upper")
        lower = states[number].pose("lower").apply(_ROD_END)
        near("where the top of a chain is, m", upper.apply(_ROD_END), _TOP, 0.001)
        near("where the middle of a chain is, m", lower, upper.apply(middle), 0.001)


# --- latches and drives -----------------------------------------------------------------------------------------


def _track(
    simulator: Simulator, joint: Joint, *bodies: Body, seconds: float, settle_s: float
) -> tuple[Array, Array]:
    """Play bodies on a joint: instants (T,) and how the joint is there, m or rad."""
    played = watch(
        simulator, *bodies, joints=(joint,), settle_s=settle_s, hold_s=seconds
    )
    return played.times, played.states.joint(joint.name).position


def check_latch_opens_at_its_force(simulator: Simulator) -> None:
    """A latch of 1.03 times a block's weight holds it, where its force is the weight; one of 0.97 lets it go."""
    width = 0.02
    hangs = -width / math.pi * math.asin(1 / 1.03)
    free = Joint("s", "slider", "block", lower=-0.5, upper=0.5, damping=20.0)
    for share, due, within in ((1.03, hangs, 0.001), (0.97, -0.275, 0.225)):
        latch = Latch(0.0, share * _BLOCK_KG * GRAVITY, width)
        joint = replace(free, latches=(latch,))
        _, found = _track(simulator, joint, _BLOCK, seconds=3.0, settle_s=0.0)
        near(
            f"where a block hangs from a latch of {share} times its weight, m",
            found[-1],
            due,
            within,
        )


def check_drive_keeps_its_schedule(simulator: Simulator) -> None:
    """A gate waits until the motion begins, follows its drive, and begins again."""
    drive = Drive((0.0, 0.5, 1.0), (0.1, 0.3, 0.1), 200.0, repeats=True)
    # m or rad: what the slowest servo that is allowed trails behind at its speed.
    lag = 0.4 / 50.0
    joint = Joint("gate", "slider", "block", start=0.1, drive=drive)
    times, found = _track(simulator, joint, _BLOCK, seconds=2.0, settle_s=0.3)
    near("where a driven slider is, m", found, drive.sample(times), lag + 0.004)


def check_drive_bears_its_load(simulator: Simulator) -> None:
    """Light plates stay level and lifts rise, empty and with what is laid on them, up to the drive's force."""
    lift = Joint("j", "slider", "plate")
    rising = replace(lift, drive=Drive((0.0, 0.5), (0.0, 0.1), 50.0))
    edge = Joint("j", "hinge", "plate", None, _ACROSS, (0.025, 0.0, 0.0))
    level = replace(edge, drive=Drive((0.0,), (0.0,), 20.0))
    for load_kg in (0.0, 0.014, 0.2, 1.0):
        near(
            f"how a driven plate with {load_kg} kg on it turns, rad",
            _bear(simulator, load_kg, level),
            0.0,
            0.004,
        )
        near(
            f"how far a lift with {load_kg} kg on it rises, m",
            _bear(simulator, load_kg, rising),
            0.1,
            0.001,
        )

    for share, due, within in ((1.2, 0.0, 0.002), (0.8, -3.0, 1.0)):
        weight = (1.0 + _PLATE_KG) * GRAVITY
        found = _bear(
            simulator, 1.0, replace(lift, drive=Drive((0.0,), (0.0,), share * weight))
        )
        near(
            f"how far a lift sinks that can do {share} times the weight on it, m",
            found,
            due,
            within,
        )


def _bear(simulator: Simulator, load_kg: float, joint: Joint) -> float:
    """Return where the joint of a plate in the air ends on which a box of so many kg lies; 0: there is none."""
    bodies = [make_body("plate", Box((0.05, 0.05, 0.01)), _AIR, _PLATE_KG)]
    if load_kg:
        above = np.add(_AIR, (0.0, 0.0, 0.0202))
        bodies.append(cube("load", above, side=0.03, mass=load_kg))

    _, found = _track(simulator, joint, *bodies, seconds=1.5, settle_s=0.3)
    return float(found[-1])
