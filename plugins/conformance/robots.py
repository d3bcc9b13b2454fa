"""Check a robot: its numbers are physical, its kinematics hold, and every engine here can move it.

Poses are drawn from fixed seeds, so that a verdict stays.
"""

from __future__ import annotations

from collections import defaultdict
from functools import lru_cache
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array
from core.interfaces import JointTrajectory, Outcome, Robot, Rollout, Simulator
from core.robot.description import assembled
from core.robot.kinematics import Arm, arm_of, link_poses, robot_model
from core.robot.solids import Solid, robot_solids, signed_distance
from core.robot.trajectory import plan_motion
from core.solids.self_collision import DEEP_M
from plugins.conformance.checking import between, expect, near, simulators
from plugins.conformance.worlds import Bodies, box, film, play

# The radius of gyration of a link is at most this many diagonals of the box around its collision shapes. Of the
# default arm's links, whose identified inertias shift mass between neighbours, the first has 1.15.
_SPREAD = 1.5
_WHOLE = 0.02  # radians between the axes of the mount at home and the world's
_ROOM = 0.01  # radians between home and the limits
_POSES = 500
_OFF = 0.1  # radians that inverse kinematics starts from a solution: some 2 cm, as in motions
_LINES = 200
_LINE_M, _LINE_RAD = (0.3, 0.4, 0.3), (0.4, 0.8, 0.8)  # the farthest end of a line from home, by axis
_STEP_M, _STEP_RAD = 0.02, 0.1  # between knots, as in motions
_REACHED = (0.003, 0.02)  # m, and radians
_SAME_RAD = 0.5  # joints in one posture
_LAG_RAD, _END_M, _REST_RAD = 0.02, 1e-3, 2e-3  # as for the default robot in every engine
_LEAST = 0.99  # of poses
_LEAST_LINES = 0.98
_LEAST_REACHED = 0.4  # of lines around home


def check_limits_are_there(robot: Robot) -> None:
    driven = robot.joints(robot.gripper is not None)
    joints = robot.description.named
    for name in driven:
        expect(name in joints, f"the description has no joint {name!r}")
        joint = joints[name]
        kind = "prismatic" if name in robot.finger_joints else "revolute"
        expect(joint.kind == kind, f"joint {name!r} is {joint.kind}; it must be {kind}, with limits")
        low, high, effort, speed = np.array(joint.limits, dtype=np.float64)
        expect(low < high, f"joint {name!r} has no limits: it turns from {low} to {high}")
        expect(speed > 0 and effort > 0, f"joint {name!r} has the speed {speed} and the effort {effort}")
    more = sorted(name for name, joint in joints.items() if joint.kind != "fixed" and name not in driven)
    expect(not more, f"joints {', '.join(map(repr, more))} move, and are neither the arm's nor the gripper's")


def check_home_points_the_mount_down(robot: Robot) -> None:
    """At home the joints are within their limits, and the mount's axes are the base's."""
    arm = arm_of(robot)
    for name, low, here, high in zip(robot.arm_joints, arm.lower, arm.home, arm.upper, strict=True):
        between(f"home of {name!r} within its limits, rad", here, low + _ROOM, high - _ROOM)
    turn = robot.base.rotation.inv() * arm.forward(arm.home).rotation
    between("the turn of the mount at home from the base's axes, rad", turn.magnitude(), high=_WHOLE)


def check_inertias_are_physical(robot: Robot) -> None:
    corners: defaultdict[str, list[Array]] = defaultdict(list)
    for solid in robot_solids(robot, robot.gripper is not None):
        center, half = solid.bounds()
        corners[solid.name] += [center - half, center + half]
    for name, link in assembled(robot).links.items():
        mass, center, tensor = link.inertial.placed()
        count = len(corners[name]) // 2
        expect((mass > 0) == (count > 0), f"link {name!r} has {mass:g} kg and {count} collision shapes; give it both")
        if not mass:
            continue
        moments = np.linalg.eigvalsh(tensor)
        real = moments[0] > 0 and moments[0] + moments[1] >= moments[2] * (1 - 1e-6)
        expect(real, f"inertias {', '.join(map('{:g}'.format, moments))} of {name!r}: no body has")
        low, high = np.min(corners[name], axis=0), np.max(corners[name], axis=0)
        size = float(np.linalg.norm(high - low))
        spread = float(np.sqrt(moments[2] / mass))
        between(f"how far the mass of {name!r} lies from its centre on average, m", spread, high=_SPREAD * size)
        away = float(np.linalg.norm(center - (low + high) / 2))
        between(f"how far the centre of the mass of {name!r} lies from the middle of its shapes, m", away, high=size)


