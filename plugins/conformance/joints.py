"""Check joints of tools and of scenes: they swing, spring, slide, stop, latch and follow drives as formulas say.

Covered by `tests/plugins/simulators/test_conformance.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from scipy.special import ellipk

from core.design import RIGID_MOUNT, Component, Tool, ToolJoint
from core.errors import UserError
from core.geometry import Array, Box, Pose
from core.interfaces import Rollout, Simulator
from core.scene import Body, Drive, Joint, Latch, Scene, State, table
from core.values.joints import rotate
from plugins.conformance.checking import LeftOut, expect
from plugins.conformance.worlds import BARE, FAR, GRAVITY, GREY, Bodies, cube, end, film, move, still, wait

_JAW, _GAP, _THICK = 0.12, 0.034, 0.006  # of tongs: length, distance and thickness of the jaws


@dataclass(frozen=True)
class Rod:
    """A rod that hangs from a hinge at its upper end; metres and kilograms."""

    length: float
    width: float
    mass: float

    @property
    def inertia(self) -> float:
        """The moment of inertia about the hinge, kg m^2."""
        return self.mass * (self.length**2 + self.width**2) / 12 + self.mass * (self.length / 2) ** 2

    @property
    def weight(self) -> float:
        """The torque about the hinge, over the sine of the tilt, N m."""
        return self.mass * GRAVITY * self.length / 2

    def swing_s(self, tilt: float) -> float:
        """Compute the period of the rod that is let go at an angle, s."""
        return 4 * math.sqrt(self.inertia / self.weight) * float(ellipk(math.sin(tilt / 2) ** 2))


RODS = {"tool": Rod(0.2, 0.01, 0.1), "scene": Rod(0.4, 0.02, 0.5)}
BLOCKS_KG = {"tool": 0.2, "scene": 1.0}
_ROD, _TOP = RODS["scene"], np.array([FAR[0], FAR[1], 1.0])


def hinged(tilt: float, joint: ToolJoint) -> Tool:
    """A post with a rod on a hinge at its side, the rod turned by ``tilt`` radians about x from hanging straight."""
    post, rod = (
        Component("post", RIGID_MOUNT, Pose(np.array([0.0, 0.0, -0.05])), Box((0.03, 0.02, 0.1)), 0.05),
        RODS["tool"],
    )
    middle = (0.02, rod.length / 2 * math.sin(tilt), -0.05 - rod.length / 2 * math.cos(tilt))
    at, size = Pose.xyz_rpy(middle, (tilt, 0.0, 0.0)), Box((rod.width, rod.width, rod.length))
    return Tool((post, Component("rod", "post", at, size, rod.mass, joint=joint)))


def hinge(lower: float = -3.0, upper: float = 3.0, **resisting: float) -> ToolJoint:
    return ToolJoint("hinge", (1.0, 0.0, 0.0), lower, upper, (0.0, 0.0, RODS["tool"].length / 2), **resisting)


def sliding(joint: ToolJoint) -> Tool:
    """A post with a block of 0.2 kg beside it that slides up and down."""
    post = Component("post", RIGID_MOUNT, Pose(np.array([0.0, 0.0, -0.1])), Box((0.02, 0.02, 0.2)), 0.05)
    block = Component("block", "post", Pose(np.array([0.025, 0.0, 0.0])), Box((0.03, 0.03, 0.03)), 0.2, joint=joint)
    return Tool((post, block))


def tongs(lower: float = 0.0) -> Tool:
    """Two sprung jaws that hang from a bar, 34 mm apart, their ends bent outward; they close as far as ``lower``."""
    bar = Component("bar", RIGID_MOUNT, Pose(np.array([0.0, 0.0, -0.012])), Box((0.04, 0.06, 0.016)), 0.03)
    components = [bar]
    for name, side in (("left", 1.0), ("right", -1.0)):
        at = Pose(np.array([0.0, side * (_GAP + _THICK) / 2, -0.008 - _JAW / 2]))
        joint = ToolJoint("hinge", (side, 0, 0), lower, 1.0, (0, 0, _JAW / 2), 0.01, 0.0, 0.5, -0.4)
        components.append(Component(name, "bar", at, Box((0.03, _THICK, _JAW)), 0.03, joint=joint))
        bent = Pose.xyz_rpy((0.0, side * 0.006, -_JAW / 2 - 0.005), (side * 0.8, 0.0, 0.0))
        components.append(Component(f"{name}_end", name, bent, Box((0.03, 0.003, 0.02)), 0.005))
    return Tool(tuple(components))


def _near(found: float, due: float, what: str, unit: str, share: float = 0.02) -> None:
    expect(abs(found / due - 1) < share, f"{what}: {found:.4f} {unit} instead of {due:.4f} {unit}")


def _period(times: Array, values: Array) -> float:
    down = np.flatnonzero(np.diff(np.sign(values)))
    crossings = times[down] - values[down] * np.diff(times)[down] / np.diff(values)[down]
    return 2 * float(np.diff(crossings).mean())


def _rod(name: str, tilt: float, top: Array = _TOP) -> Body:
    """A rod that hangs from ``top``, turned by ``tilt`` radians about x from hanging straight."""
    pose = Pose.xyz_rpy(top, (tilt, 0.0, 0.0)) @ Pose(np.array([0.0, 0.0, -_ROD.length / 2]))
    size = Box((_ROD.width, _ROD.width, _ROD.length))
    return Body.of(name, size, pose.position, mass=_ROD.mass, color=GREY, rpy=(tilt, 0.0, 0.0))


def _pivot(name: str, body: str, parent: str | None = None, kind: str = "hinge", **more: float) -> Joint:
    return Joint(name, kind, body, parent, (1.0, 0.0, 0.0), (0.0, 0.0, _ROD.length / 2), **more)  # type: ignore[arg-type]


def _block(joint: Joint, mass: float = 1.0) -> Scene:
    """A block high above the ground that slides as ``joint`` says."""
    return Scene((cube("block", (FAR[0], FAR[1], 2.0), mass=mass),), (joint,))


def _play(simulator: Simulator, scene: Scene, seconds: float, settle_s: float = 0.0) -> tuple[Array, State]:
    """Let the arm wait beside a scene: instants (T,), and the states there."""
    task = Bodies(*scene.bodies, joints=scene.joints)
    try:
        (outcome,) = simulator.rollout(task, [Rollout(BARE, still(), 0, settle_s, seconds, 100.0)])
    except UserError as error:
        raise LeftOut(str(error)) from error
    expect(outcome.error is None, f"a rollout broke: {outcome.error}")
    taken = film(outcome)
    return taken.times, scene.complete(taken.states)


def _held(simulator: Simulator, tool: Tool, seconds: float, settle_s: float = 0.0) -> tuple[Array, Array]:
    """Let the arm hold a tool with one joint: instants (T,), and the joint's values (T,)."""
    bodies = cube(at=(3, 3, 5))
    recording = film(wait(simulator, bodies, tool=tool, seconds=seconds, settle_s=settle_s, record_hz=100))
    return recording.times, recording.fingers[:, -1]


