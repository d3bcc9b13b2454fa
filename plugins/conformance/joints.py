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
from core.scene import Body, Drive, Joint, Latch, Scene, State, table
from plugins.conformance.cases import Case, Measure, compare, play
from plugins.conformance.checking import between, near
from plugins.conformance.worlds import FAR, GRAVITY, box, cube, end, film, ground, make_body, move, wait

_TOP = np.array([FAR[0], FAR[1], 1.0])  # of a scene's rod that hangs
_JAW, _GAP, _THICK = 0.12, 0.034, 0.006  # of tongs: length, distance and thickness of the jaws
_STEP_S = 1e-4  # of the equation of motion


@dataclass(frozen=True)
class Rod:
    """A rod that hangs from its end."""

    length: float
    width: float
    mass: float

    @property
    def inertia(self) -> float:
        """About its end, kg m^2."""
        return self.mass * ((self.length**2 + self.width**2) / 12 + (self.length / 2) ** 2)

    @property
    def weight(self) -> float:
        """The torque about its end where it is level, N m."""
        return self.mass * GRAVITY * self.length / 2


_TOOL_ROD, _SCENE_ROD = Rod(0.2, 0.01, 0.1), Rod(0.4, 0.02, 0.5)
_BLOCK_KG = 0.2


@dataclass(frozen=True)
class Release:
    """A joint that is let go: weight pulls at what it bears, and a spring, a damper and dry friction resist.

    Attributes:
        what: it does, in words.
        joint: its stiffness, damping and friction are multiples of the weight, N, or N m of a level rod. A hinge
            bears a rod that is tilted by ``start`` from hanging straight.
        seconds: how long it is played.
        within: the largest distance from the equation of motion at any time, rad or m.
    """

    what: str
    joint: Joint
    seconds: float
    within: float

    def follow(self, rate: float, times: Array) -> Array:
        """Integrate the equation of motion from rest; how far the joint is from its start, (T,).

        Args:
            rate: weight over inertia, 1/s^2 or m/s^2.
            times: (T,); before 0 it is held.
        """
        joint = self.joint
        value, speed = joint.start, 0.0
        values = [value]
        most = joint.friction * rate * _STEP_S  # that friction changes the speed by in a step
        for _ in range(round(self.seconds / _STEP_S)):
            pull = -math.sin(value) if joint.kind == "hinge" else -1.0
            resisting = joint.stiffness * (joint.rest - value) - joint.damping * speed
            speed += rate * (pull + resisting) * _STEP_S
            speed -= min(max(speed, -most), most)
            value += speed * _STEP_S
            if not joint.lower <= value <= joint.upper:
                value = min(max(value, joint.lower), joint.upper)
                speed = 0.0
            values.append(value)
        return np.interp(times, np.arange(len(values)) * _STEP_S, values) - joint.start


def _hinge(start: float, lower: float = -3.0, upper: float = 3.0, **resisting: Any) -> Joint:
    """A hinge of a scene's rod, at its upper end, on a post."""
    end = (0.0, 0.0, _SCENE_ROD.length / 2)
    return Joint("pivot", "hinge", "rod", "post", (1.0, 0.0, 0.0), end, lower, upper, start, **resisting)


def _slider(lower: float = -3.0, **resisting: Any) -> Joint:
    """A slider of a scene's block, which leans: it holds a load across its axis."""
    return Joint("slider", "slider", "block", axis=(0.0, 0.6, 0.8), lower=lower, upper=3.0, **resisting)


_TORQUE = math.sin(0.5)  # of a rod's weight, where it is tilted by 0.5 rad
RELEASES = [
    Release("swings", _hinge(0.5), 2.0, 0.1),
    Release("swings widely", _hinge(1.2), 2.0, 0.2),
    Release("is on a spring and a damper", _hinge(0.5, stiffness=5.0, damping=0.2, rest=0.8), 2.0, 0.02),
    Release("is on a strong spring", _hinge(0.5, stiffness=30.0, damping=2.0, rest=1.5), 0.5, 0.05),
    Release("stops at its limit", _hinge(0.8, lower=0.6), 2.0, 0.04),
    Release("is held by friction", _hinge(0.5, friction=1.2 * _TORQUE), 2.0, 0.01),
    Release("is slowed by friction", _hinge(0.5, friction=0.8 * _TORQUE), 2.0, 0.02),
    Release("rings down on a spring and a damper", _slider(stiffness=30.0, damping=1.0), 1.5, 0.003),
    Release("sinks on a damper", _slider(damping=7.6), 1.5, 0.01),
    Release("stops at its limit", _slider(lower=-0.05), 1.0, 0.005),
    Release("is held by friction", _slider(friction=1.05), 1.0, 0.002),
    Release("is slowed by friction", _slider(friction=0.5), 0.3, 0.01),
]