def check_collision_shapes_are_read_by_every_engine(robot: Robot) -> None:
    for link in robot.description.links.values():
        for shape in link.collisions:
            if isinstance(shape.shape, Path):
                readable = shape.shape.suffix.lower() in (".stl", ".obj")
                expect(readable, f"engines can't read {shape.shape}; convert it to STL")
                expect(min(shape.scale) > 0, f"{shape.shape} has the scale {list(shape.scale)}")


def check_shapes_are_clear_of_each_other_at_home(robot: Robot) -> None:
    """Convex hulls of links that three joints or more separate don't overlap at home; limits keep the others apart."""
    gripper = robot.gripper is not None
    model = robot_model(robot, Tool(gripper=gripper))
    poses = link_poses(robot, gripper, arm_of(robot).home)
    for one, other in combinations(robot_solids(robot, gripper), 2):
        before, behind = (model.supports[model.links[solid.name][0]] for solid in (one, other))
        if len(before ^ behind) < 3:
            continue
        here, there = (Solid(solid.name, solid.geometry, poses[solid.name] @ solid.pose) for solid in (one, other))
        deep = -signed_distance(here, there)
        between(f"how far {one.name!r} is inside {other.name!r} at home, m", deep, high=DEEP_M)


def check_inverse_kinematics_converges(robot: Robot) -> str:
    """From joints near a solution, as in motions, it finds one for 99 % of poses drawn in the joints' ranges."""
    arm = arm_of(robot)
    rng = np.random.default_rng(0)
    found = 0
    for _ in range(_POSES):
        joints = rng.uniform(arm.lower, arm.upper)
        start = joints + rng.uniform(-_OFF, _OFF, len(joints))
        solution = arm.inverse(arm.forward(joints), np.clip(start, arm.lower, arm.upper))
        found += solution.error_m < 1e-4 and solution.error_rad < 1e-3
    between(f"how many of {_POSES} reachable poses inverse kinematics finds", found, _LEAST * _POSES)
    return f"{found} of {_POSES}"


def check_posture_stays_along_straight_lines(robot: Robot) -> str:
    """On lines from home, as far as they are reached, and back, the arm does not change its posture."""
    rng = np.random.default_rng(0)
    followed = np.array([_follow_line(arm_of(robot), rng) for _ in range(_LINES)])
    reached, turned = followed.T
    share = float(reached.mean())
    mend = "choose a home away from limits and from an outstretched arm"
    between(f"the share of lines around home that is reached ({mend})", share, _LEAST_REACHED)
    same = np.count_nonzero(turned < _SAME_RAD)
    between(f"from how many of {_LINES} lines the arm comes back in its posture", same, _LEAST_LINES * _LINES)
    return f"{share:.0%} of lines reached, back in the same posture from {same} of {_LINES}"


def _follow_line(arm: Arm, rng: np.random.Generator) -> tuple[float, float]:
    """Follow a line that is drawn, as far as it is reached, and come back.

    Returns:
        The share that is reached, and the largest difference from the joints at home after coming back, rad.
    """
    home = arm.forward(arm.home)
    way = rng.uniform(-1, 1, 3) * _LINE_M
    turn = Rotation.from_euler("xyz", rng.uniform(-1, 1, 3) * _LINE_RAD)
    steps = int(np.ceil(max(np.linalg.norm(way) / _STEP_M, turn.magnitude() / _STEP_RAD)))
    share = np.linspace(0.0, 1.0, steps + 1)[:, None]
    positions = home.position + share * way
    rotations = (Rotation.from_rotvec(share * turn.as_rotvec()) * home.rotation).as_matrix()

    joints, errors = arm.follow(positions[1:], rotations[1:], arm.home)
    reached = np.all(errors < _REACHED, axis=1)
    count = int(np.argmin([*reached, False]))
    end = joints[count - 1] if count else arm.home
    back, _ = arm.follow(positions[count::-1], rotations[count::-1], end)
    return count / steps, np.abs(back[-1] - arm.home).max()


