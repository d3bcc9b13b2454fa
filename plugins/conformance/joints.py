"""Check joints of tools and of scenes: they swing, spring, slide, stop, latch and follow drives as formulas say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.integrate import quad
from scipy.special import ellipk

from core.design import RIGID_MOUNT, Component, Tool, ToolJoint
from core.geometry import Array, Box, Pose
from core.interfaces import Rollout, Simulator
from core.scene import Body, Drive, Joint, Latch, Scene, State, table
from core.values.joints import rotate
from plugins.conformance.checking import expect
from plugins.conformance.worlds import BARE, FAR, GRAVITY, GREY, cube, end, film, move, near, run, still, wait

_LENGTH, _MASS = 0.2, 0.1  # of a tool's rod that hangs from its end
_INERTIA = _MASS * (_LENGTH**2 + 0.01**2) / 12 + _MASS * (_LENGTH / 2) ** 2  # about that end
_WEIGHT = _MASS * GRAVITY * _LENGTH / 2  # times the sine of its tilt: the torque about its end
_ROD_M, _ROD_KG, _WIDE = 0.4, 0.5, 0.02  # of a scene's rod, as above
_ROD_INERTIA = _ROD_KG * (_ROD_M**2 + _WIDE**2) / 12 + _ROD_KG * (_ROD_M / 2) ** 2
_ROD_WEIGHT = _ROD_KG * GRAVITY * _ROD_M / 2
_TOP = np.array([FAR[0], FAR[1], 1.0])
_JAW, _GAP, _THICK = 0.12, 0.034, 0.006  # of tongs: length, distance and thickness of the jaws


def hinged(tilt: float, joint: ToolJoint) -> Tool:
    """A post with a rod on a hinge at its side, the rod turned by ``tilt`` radians about x from hanging straight."""
    post = Component("post", RIGID_MOUNT, Pose(np.array([0.0, 0.0, -0.05])), Box((0.03, 0.02, 0.1)), 0.05)
    middle = (0.02, _LENGTH / 2 * math.sin(tilt), -0.05 - _LENGTH / 2 * math.cos(tilt))
    at, size = Pose.xyz_rpy(middle, (tilt, 0.0, 0.0)), Box((0.01, 0.01, _LENGTH))
    return Tool((post, Component("rod", "post", at, size, _MASS, joint=joint)))


def hinge(lower: float = -3.0, upper: float = 3.0, **resisting: float) -> ToolJoint:
    return ToolJoint("hinge", (1.0, 0.0, 0.0), lower, upper, (0.0, 0.0, _LENGTH / 2), **resisting)


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


def _period(times: Array, values: Array) -> float:
    down = np.flatnonzero(np.diff(np.sign(values)))
    crossings = times[down] - values[down] * np.diff(times)[down] / np.diff(values)[down]
    return 2 * float(np.diff(crossings).mean())


def _swing_s(inertia: float, weight: float, tilt: float) -> float:
    """Compute the period of a pendulum that is let go at an angle, s."""
    return 4 * math.sqrt(inertia / weight) * float(ellipk(math.sin(tilt / 2) ** 2))


def _values(simulator: Simulator, tool: Tool, seconds: float) -> tuple[Array, Array]:
    """Let the arm hold a tool with one joint: instants (T,), and the joint's values (T,)."""
    recording = film(wait(simulator, cube(at=(3, 3, 5)), tool=tool, seconds=seconds, record_hz=100))
    return recording.times, recording.fingers[:, -1]


def check_pendulum_swings_in_its_period(simulator: Simulator) -> None:
    """A rod on a hinge swings between equal angles, in the time that its inertia gives it."""
    for tilt in (0.5, 1.2):
        times, values = _values(simulator, hinged(tilt, hinge()), 2.0)
        due = _swing_s(_INERTIA, _WEIGHT, tilt)
        near(_period(times, values + tilt), due, "a rod on a hinge swings in", "s")
        lowest = float(values[times < due].min())
        expect(abs(lowest + 2 * tilt) < 0.1 * tilt, f"let go at {tilt} rad a rod swings to {-lowest - tilt:.3f} rad")