def _swing(simulator: Simulator, where: str, tilt: float, seconds: float, **joint: Any) -> tuple[Array, Array]:
    """Let go a rod of a tool or a scene at an angle: instants (T,), and how far it turned from there (T,)."""
    if where == "tool":
        return _held(simulator, hinged(tilt, hinge(**joint)), seconds)
    times, states = _play(simulator, Scene((_rod("rod", tilt),), (_pivot("pivot", "rod", **joint),)), seconds)
    return times, states.joint("pivot").position


def _slide(simulator: Simulator, where: str, seconds: float, **joint: Any) -> tuple[Array, Array]:
    """Let go a block of a tool or a scene that slides up and down: instants (T,), and how far it went (T,)."""
    if where == "tool":
        made = ToolJoint("slider", (0.0, 0.0, 1.0), **{"lower": -0.3, "upper": 0.3} | joint)
        return _held(simulator, sliding(made), seconds)
    times, states = _play(simulator, _block(Joint("s", "slider", "block", **joint)), seconds)
    return times, states.joint("s").position


def check_rod_swings_in_its_period(simulator: Simulator) -> None:
    """A rod on a hinge swings between equal angles, in the time that its inertia gives it."""
    for (where, rod), tilt in product(RODS.items(), (0.5, 1.2)):
        times, values = _swing(simulator, where, tilt, 2.5)
        due = rod.swing_s(tilt)
        _near(_period(times, values + tilt), due, f"a rod of a {where} on a hinge swings in", "s")
        lowest = float(values[times < due].min())
        expect(abs(lowest + 2 * tilt) < 0.1 * tilt, f"let go at {tilt} rad a rod swings to {-lowest - tilt:.3f} rad")