def _weighing(joint: Joint, weight: float) -> dict[str, Any]:
    """What resists at a joint that bears this weight, N or N m."""
    return {name: getattr(joint, name) * weight for name in ("stiffness", "damping", "friction")}


def hinged(tilt: float, joint: ToolJoint) -> Tool:
    """A post with a rod on a hinge at its side, the rod turned by ``tilt`` radians about x from hanging straight."""
    post = box("post", (0.03, 0.02, 0.1), (0.0, 0.0, -0.05), mass=0.05)
    half = _TOOL_ROD.length / 2
    at = Pose.xyz_rpy((0.02, half * math.sin(tilt), -0.05 - half * math.cos(tilt)), (tilt, 0.0, 0.0))
    size = Box((_TOOL_ROD.width, _TOOL_ROD.width, _TOOL_ROD.length))
    return Tool((post, Component("rod", "post", at, size, _TOOL_ROD.mass, joint=joint)))


def hinge(lower: float = -3.0, upper: float = 3.0, **resisting: Any) -> ToolJoint:
    return ToolJoint("hinge", (1.0, 0.0, 0.0), lower, upper, (0.0, 0.0, _TOOL_ROD.length / 2), **resisting)


def sliding(joint: ToolJoint) -> Tool:
    """A post with a block of 0.2 kg beside it that slides up and down."""
    post = box("post", (0.02, 0.02, 0.2), (0.0, 0.0, -0.1), mass=0.05)
    block = box("block", (0.03, 0.03, 0.03), (0.025, 0.0, 0.0), "post", mass=_BLOCK_KG, joint=joint)
    return Tool((post, block))


def tongs(lower: float = 0.0) -> Tool:
    """Two sprung jaws that hang from a bar, 34 mm apart, their ends bent outward; they close as far as ``lower``."""
    bar = box("bar", (0.04, 0.06, 0.016), (0.0, 0.0, -0.012), mass=0.03)
    components = [bar]
    for name, side in (("left", 1.0), ("right", -1.0)):
        at = (0.0, side * (_GAP + _THICK) / 2, -0.008 - _JAW / 2)
        joint = ToolJoint("hinge", (side, 0, 0), lower, 1.0, (0, 0, _JAW / 2), 0.01, 0.0, 0.5, -0.4)
        components.append(box(name, (0.03, _THICK, _JAW), at, "bar", mass=0.03, joint=joint))
        bent = Pose.xyz_rpy((0.0, side * 0.006, -_JAW / 2 - 0.005), (side * 0.8, 0.0, 0.0))
        components.append(Component(f"{name}_end", name, bent, Box((0.03, 0.003, 0.02)), 0.005))
    return Tool(tuple(components))


def _tool(joint: Joint) -> tuple[float, Tool]:
    """A tool with a joint like a scene's; weight over inertia, and the tool."""
    places: dict[str, Any] = {name: getattr(joint, name) - joint.start for name in ("lower", "upper", "rest")}
    if joint.kind == "hinge":
        held = hinge(**places, **_weighing(joint, _TOOL_ROD.weight))
        return _TOOL_ROD.weight / _TOOL_ROD.inertia, hinged(joint.start, held)
    weighing = _weighing(joint, _BLOCK_KG * GRAVITY)
    return GRAVITY, sliding(ToolJoint("slider", (0.0, 0.0, 1.0), **places, **weighing))


def check_joints_of_tools_move_as_formulas_say(simulator: Simulator) -> None:
    """The arm holds them; they are held until the motion begins."""
    for case in RELEASES:
        rate, tool = _tool(case.joint)
        afar = cube(at=(3, 3, 5))
        recording = film(wait(simulator, afar, tool=tool, seconds=case.seconds, settle_s=0.2, record_hz=100))
        due = case.follow(rate, recording.times)
        what = f"a {case.joint.kind} of a tool that {case.what}, rad or m"
        near(what, recording.fingers[:, -1], due, case.within)
        settling = recording.fingers[recording.times < -1e-6, -1]
        near(f"{what}, before the motion begins", settling, 0.0, 1e-3)