def check_spring_sags_and_holds(simulator: Simulator) -> None:
    """A spring and a damper hold a rod where torques balance, and a block where forces do."""
    for friction in (0.0, 1e-4):
        joint = hinge(stiffness=0.5, damping=0.02, rest=0.3, friction=friction)
        _, values = _values(simulator, hinged(0.5, joint), 4.0)
        turned = np.linspace(-3, 3, 60001)
        due = float(turned[np.abs(0.5 * (0.3 - turned) - _WEIGHT * np.sin(0.5 + turned)).argmin()])
        near(values[-1] - 0.3, due - 0.3, "a rod on a spring rests away from where it is relaxed by", "rad")
    spring = ToolJoint("slider", (0.0, 0.0, 1.0), -0.08, 0.08, stiffness=60.0, damping=2.0)
    _, values = _values(simulator, sliding(spring), 2.0)
    near(values[-1], -0.2 * GRAVITY / 60.0, "a block on a spring sags by", "m")


def check_joints_are_held_until_the_motion_begins(simulator: Simulator) -> None:
    """A spring that is far from relaxed, and a weight, move nothing while the scene settles."""
    for tool in (hinged(1.2, hinge(stiffness=3.0, rest=2.0)), sliding(ToolJoint("slider", (0.0, 0.0, 1.0), -0.3, 0.3))):
        recording = film(wait(simulator, cube(at=(3, 3, 5)), tool=tool, seconds=0.3, settle_s=0.5, record_hz=100))
        before = float(np.abs(recording.fingers[recording.times < 1e-6, -1]).max())
        expect(before < 1e-3, f"a tool's joint moved by {before:.4f} before the motion began")
        expect(abs(recording.fingers[-1, -1]) > 0.1, "a held joint of a tool is not let go when the motion begins")


def check_joint_stops_at_its_limits(simulator: Simulator) -> None:
    _, values = _values(simulator, hinged(0.8, hinge(lower=-0.2)), 2.0)
    expect(values.min() > -0.23, f"a hinge that ends at -0.2 rad got to {values.min():.3f} rad")
    expect(abs(values[-1] + 0.2) < 0.005, f"a rod that leans on a limit of -0.2 rad is at {values[-1]:.3f} rad")
    _, values = _values(simulator, sliding(ToolJoint("slider", (0.0, 0.0, 1.0), -0.05, 0.05)), 1.0)
    expect(values.min() > -0.055, f"a slider that ends at -0.05 m got to {values.min():.4f} m")
    expect(abs(values[-1] + 0.05) < 0.001, f"a block that hangs at a limit of -0.05 m is at {values[-1]:.4f} m")


def check_dry_friction_holds_up_to_its_limit(simulator: Simulator) -> None:
    """Friction that is a fifth too small lets a rod down; one that is a fifth larger holds it."""
    torque = _WEIGHT * math.sin(0.5)
    _, values = _values(simulator, hinged(0.5, hinge(friction=1.2 * torque)), 2.0)
    expect(abs(values[-1]) < 0.01, f"friction that should hold a rod lets it down by {-values[-1]:.3f} rad")
    _, values = _values(simulator, hinged(0.5, hinge(friction=0.8 * torque)), 2.0)
    swings = np.linspace(0.0, 1.0, 20001)
    left = _WEIGHT * (np.cos(0.5 - swings) - math.cos(0.5)) - 0.8 * torque * swings  # energy, after so much swing
    due = float(swings[np.flatnonzero(left > 0)[-1]])
    near(-values[-1], due, "a rod on a tight hinge falls by", "rad", 0.05)


def check_damper_slows(simulator: Simulator) -> None:
    """A block on a damper sinks at the speed at which the damper bears its weight."""
    times, values = _values(simulator, sliding(ToolJoint("slider", (0.0, 0.0, 1.0), -0.3, 0.3, damping=15.0)), 1.5)
    late = times > 0.5
    speed = -float(np.polyfit(times[late], values[late], 1)[0])
    near(speed, 0.2 * GRAVITY / 15.0, "a block on a damper sinks at", "m/s")


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


