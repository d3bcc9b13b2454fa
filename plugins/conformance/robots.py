"""Check a robot: its numbers are physical, its kinematics hold, and every engine here can move it.

Poses are drawn from fixed seeds, so that a verdict stays.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.interfaces import (
    JointTrajectory,
    Robot,
    Rollout,
    Simulator,
    Waypoints,
)
from core.robot.description import assembled
from core.robot.kinematics import arm_of
from core.robot.solids import robot_solids
from core.robot.trajectory import plan_motion
from plugins.conformance.sample_tools import box
from plugins.conformance.shared import between, near, simulators
from plugins.conformance.worlds import Bodies, Film, play

# The radius of gyration of a link, about the middle of its collision shapes, is at most this many diagonals of the box
# around them. Of the default arm's links, whose identified inertias shift mass between neighbours, one has over 1.1.
_SPREAD = 1.5
_ARM_KINDS = ("revolute", "prismatic")
_WHOLE = 0.02  # radians between the axes of the mount at home and the world's
_ROOM = 0.01  # radians between home and the limits
_LINES = 200
_LINE_M = (0.3, 0.4, 0.3)  # the farthest end of a line from home, by axis
_LINE_RAD = (0.4, 0.8, 0.8)
_YAW_RAD = (0.0, 0.0, 0.8)  # of arms with fewer joints than a pose has numbers
_POSE = 6
_KNOTS = 33  # of a line, some 2 cm apart, as in motions
_REACHED = (0.003, 0.02)  # m, and radians
# As for the default robot in every engine.
_LAG_RAD = 0.02
_END_M = 1e-3
_REST_RAD = 2e-3
_LEAST_REACHED = 0.4  # of lines around home


def check_limits_are_there(robot: Robot) -> None:
    for name in robot.joints(robot.gripper is not None):
        joint = robot.description.named[name]
        kinds = ("prismatic",) if name in robot.finger_joints else _ARM_KINDS
        assert joint.kind in kinds, (
            f"joint {name!r} is {joint.kind}; it must be {' or '.join(kinds)}, with limits"
        )
        low, high, effort, speed = np.array(joint.limits, dtype=np.float64)
        what = f"joint {name!r} can't move: {joint.limits}"
        assert low < high, what
        assert min(effort, speed) > 0, what


def check_home_points_the_mount_down(robot: Robot) -> None:
    """At home the joints are within their limits, and the mount's axes are the base's."""
    arm = arm_of(robot)
    for name, low, here, high in zip(
        robot.arm_joints, arm.lower, arm.home, arm.upper, strict=True
    ):
        between(
            f"home of {name!r} within its limits, rad", here, low + _ROOM, high - _ROOM
        )

    turn = robot.base.rotation.inv() * arm.forward(arm.home).rotation
    between(
        "the turn of the mount at home from the base's axes, rad",
        turn.magnitude(),
        high=_WHOLE,
    )


def check_inertias_are_physical(robot: Robot) -> None:
    solids = robot_solids(robot, robot.gripper is not None)
    for name, link in assembled(robot).links.items():
        mass, center, tensor = link.inertial.placed()
        bounds = [solid.bounds() for solid in solids if solid.name == name]
        assert bool(mass) == bool(bounds), (
            f"link {name!r} has {mass:g} kg and {len(bounds)} shapes; give it both"
        )
        if not mass:
            continue

        moments = np.linalg.eigvalsh(tensor)
        written = ", ".join(f"{moment:g}" for moment in moments)
        what = f"inertias {written} of {name!r}: no body has"
        assert moments[0] > 0, what
        assert moments[0] + moments[1] >= moments[2] * (1 - 1e-6), what

        middles, halves = np.swapaxes(bounds, 0, 1)
        low = np.min(middles - halves, axis=0)
        high = np.max(middles + halves, axis=0)
        away = np.linalg.norm(center - (low + high) / 2)
        spread = np.sqrt(moments[2] / mass + away**2)
        most = _SPREAD * float(np.linalg.norm(high - low))
        between(
            f"how far the mass of {name!r} lies from the middle of its shapes on average, m",
            spread,
            high=most,
        )


def check_straight_lines_are_reached(robot: Robot) -> str:
    """The arm reaches a share of the lines around its home, as far as they can be followed."""
    arm = arm_of(robot)
    home = arm.forward(arm.home)
    turns = _LINE_RAD if len(arm.home) >= _POSE else _YAW_RAD
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(_LINES):
        way = rng.uniform(-1, 1, 3) * _LINE_M
        turn = rng.uniform(-1, 1, 3) * turns
        share = np.linspace(0.0, 1.0, _KNOTS)[1:, None]
        positions = home.position + share * way
        rotations = Rotation.from_rotvec(share * turn) * home.rotation
        _, errors = arm.follow(positions, rotations.as_matrix(), arm.home)
        reached = np.all(errors < _REACHED, axis=1)
        shares.append(np.argmin([*reached, False]) / len(reached))

    mean = float(np.mean(shares))
    mend = "choose a home away from limits and from an outstretched arm"
    between(
        f"the share of lines around home that is reached ({mend})", mean, _LEAST_REACHED
    )

    return f"{mean:.0%} of lines reached"


def check_every_engine_tracks_a_trajectory(robot: Robot) -> str:
    """Without contact the arm follows a motion with the error that simulators are allowed for the default robot."""
    lags = []
    for name, simulator in _engines():
        lag = follow(simulator, robot, f"in {name} ")
        lags.append(f"{name} {lag:.4f} rad")

    return ", ".join(lags)


def follow(simulator: Simulator, robot: Robot, where: str = "") -> float:
    """Check that the arm follows a motion around its home without contact; return its largest lag, radians."""
    arm = arm_of(robot)
    home = arm.forward(arm.home)
    plan = np.array([[0.1, 0.2, -0.2, 0, 0.3, 0], [0.0, -0.2, -0.1, 0, 0, 0.5]])
    plan[:, :3] += home.position
    way = plan_motion(Waypoints(plan), home, arm).trajectory
    played = _play(simulator, robot, Tool(), way, 0.5)
    targets, _ = way.sample(played.times)
    joints = played.recording.arm
    lag = float(np.abs(joints - targets).max())
    between(f"{where}how far the arm is off its trajectory, rad", lag, high=_LAG_RAD)
    error = played.outcome.tracking_error_rad
    near(f"{where}the tracking error, rad", error, lag, max(2e-3, 0.5 * lag))
    end = arm.forward(joints[-1]).position
    near(f"{where}where the end-effector ends, m", end, plan[-1, :3], _END_M)

    return lag


def check_every_engine_holds_the_arm_at_home(robot: Robot) -> str:
    """It holds the bare arm, and the payload; the payload's centre is 5 cm below the flange."""
    weight = box("weight", (0.1, 0.1, 0.1), (0.0, 0.0, -0.05), mass=robot.payload_kg)
    loaded = f"the arm with {robot.payload_kg:g} kg"
    sags = []
    for what, tool in (("the bare arm", Tool()), (loaded, Tool((weight,)))):
        for name, simulator in _engines():
            sag = hold(simulator, robot, tool, f"in {name} {what}")
            sags.append(f"{name} {what} {sag:.5f} rad")

    return ", ".join(sags)


def hold(simulator: Simulator, robot: Robot, tool: Tool, what: str) -> float:
    """Check that the arm stays at home with a tool; return by how much it sags, radians."""
    home = arm_of(robot).home
    way = JointTrajectory(np.zeros(1), home[None], np.array([robot.opening_m]))
    played = _play(simulator, robot, tool, way, 3.0)
    sag = float(np.abs(played.recording.arm - home).max())
    between(f"by how much {what} sags at home, rad", sag, high=_REST_RAD)
    return sag


@lru_cache(maxsize=1)
def _engines() -> tuple[tuple[str, Simulator], ...]:
    """Make every engine that is installed and plays one job at a time."""
    found = tuple(named for named in simulators() if named[1].batch == 1)
    assert found, "no simulator plays one job at a time; a check needs one"
    return found


def _play(
    simulator: Simulator,
    robot: Robot,
    tool: Tool,
    way: JointTrajectory,
    hold_s: float,
) -> Film:
    task = Bodies(robot=robot)
    task.home = arm_of(robot).forward(arm_of(robot).home)  # type: ignore[misc]  # a class variable elsewhere
    job = Rollout(tool, way, 0, 0.1, hold_s, 100.0)
    return Film(task.scene(0), play(simulator, task, job))