def check_block_rings_down_on_a_spring_and_a_damper(simulator: Simulator) -> None:
    """It moves as the damped oscillator does, and rests where the spring bears its weight; friction may be tiny."""
    springs = (("tool", 60.0, 2.0, 0.0), ("tool", 60.0, 2.0, 1e-4), ("scene", 40.0, 3.0, 0.0))
    for where, stiffness, damping, friction in springs:
        spring = {"stiffness": stiffness, "damping": damping, "friction": friction, "rest": 0.05}
        times, values = _slide(simulator, where, 4.0, **spring)
        mass = BLOCKS_KG[where]
        rate, ratio, sag = (
            math.sqrt(stiffness / mass),
            damping / 2 / math.sqrt(stiffness * mass),
            mass * GRAVITY / stiffness,
        )
        ringing = rate * math.sqrt(1 - ratio**2)
        left = np.cos(ringing * times) + ratio * rate / ringing * np.sin(ringing * times)
        off = np.abs(values - (0.05 - sag) * (1 - np.exp(-ratio * rate * times) * left))
        what = f"a block of a {where} on a spring and a damper, that sags by {1000 * sag:.1f} mm, is"
        expect(off.max() < 0.04 * sag, f"{what} up to {1000 * off.max():.1f} mm from the formula")
        expect(off[-1] < 0.02 * sag, f"{what} {1000 * off[-1]:.2f} mm away at the end")


def check_joints_are_held_until_the_motion_begins(simulator: Simulator) -> None:
    """A spring that is far from relaxed, and a weight, move nothing while the scene settles."""
    for tool in (hinged(1.2, hinge(stiffness=3.0, rest=2.0)), sliding(ToolJoint("slider", (0.0, 0.0, 1.0), -0.3, 0.3))):
        times, values = _held(simulator, tool, 0.3, settle_s=0.5)
        before = float(np.abs(values[times < 1e-6]).max())
        expect(before < 1e-3, f"a tool's joint moved by {before:.4f} before the motion began")
        expect(abs(values[-1]) > 0.1, "a held joint of a tool is not let go when the motion begins")


def check_joint_stops_at_its_limits(simulator: Simulator) -> None:
    for where in RODS:
        for name, play, low in (("hinge", partial(_swing, tilt=0.8), -0.2), ("slider", _slide, -0.05)):
            _, values = play(simulator, where, seconds=2.0, lower=low, upper=1.0)
            expect(values.min() > 1.2 * low, f"a {name} of a {where} that ends at {low} got to {values.min():.4f}")
            off = abs(values[-1] - low)
            expect(off < 0.05 * -low, f"what leans on the limit {low} of a {where}'s {name} is at {values[-1]:.4f}")


def check_dry_friction_holds_up_to_its_limit(simulator: Simulator) -> None:
    """Friction that is a fifth too small lets a rod down, one that is a fifth larger holds it; a block likewise."""
    for where, rod in RODS.items():
        torque, weight = rod.weight * math.sin(0.5), BLOCKS_KG[where] * GRAVITY
        _, values = _swing(simulator, where, 0.5, 2.0, friction=1.2 * torque)
        expect(
            abs(values[-1]) < 0.01,
            f"friction of a {where} that should hold a rod lets it down by {-values[-1]:.3f} rad",
        )
        _, values = _swing(simulator, where, 0.5, 2.0, friction=0.8 * torque)
        swings = np.linspace(0.0, 1.0, 20001)
        left = rod.weight * (np.cos(0.5 - swings) - math.cos(0.5)) - 0.8 * torque * swings  # energy, after a swing
        due = float(swings[np.flatnonzero(left > 0)[-1]])
        _near(-values[-1], due, f"a rod of a {where} on a tight hinge falls by", "rad", 0.05)
        _, values = _slide(simulator, where, 1.0, friction=1.05 * weight)
        crept = float(np.abs(values).max())
        expect(crept < 0.002, f"friction of a {where} that should hold a block lets it creep by {1000 * crept:.1f} mm")
        times, values = _slide(simulator, where, 0.3, friction=0.5 * weight)
        _near(-float(values[-1]), GRAVITY / 4 * times[-1] ** 2, f"against friction a block of a {where} slid", "m")