def check_sprung_tongs_pick_up_a_cube(simulator: Simulator) -> None:
    """Tongs that are narrower than a cube open when they are pressed over it, hold it, and lift it."""
    small = cube(at=(0.5, 0.0, 0.02), side=0.04, mass=0.05)
    plan = [[0.5, 0, z, 0, 0, 0] for z in (0.45, 0.162, 0.162, 0.4)]
    lifted = end(move(simulator, plan, table(), small, tool=tongs(), hold_s=1.0)).position("cube")[2]
    between("the height of a cube after sprung tongs went down over it and up, m", lifted, 0.2)


def _rod(name: str, tilt: float, top: Array = _TOP) -> Body:
    """A rod that hangs from ``top``, turned by ``tilt`` radians about x from hanging straight."""
    pose = Pose.xyz_rpy(top, (tilt, 0.0, 0.0)) @ Pose(np.array([0.0, 0.0, -_SCENE_ROD.length / 2]))
    size = Box((_SCENE_ROD.width, _SCENE_ROD.width, _SCENE_ROD.length))
    return make_body(name, size, pose.position, mass=_SCENE_ROD.mass, rpy=(tilt, 0.0, 0.0))


def _on_its_own(name: str, parent: str | None = None, **more: Any) -> Joint:
    """A hinge at the upper end of the rod of this name, without a range."""
    return replace(_hinge(0.0, -math.inf, math.inf), name=name, body=name, parent=parent, **more)


_POST = cube("post", tuple(_TOP), mass=0.0)
_BLOCK = cube("block", (FAR[0], FAR[1], 2.0))  # of 1 kg, high above the ground


def check_joints_of_scenes_move_as_formulas_say(simulator: Simulator) -> None:
    """A hinge's rod hangs from a fixed body that it overlaps."""
    for case in RELEASES:
        if case.joint.kind == "hinge":
            rate = _SCENE_ROD.weight / _SCENE_ROD.inertia
            joint = replace(case.joint, **_weighing(case.joint, _SCENE_ROD.weight))
            scene = Scene((_POST, _rod("rod", joint.start)), (joint,))
        else:
            rate = 0.8 * GRAVITY  # along the slider that leans
            scene = Scene((_BLOCK,), (replace(case.joint, **_weighing(case.joint, rate)),))
        played = play(simulator, scene, case.seconds)
        found = played.states.joint(case.joint.name)
        moved = found.position - case.joint.start
        what = f"a {case.joint.kind} of a scene that {case.what}, rad or m"
        near(what, moved, case.follow(rate, played.times), case.within)
        if not case.joint.damping:  # SAPIEN's reported speed of a strongly damped joint is too low
            near(f"{what}: the sum of its speeds", np.trapezoid(found.speed, played.times), moved[-1], case.within)
        _check_together(played.states)


def check_ball_joint_swings_and_stays_together(simulator: Simulator) -> None:
    swing = Release("swings", _hinge(1.0), 3.0, 0.1)
    played = play(simulator, Scene((_rod("rod", 1.0),), (_on_its_own("rod", kind="ball"),)), swing.seconds)
    due = swing.follow(_SCENE_ROD.weight / _SCENE_ROD.inertia, played.times)
    near("the turn of a rod that swings on a ball joint, rad", played.states.joint("rod").position, -due, swing.within)
    lever = played.states.position("rod") - _TOP
    half = _SCENE_ROD.length / 2
    near("where the middle of a rod on a ball joint swings, y in m", lever[:, 1], half * np.sin(1.0 + due), 0.02)
    near("how far the middle of a rod is from its ball joint, m", np.linalg.norm(lever, axis=-1), half, 0.001)