def _rod(name: str, tilt: float, top: Array = _TOP) -> Body:
    """A rod that hangs from ``top``, turned by ``tilt`` radians about x from hanging straight."""
    pose = Pose.xyz_rpy(top, (tilt, 0.0, 0.0)) @ Pose(np.array([0.0, 0.0, -_ROD_M / 2]))
    return Body.of(name, Box((_WIDE, _WIDE, _ROD_M)), pose.position, mass=_ROD_KG, color=GREY, rpy=(tilt, 0.0, 0.0))


def _pivot(name: str, body: str, parent: str | None = None, kind: str = "hinge", **more: float) -> Joint:
    return Joint(name, kind, body, parent, (1.0, 0.0, 0.0), (0.0, 0.0, _ROD_M / 2), **more)  # type: ignore[arg-type]


def _block(joint: Joint, mass: float = 1.0) -> Scene:
    """A block high above the ground that slides as ``joint`` says."""
    return Scene((cube("block", (FAR[0], FAR[1], 2.0), mass=mass),), (joint,))


def _play(simulator: Simulator, scene: Scene, seconds: float, settle_s: float = 0.0) -> tuple[Array, State]:
    """Let the arm wait beside a scene: instants (T,), and the states there."""
    taken = film(run(simulator, scene.bodies, Rollout(BARE, still(), 0, settle_s, seconds, 100.0), scene.joints))
    return taken.times, scene.complete(taken.states)


def check_hinged_body_swings_in_its_period(simulator: Simulator) -> None:
    """A rod on a hinge of the world, and on one of a fixed body that it overlaps."""
    due = _swing_s(_ROD_INERTIA, _ROD_WEIGHT, 1.0)
    post = cube("post", tuple(_TOP), mass=0.0)
    for bodies, parent in (((), None), ((post,), "post")):
        joint = _pivot("pivot", "rod", parent, start=1.0)
        times, states = _play(simulator, Scene((*bodies, _rod("rod", 1.0)), (joint,)), 3.0)
        angles, speeds = states.joint("pivot")
        near(_period(times, angles), due, "a rod on a hinge swings in", "s")
        near(float(-angles[times < due].min()), 1.0, "let go at 1 rad, it swings as far as", "rad", 0.03)
        rates = np.gradient(angles, times)[1:-1]
        wrong = float(np.abs(rates - speeds[1:-1]).max() / np.abs(rates).max())
        expect(wrong < 0.05, f"a hinge's speed is not the rate of its angle: {wrong:.0%} of the highest speed")


def check_ball_joint_swings_and_stays_together(simulator: Simulator) -> None:
    due = _swing_s(_ROD_INERTIA, _ROD_WEIGHT, 1.0)
    times, states = _play(simulator, Scene((_rod("rod", 1.0),), (_pivot("ball", "rod", kind="ball"),)), 3.0)
    sideways = states.position("rod")[:, 1] - _TOP[1]
    near(_period(times, sideways), due, "a rod on a ball joint swings in", "s")
    near(float(states.joint("ball").position.max()), 2.0, "let go at 1 rad, it turns by", "rad", 0.03)
    _together(states)


def check_chain_keeps_its_energy(simulator: Simulator) -> None:
    """Two rods in a row swing wildly; their joints stay together, and their energy is what it was."""
    top = _rod("upper", 1.5)
    bottom = _rod("lower", 2.0, top.pose.apply([0.0, 0.0, -_ROD_M / 2]))
    scene = Scene((top, bottom), (_pivot("a", "upper"), _pivot("b", "lower", "upper")))
    _, states = _play(simulator, scene, 2.0)
    inertia = _ROD_INERTIA - _ROD_KG * (_ROD_M / 2) ** 2
    moving = 0.5 * _ROD_KG * (states.linear_velocities**2).sum(axis=(1, 2))
    turning = 0.5 * inertia * (states.angular_velocities**2).sum(axis=(1, 2))
    energy = moving + turning + _ROD_KG * GRAVITY * (states.positions[..., 2] - _TOP[2]).sum(axis=1)
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