def check_jaws_stop_at_each_other(simulator: Simulator) -> None:
    """Two sprung jaws close until their ends meet; Bullet lets links of one tool sink 5 mm into each other."""
    recording = film(wait(simulator, cube(at=(3, 3, 5)), tool=tongs(lower=-0.5), seconds=1.0, record_hz=100))
    turned = recording.fingers[-1, -2:]
    apart = float((_GAP / 2 + _THICK / 2 * (1 - np.cos(turned)) + _JAW * np.sin(turned)).sum())
    expect(-0.006 < apart < 0.002, f"two sprung jaws that meet are {1000 * apart:.1f} mm apart")


def check_sprung_tongs_pick_up_a_cube(simulator: Simulator) -> None:
    """Tongs that are narrower than a cube open when they are pressed over it, hold it, and lift it."""
    small = cube(at=(0.5, 0.0, 0.02), side=0.04, mass=0.05)
    plan = [[0.5, 0, z, 0, 0, 0] for z in (0.45, 0.162, 0.162, 0.4)]
    height = end(move(simulator, plan, table(), small, tool=tongs(), hold_s=1.0)).position("cube")[2]
    expect(height > 0.2, f"sprung tongs that went down over a cube and up again left it at {height:.3f} m")


def check_ball_joint_swings_and_stays_together(simulator: Simulator) -> None:
    due = _ROD.swing_s(1.0)
    times, states = _play(simulator, Scene((_rod("rod", 1.0),), (_pivot("ball", "rod", kind="ball"),)), 3.0)
    sideways = states.position("rod")[:, 1] - _TOP[1]
    _near(_period(times, sideways), due, "a rod on a ball joint swings in", "s")
    _near(float(states.joint("ball").position.max()), 2.0, "let go at 1 rad, it turns by", "rad", 0.03)
    _together(states)


def check_chain_keeps_its_energy(simulator: Simulator) -> None:
    """Two rods in a row swing wildly; their joints stay together, and their energy is what it was."""
    top = _rod("upper", 1.5)
    bottom = _rod("lower", 2.0, top.pose.apply([0.0, 0.0, -_ROD.length / 2]))
    scene = Scene((top, bottom), (_pivot("a", "upper"), _pivot("b", "lower", "upper")))
    _, states = _play(simulator, scene, 2.0)
    inertia = _ROD.inertia - _ROD.mass * (_ROD.length / 2) ** 2
    moving = 0.5 * _ROD.mass * (states.linear_velocities**2).sum(axis=(1, 2))
    turning = 0.5 * inertia * (states.angular_velocities**2).sum(axis=(1, 2))
    energy = moving + turning + _ROD.mass * GRAVITY * (states.positions[..., 2] - _TOP[2]).sum(axis=1)
    lost = float(np.abs(energy - energy[0]).max() / np.ptp(moving + turning))
    expect(lost < 0.03, f"a double pendulum gains or loses {lost:.1%} of its energy")
    _together(states)


def _together(states: State, most: float = 0.001) -> None:
    """Check that the two ends of each joint are at one place, and that a slider or hinge has no other motion."""
    for name, placed in states.joints.items():
        body, parent = (states.placement(who) for who in (placed.joint.body, placed.joint.parent))
        value = states.joint(name).position
        if placed.joint.kind == "ball":
            origin = np.asarray(placed.joint.origin)
            there = body.position + rotate(body.quaternion, origin)
            due = parent.position + rotate(parent.quaternion, placed.origin)
        else:
            there, due = body.position, placed.carry(value, np.zeros_like(value), parent).position
        apart = float(np.linalg.norm(there - due, axis=-1).max())
        expect(apart < most, f"the two bodies of joint {name!r} come apart by {1000 * apart:.2f} mm")


def check_latch_opens_at_its_force(simulator: Simulator) -> None:
    """A damped block of 1 kg hangs from a latch of 1.03 times its weight, and slips out of one of 0.97."""
    for share, held in ((1.03, True), (0.97, False)):
        latch = Latch(0.0, share * GRAVITY, 0.02)
        joint = Joint("s", "slider", "block", lower=-0.5, upper=0.5, damping=100.0, latches=(latch,))
        _, states = _play(simulator, _block(joint), 3.0)
        hangs = -float(states.joint("s").position[-1])
        if held:
            due = latch.width / math.pi * math.asin(1 / share)
            expect(abs(hangs - due) < 0.001, f"a latch holds a block at {hangs:.4f} m instead of {due:.4f} m")
        expect(held or hangs > 0.05, f"a latch holds 1/{share} of its force, {1000 * hangs:.0f} mm from its place")