def check_chain_keeps_its_energy(simulator: Simulator) -> None:
    """Two rods in a row swing wildly; their joints stay together, and their energy is what it was."""
    top = _rod("upper", 1.5)
    bottom = _rod("lower", 2.0, top.pose.apply([0.0, 0.0, -_SCENE_ROD.length / 2]))
    scene = Scene((top, bottom), (_on_its_own("upper"), _on_its_own("lower", "upper")))
    states = play(simulator, scene, 2.0).states

    inertia = _SCENE_ROD.inertia - _SCENE_ROD.mass * (_SCENE_ROD.length / 2) ** 2  # about its middle
    twice = _SCENE_ROD.mass * states.linear_velocities**2 + inertia * states.angular_velocities**2
    moving = twice.sum(axis=(1, 2)) / 2
    energy = moving + _SCENE_ROD.mass * GRAVITY * states.positions[..., 2].sum(axis=1)
    near("the energy of a double pendulum, J", energy, energy[0], 0.03 * np.ptp(moving))
    _check_together(states)


def _check_together(states: State) -> None:
    """Check that bodies are where their joints' values and their parents have them: they have no other motion."""
    for name, placed in states.joints.items():
        value = states.joint(name).position
        due = placed.carry(value, np.zeros_like(value), states.placement(placed.joint.parent))
        near(f"where the body of joint {name!r} is, m", states.position(placed.joint.body), due.position, 0.001)


def _value(joint: str) -> Measure:
    """A joint's value at the end, m or rad."""
    return lambda played: played.states.joint(joint).position[-1]


@compare
def check_latch_opens_at_its_force() -> Iterator[Case]:
    """A latch of 1.03 times a block's weight holds it, where its force is the weight; one of 0.97 lets it go."""
    width = 0.02
    hangs = -width / math.pi * math.asin(1 / 1.03)
    for share, due, within in ((1.03, hangs, 0.001), (0.97, -0.275, 0.225)):
        latch = Latch(0.0, share * GRAVITY, width)
        joint = Joint("s", "slider", "block", lower=-0.5, upper=0.5, damping=100.0, latches=(latch,))
        what = f"where a block hangs from a latch of {share} times its weight, m"
        yield Case(what, (_BLOCK,), _value("s"), due, within, 3.0, (joint,))


def check_drive_keeps_its_schedule(simulator: Simulator) -> None:
    """A gate waits until the motion begins, follows its drive, and begins again."""
    drive = Drive((0.0, 0.5, 1.0), (0.1, 0.3, 0.1), 200.0, repeats=True)
    lag = 0.4 / 50.0  # m or rad: what the slowest servo that is allowed trails behind at its speed
    for kind in ("slider", "hinge"):
        joint = replace(Joint("gate", "slider", "block", start=0.1, drive=drive), kind=kind)
        played = play(simulator, Scene((_BLOCK,), (joint,)), 2.0, settle_s=0.3)
        found = played.states.joint("gate").position
        near(f"where a driven {kind} is, rad or m", found, drive.sample(played.times), lag + 0.004)


def check_joined_bodies_pass_and_others_stop(simulator: Simulator) -> None:
    """Two flaps of one post, which they overlap, swing at each other and meet."""
    flaps = [_rod(name, side, _TOP + np.array([0.0, side * 0.03, 0.0])) for name, side in (("a", 1.0), ("b", -1.0))]
    joints = tuple(_on_its_own(name, "post", damping=0.05) for name in ("a", "b"))
    states = play(simulator, Scene((_POST, *flaps), joints), 3.0).states
    apart = states.position("a")[:, 1] - states.position("b")[:, 1]
    between("the distance of two flaps of one post, m", apart.min(), _SCENE_ROD.width - 0.004)


def check_launched_body_flies(simulator: Simulator) -> None:
    """A cube rests until the motion begins; then it flies along its parabola and spins as it was told."""
    velocity = np.array([1.0, 0.5, 3.0])
    thrown = replace(cube("cube", (FAR[0], FAR[1], 0.0501)), velocity=tuple(velocity), spin=(0.0, 0.0, 4.0))
    played = play(simulator, Scene((ground(), thrown)), 0.5, settle_s=0.3)

    flight = np.maximum(played.times, 0.0)[:, None]
    due = thrown.pose.position + velocity * flight + [0, 0, -GRAVITY / 2] * flight**2
    near("where a cube is that is launched at 0 s, m", played.states.position("cube"), due, 0.03)
    near("the spin of a launched cube, rad/s", played.states.angular_velocities[-1, 0], (0.0, 0.0, 4.0), 0.08)
