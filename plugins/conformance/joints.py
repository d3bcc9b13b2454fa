"""Check tools with joints: they swing, spring, slide, stop and hold as formulas say, and are recorded.

Covered by `tests/plugins/simulators/test_conformance.py`.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ellipk

from core.design import RIGID_MOUNT, Component, Tool, ToolJoint
from core.geometry import Array, Box, Pose
from core.interfaces import Simulator
from core.scene import table
from plugins.conformance.checking import expect
from plugins.conformance.worlds import GRAVITY, cube, end, film, move, wait

_LENGTH, _MASS = 0.2, 0.1  # of a rod that hangs from its end
_INERTIA = _MASS * (_LENGTH**2 + 0.01**2) / 12 + _MASS * (_LENGTH / 2) ** 2
_JAW, _GAP, _THICK = 0.12, 0.034, 0.006  # of tongs: length, distance and thickness of the jaws
_WEIGHT = _MASS * GRAVITY * _LENGTH / 2  # times the sine of its tilt: the torque about its end


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


def _values(simulator: Simulator, tool: Tool, seconds: float) -> tuple[Array, Array]:
    """Let the arm hold a tool with one joint: instants (T,), and the joint's values (T,)."""
    recording = film(wait(simulator, cube(at=(3, 3, 5)), tool=tool, seconds=seconds, record_hz=100))
    return recording.times, recording.fingers[:, -1]


def check_pendulum_swings_in_its_period(simulator: Simulator) -> None:
    """A rod on a hinge swings between equal angles, in the time that its inertia gives it."""
    for tilt in (0.5, 1.2):
        times, values = _values(simulator, hinged(tilt, hinge()), 2.0)
        down = np.flatnonzero(np.diff(np.sign(values + tilt)))
        crossings = times[down] - (values + tilt)[down] * np.diff(times)[down] / np.diff(values)[down]
        period = 2 * float(np.diff(crossings).mean())
        due = 4 * math.sqrt(_INERTIA / _WEIGHT) * float(ellipk(math.sin(tilt / 2) ** 2))
        expect(abs(period / due - 1) < 0.02, f"a rod on a hinge swings in {period:.3f} s instead of {due:.3f} s")
        lowest = float(values[times < period].min())
        expect(abs(lowest + 2 * tilt) < 0.1 * tilt, f"let go at {tilt} rad a rod swings to {-lowest - tilt:.3f} rad")


def check_spring_sags_and_holds(simulator: Simulator) -> None:
    """A spring and a damper hold a rod where torques balance, and a block where forces do."""
    for friction in (0.0, 1e-4):
        joint = hinge(stiffness=0.5, damping=0.02, rest=0.3, friction=friction)
        _, values = _values(simulator, hinged(0.5, joint), 4.0)
        turned = np.linspace(-3, 3, 60001)
        due = float(turned[np.abs(0.5 * (0.3 - turned) - _WEIGHT * np.sin(0.5 + turned)).argmin()])
        found = f"a rod on a spring rests at {values[-1]:.4f} rad instead of {due:.4f} rad"
        expect(abs(values[-1] - due) < 0.02 * abs(due - 0.3), found)
    spring = ToolJoint("slider", (0.0, 0.0, 1.0), -0.08, 0.08, stiffness=60.0, damping=2.0)
    _, values = _values(simulator, sliding(spring), 2.0)
    due = -0.2 * GRAVITY / 60.0
    expect(abs(values[-1] / due - 1) < 0.02, f"a block on a spring sags by {values[-1]:.4f} m instead of {due:.4f} m")


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
    found = f"a rod on a tight hinge falls by {-values[-1]:.3f} rad instead of {due:.3f} rad"
    expect(abs(-values[-1] / due - 1) < 0.05, found)


def check_damper_slows(simulator: Simulator) -> None:
    """A block on a damper sinks at the speed at which the damper bears its weight."""
    times, values = _values(simulator, sliding(ToolJoint("slider", (0.0, 0.0, 1.0), -0.3, 0.3, damping=15.0)), 1.5)
    late = times > 0.5
    speed = -float(np.polyfit(times[late], values[late], 1)[0])
    due = 0.2 * GRAVITY / 15.0
    expect(abs(speed / due - 1) < 0.02, f"a block on a damper sinks at {speed:.4f} m/s instead of {due:.4f} m/s")


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