def check_drive_keeps_its_schedule(simulator: Simulator) -> None:
    """A gate waits until the motion begins, follows its drive, and begins again."""
    drive = Drive((0.0, 0.5, 1.0), (0.1, 0.3, 0.1), 200.0, repeats=True)
    for kind in ("slider", "hinge"):
        joint = Joint("gate", kind, "block", axis=(0, 0, 1), start=0.1, drive=drive)
        times, states = _play(simulator, _block(joint), 2.0, settle_s=0.3)
        found = states.joint("gate").position
        lag = 0.4 / 50.0  # m or rad: what the slowest servo that is allowed trails behind at its speed
        off = float(np.abs(found - drive.sample(times)).max())
        expect(off < lag + 0.004, f"a driven {kind} is up to {off:.4f} from its schedule")


def check_joined_bodies_pass_and_others_stop(simulator: Simulator) -> None:
    """A drawer that overlaps its cabinet rests; two flaps of one post that swing at each other meet."""
    cabinet = cube("cabinet", (FAR[0], FAR[1], 1.0), side=0.3, mass=0.0)
    drawer = cube("drawer", (FAR[0] + 0.1, FAR[1], 1.0), side=0.2)
    _, states = _play(simulator, Scene((cabinet, drawer), (Joint("s", "slider", "drawer", "cabinet", (1, 0, 0)),)), 1.0)
    moved = float(np.abs(states.joint("s").position).max())
    expect(moved < 0.001, f"a drawer that overlaps its cabinet is pushed out by {1000 * moved:.1f} mm")
    flaps = [
        _rod(name, tilt, _TOP + np.array([0.0, side * 0.03, 0.0]))
        for name, tilt, side in (("a", 1.0, 1), ("b", -1.0, -1))
    ]
    joints = (_pivot("pa", "a", "post", damping=0.05), _pivot("pb", "b", "post", damping=0.05))
    _, states = _play(simulator, Scene((cube("post", tuple(_TOP), mass=0.0), *flaps), joints), 3.0)
    apart = states.position("a")[:, 1] - states.position("b")[:, 1]
    expect(
        float(apart.min()) > _ROD.width - 0.004,
        f"two flaps of one post pass {1000 * apart.min():.0f} mm through each other",
    )


def check_free_mechanism_rests(simulator: Simulator) -> None:
    """Two bars with a hinge between them lie on a table, and stay as they are."""
    bar = Box((0.3, 0.03, 0.02))
    bodies = [Body.of(name, bar, (0.6, 0.0, z), mass=0.2, color=GREY) for name, z in (("low", 0.01), ("high", 0.03))]
    bodies[1] = replace(bodies[1], pose=Pose.xyz_rpy((0.6, 0.0, 0.0305), (0.0, 0.0, 0.5)))
    scene = Scene((table(), *bodies), (Joint("pin", "hinge", "high", "low"),))
    _, states = _play(simulator, scene, 2.0)
    moved = float(np.linalg.norm(states.positions - states.positions[0], axis=-1).max())
    turned = float(np.ptp(states.joint("pin").position))
    expect(
        moved < 0.002 and turned < 0.01, f"scissors that lie on a table move {1000 * moved:.1f} mm, {turned:.3f} rad"
    )


def check_launched_body_flies(simulator: Simulator) -> None:
    """A cube rests until the motion begins; then it flies along its parabola and spins as it was told."""
    thrown = replace(cube("cube", (FAR[0], FAR[1], 0.0501)), velocity=(1.0, 0.5, 3.0), spin=(0.0, 0.0, 4.0))
    slab = Body.of("slab", Box((1.0, 1.0, 0.1)), (FAR[0], FAR[1], -0.05), mass=0.0, color=GREY)
    times, states = _play(simulator, Scene((slab, thrown)), 0.5, settle_s=0.3)
    places, flying = states.position("cube"), times >= 0
    rest = float(np.abs(places[~flying] - places[0]).max())
    expect(rest < 0.001, f"a cube that is launched at 0 s moves by {1000 * rest:.1f} mm before")
    t = times[flying][:, None]
    due = places[flying][0] + np.array([1.0, 0.5, 3.0]) * t - [0, 0, GRAVITY / 2] * t**2
    off = float(np.abs(places[flying] - due).max())
    expect(off < 0.02 * 1.5, f"a launched cube is up to {1000 * off:.0f} mm from its parabola")
    _near(float(states.angular_velocities[-1, 0, 2]), 4.0, "a launched cube spins at", "rad/s")
