"""Check joints of tools and of scenes: they swing, spring, slide, stop, latch and follow drives as formulas say."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from core.geometry import Array, Box
from core.interfaces import Simulator
from core.scene import Body, Drive, Joint, Latch, Scene, State
from plugins.conformance.cases import Case, Measure, compare
from plugins.conformance.releases import (
    ACROSS,
    BLOCK,
    BLOCK_KG,
    POST,
    RELEASES,
    ROD_END,
    ROD_M,
    TOP,
    make_rod,
    tool_with,
)
from plugins.conformance.shared import between, near
from plugins.conformance.worlds import GRAVITY, watch

_AIR = (0.75, 0.3, 1.0)
_GREY = (0.5, 0.5, 0.5, 1.0)
_PLATE_KG = 0.05


def check_joints_of_tools_move_as_formulas_say(simulator: Simulator) -> None:
    """The arm holds them; they are held until the motion begins."""
    for case in RELEASES:
        tool = tool_with(case.joint)
        played = watch(simulator, Scene(()), case.seconds, settle_s=0.2, tool=tool)
        what = f"a {case.joint.kind} of a tool that {case.what}, rad or m"
        moved = played.recording.fingers[:, -1]
        near(what, moved, case.follow(played.times), case.within)


def check_joints_of_scenes_move_as_formulas_say(simulator: Simulator) -> None:
    """A hinge's rod hangs from a fixed body that it overlaps."""
    for case in RELEASES:
        bodies: tuple[Body, ...] = (BLOCK,)
        if case.joint.kind == "hinge":
            bodies = (POST, make_rod("rod", case.joint.start))

        played = watch(simulator, Scene(bodies, (case.joint,)), case.seconds)
        way = played.states.joint(case.joint.name).position - case.joint.start
        what = f"a {case.joint.kind} of a scene that {case.what}, rad or m"
        near(what, way, case.follow(played.times), case.within)
        _check_together(played.states)


def check_chain_stays_together(simulator: Simulator) -> None:
    """A hinge and a ball joint below it swing wildly."""
    top = make_rod("upper", 1.5)
    bottom = make_rod("lower", 2.0, top.pose.apply([0.0, 0.0, -ROD_M / 2]))
    hinge = Joint("upper", "hinge", "upper", None, ACROSS, ROD_END)
    ball = Joint("lower", "ball", "lower", "upper", ACROSS, ROD_END)
    states = watch(simulator, Scene((top, bottom), (hinge, ball)), 2.0).states
    fastest = states.linear_velocities.max()
    between("the largest speed of a chain that swings, m/s", fastest, 1.0)

    for number in range(0, 200, 10):
        upper = states[number].pose("upper")
        lower = states[number].pose("lower")
        near("where the top of a chain is, m", upper.apply(ROD_END), TOP, 0.001)
        middle = upper.apply(np.negative(ROD_END))
        near("where the middle of a chain is, m", lower.apply(ROD_END), middle, 0.001)


def _value(joint: str) -> Measure:
    """A joint's value at the end, m or rad."""
    return lambda played: played.states.joint(joint).position[-1]


@compare
def check_latch_opens_at_its_force() -> Iterator[Case]:
    """A latch of 1.03 times a block's weight holds it, where its force is the weight; one of 0.97 lets it go."""
    width = 0.02
    hangs = -width / math.pi * math.asin(1 / 1.03)
    for share, due, within in ((1.03, hangs, 0.001), (0.97, -0.275, 0.225)):
        latch = Latch(0.0, share * BLOCK_KG * GRAVITY, width)
        free = Joint("s", "slider", "block", lower=-0.5, upper=0.5, damping=20.0)
        joint = replace(free, latches=(latch,))
        what = f"where a block hangs from a latch of {share} times its weight, m"
        yield Case(what, (BLOCK,), _value("s"), due, within, 3.0, (joint,))


def check_drive_keeps_its_schedule(simulator: Simulator) -> None:
    """A gate waits until the motion begins, follows its drive, and begins again."""
    drive = Drive((0.0, 0.5, 1.0), (0.1, 0.3, 0.1), 200.0, repeats=True)
    # m or rad: what the slowest servo that is allowed trails behind at its speed.
    lag = 0.4 / 50.0
    joint = Joint("gate", "slider", "block", start=0.1, drive=drive)
    played = watch(simulator, Scene((BLOCK,), (joint,)), 2.0, settle_s=0.3)
    found = played.states.joint("gate").position
    near("where a driven slider is, m", found, drive.sample(played.times), lag + 0.004)


def check_drive_bears_its_load(simulator: Simulator) -> None:
    """Light plates stay level and lifts rise, empty and with what is laid on them, up to the drive's force."""
    for load_kg in (0.0, 0.014, 0.2, 1.0):
        level = Drive((0.0,), (0.0,), 20.0)
        edge = Joint("j", "hinge", "plate", None, ACROSS, (0.025, 0.0, 0.0))
        found = _bear(simulator, load_kg, replace(edge, drive=level))
        what = f"how a driven plate with {load_kg} kg on it turns, rad"
        near(what, found[-1], 0.0, 0.004)

        rise = Drive((0.0, 0.5), (0.0, 0.1), 50.0)
        found = _bear(simulator, load_kg, Joint("j", "slider", "plate", drive=rise))
        what = f"how far a lift with {load_kg} kg on it rises, m"
        near(what, found[-1], 0.1, 0.001)

    for share, due, within in ((1.2, 0.0, 0.002), (0.8, -3.0, 1.0)):
        weight = (1.0 + _PLATE_KG) * GRAVITY
        still = Drive((0.0,), (0.0,), share * weight)
        found = _bear(simulator, 1.0, Joint("j", "slider", "plate", drive=still))
        what = f"how far a lift sinks that can do {share} times the weight on it, m"
        near(what, found[-1], due, within)


def _bear(simulator: Simulator, load_kg: float, joint: Joint) -> Array:
    """Follow the joint of a plate in the air on which a box of so many kg lies; 0: there is none."""
    plate = Body.of("plate", Box((0.05, 0.05, 0.01)), _AIR, mass=_PLATE_KG, color=_GREY)
    bodies = [plate]
    if load_kg:
        above = np.add(_AIR, (0.0, 0.0, 0.0202))
        box = Box((0.03, 0.03, 0.03))
        bodies.append(Body.of("load", box, above, mass=load_kg, color=_GREY))

    played = watch(simulator, Scene(tuple(bodies), (joint,)), 1.5, settle_s=0.3)
    return np.asarray(played.states.joint("j").position)


def _check_together(states: State) -> None:
    """Check that bodies are where their joints' values and their parents have them: they have no other motion."""
    for name, placed in states.joints.items():
        value = states.joint(name).position
        parent = states.placement(placed.joint.parent)
        due = placed.carry(value, np.zeros_like(value), parent)
        position = states.position(placed.joint.body)
        what = f"where the body of joint {name!r} is, m"
        near(what, position, due.position, 0.001)
