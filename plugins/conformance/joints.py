"""Check joints of tools and of scenes: they swing, spring, slide, stop, latch and follow drives as formulas say."""

from __future__ import annotations

import numpy as np

from core.interfaces import Simulator
from core.scene import Body, Joint, Scene, State
from plugins.conformance.cases import play
from plugins.conformance.checking import between, near
from plugins.conformance.releases import (
    ACROSS,
    BLOCK,
    POST,
    RELEASES,
    ROD_END,
    ROD_M,
    TOP,
    make_rod,
    tool_with,
)
from plugins.conformance.worlds import film, wait


def check_joints_of_tools_move_as_formulas_say(simulator: Simulator) -> None:
    """The arm holds them; they are held until the motion begins."""
    for case in RELEASES:
        tool = tool_with(case.joint)
        outcome = wait(
            simulator, tool=tool, seconds=case.seconds, settle_s=0.2, record_hz=100
        )
        recording = film(outcome)
        what = f"a {case.joint.kind} of a tool that {case.what}, rad or m"
        near(what, recording.fingers[:, -1], case.follow(recording.times), case.within)


def check_joints_of_scenes_move_as_formulas_say(simulator: Simulator) -> None:
    """A hinge's rod hangs from a fixed body that it overlaps."""
    for case in RELEASES:
        bodies: tuple[Body, ...] = (BLOCK,)
        if case.joint.kind == "hinge":
            bodies = (POST, make_rod("rod", case.joint.start))

        played = play(simulator, Scene(bodies, (case.joint,)), case.seconds)
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
    states = play(simulator, Scene((top, bottom), (hinge, ball)), 2.0).states
    fastest = states.linear_velocities.max()
    between("the largest speed of a chain that swings, m/s", fastest, 1.0)

    for number in range(0, 200, 10):
        upper = states[number].pose("upper")
        lower = states[number].pose("lower")
        near("where the top of a chain is, m", upper.apply(ROD_END), TOP, 0.001)
        middle = upper.apply(np.negative(ROD_END))
        near("where the middle of a chain is, m", lower.apply(ROD_END), middle, 0.001)


def _check_together(states: State) -> None:
    """Check that bodies are where their joints' values and their parents have them: they have no other motion."""
    for name, placed in states.joints.items():
        value = states.joint(name).position
        parent = states.placement(placed.joint.parent)
        due = placed.carry(value, np.zeros_like(value), parent)
        position = states.position(placed.joint.body)
        what = f"where the body of joint {name!r} is, m"
        near(what, position, due.position, 0.001)