def check_every_engine_tracks_a_trajectory(robot: Robot) -> str:
    """Without contact the arm follows a motion with the error that simulators are allowed for the default robot."""
    return ", ".join(f"{name} {follow(simulator, robot, f'in {name} '):.4f} rad" for name, simulator in _engines())


def follow(simulator: Simulator, robot: Robot, where: str = "") -> float:
    """Check that the arm follows a motion around its home without contact; return its largest lag, radians."""
    arm = arm_of(robot)
    home = arm.forward(arm.home)
    plan = np.array([[0.1, 0.2, -0.2, 0, 0.3, 0], [0.0, -0.2, -0.1, 0, 0, 0.5]])
    plan[:, :3] += home.position
    planned = plan_motion(plan, home, arm)
    between("by how much the arm misses a motion around its home, m", planned.ik_error_m, high=1e-3)
    outcome = _play(simulator, robot, Tool(), planned.trajectory, 0.5)
    recording = film(outcome)
    targets, _ = planned.trajectory.sample(recording.times)
    lag = float(np.abs(recording.arm - targets).max())
    between(f"{where}how far the arm is off its trajectory, rad", lag, high=_LAG_RAD)
    near(f"{where}the tracking error, rad", outcome.tracking_error_rad, lag, max(2e-3, 0.5 * lag))
    near(f"{where}where the end-effector ends, m", arm.forward(recording.arm[-1]).position, plan[-1, :3], _END_M)
    return lag


def check_every_engine_holds_the_arm_at_home(robot: Robot) -> str:
    """It holds the bare arm, and the payload; the payload's centre is 5 cm below the flange."""
    weight = box("weight", (0.1, 0.1, 0.1), (0.0, 0.0, -0.05), mass=robot.payload_kg)
    tools = {"the bare arm": Tool(), f"the arm with {robot.payload_kg:g} kg": Tool((weight,))}
    sags = []
    for what, tool in tools.items():
        for name, simulator in _engines():
            sag = hold(simulator, robot, tool, f"in {name} {what}")
            sags.append(f"{name} {what} {sag:.5f} rad")
    return ", ".join(sags)


def hold(simulator: Simulator, robot: Robot, tool: Tool, what: str) -> float:
    """Check that the arm stays at home with a tool; return by how much it sags, radians."""
    arm = arm_of(robot)
    still = JointTrajectory(np.zeros(1), arm.home[None], np.array([robot.opening_m]))
    outcome = _play(simulator, robot, tool, still, 3.0)
    sag = float(np.abs(film(outcome).arm - arm.home).max())
    between(f"by how much {what} sags at home, rad", sag, high=_REST_RAD)
    between(f"the tracking error of {what} at home, rad", outcome.tracking_error_rad, high=_REST_RAD)
    return sag


@lru_cache(maxsize=1)
def _engines() -> tuple[tuple[str, Simulator], ...]:
    """Make every engine that is installed and plays one job at a time."""
    found = tuple((name, simulator) for name, simulator in simulators() if simulator.batch == 1)
    expect(found, "no simulator plays one job at a time; a check needs one")
    return found


def _play(simulator: Simulator, robot: Robot, tool: Tool, trajectory: JointTrajectory, hold_s: float) -> Outcome:
    task = Bodies(robot=robot)
    task.home = arm_of(robot).forward(arm_of(robot).home)  # type: ignore[misc]  # a class variable elsewhere
    return play(simulator, task, Rollout(tool, trajectory, 0, 0.1, hold_s, 100.0))