def check_spring_and_damper_ring_down(simulator: Simulator) -> None:
    """A block on a horizontal spring and damper moves as the damped oscillator does."""
    mass, stiffness, damping, away = 1.0, 40.0, 3.0, 0.2
    joint = Joint("s", "slider", "block", axis=(0, 1, 0), start=away, stiffness=stiffness, damping=damping)
    times, states = _play(simulator, _block(joint, mass), 2.0)
    rate, ratio = math.sqrt(stiffness / mass), damping / 2 / math.sqrt(stiffness * mass)
    ringing = rate * math.sqrt(1 - ratio**2)
    due = away * np.exp(-ratio * rate * times)
    due *= np.cos(ringing * times) + ratio * rate / ringing * np.sin(ringing * times)
    off = float(np.abs(states.joint("s").position - due).max())
    expect(off < 0.02 * away, f"a block on a spring and a damper is up to {1000 * off:.1f} mm from the formula")


def check_joint_friction_holds_and_gives(simulator: Simulator) -> None:
    """A block on a sloping slider stays below the friction's force; above, the difference accelerates it."""
    axis = (math.cos(0.3), 0.0, -math.sin(0.3))
    pull = GRAVITY * math.sin(0.3)  # of 1 kg
    hold = Joint("s", "slider", "block", axis=axis, friction=1.05 * pull)
    _, states = _play(simulator, _block(hold), 1.0)
    crept = float(np.abs(states.joint("s").position).max())
    expect(crept < 0.002, f"friction that should hold a block lets it creep by {1000 * crept:.1f} mm in a second")
    times, states = _play(simulator, _block(replace(hold, friction=0.5 * pull)), 1.0)
    near(float(states.joint("s").position[-1]), 0.25 * pull * times[-1] ** 2, "against friction a block slid", "m")


def check_door_falls_shut_and_stops(simulator: Simulator) -> None:
    """A flap that was held up falls in the time of its equation of motion, and rests at its limit."""
    rod = _rod("rod", 0.9)
    joint = _pivot("pivot", "rod", lower=0.2, upper=1.5, start=0.9)
    times, states = _play(simulator, Scene((rod,), (joint,)), 2.0)
    angles = states.joint("pivot").position

    first = int(np.flatnonzero(angles < 0.21)[0])
    found = float(np.interp(-0.21, -angles[: first + 1], times[: first + 1]))
    rate = 2 * _ROD_WEIGHT / _ROD_INERTIA
    due, _ = quad(lambda angle: 1 / math.sqrt(rate * (math.cos(angle) - math.cos(0.9))), 0.21, 0.9)
    near(found, due, "a flap falls in", "s")
    expect(angles.min() > 0.16, f"a hinge that ends at 0.2 rad got to {angles.min():.3f} rad")
    expect(abs(angles[-1] - 0.2) < 0.01, f"a flap that leans on its limit of 0.2 rad is at {angles[-1]:.3f} rad")


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


def check_limit_and_side_load_hold(simulator: Simulator) -> None:
    """A slider holds a load across its axis, and hangs at its limit."""
    joint = Joint("s", "slider", "block", axis=(0, 0.6, 0.8), lower=-0.1, upper=0.1)
    _, states = _play(simulator, _block(joint, 2.0), 1.5)
    value = float(states.joint("s").position[-1])
    expect(abs(value + 0.1) < 0.002, f"a block that hangs at a limit of -0.1 m is at {value:.4f} m")
    _together(states)


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
        float(apart.min()) > _WIDE - 0.004, f"two flaps of one post pass {1000 * apart.min():.0f} mm through each other"
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
    near(float(states.angular_velocities[-1, 0, 2]), 4.0, "a launched cube spins at", "rad/s")
