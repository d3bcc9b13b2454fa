"""Check a robot: its numbers are physical, its kinematics hold, and every engine here can move it.

Poses are drawn from fixed seeds, so that a verdict stays.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from core.design import RIGID_MOUNT, Component, Tool
from core.geometry import Array, Box, Pose
from core.interfaces import JointTrajectory, Outcome, Robot, Rollout, Simulator
from core.robot.description import assembled
from core.robot.kinematics import Arm, arm_of, link_poses, robot_model
from core.robot.solids import Solid, robot_solids, signed_distance
from core.robot.trajectory import plan_motion
from core.solids.self_collision import DEEP_M
from plugins.conformance.checking import expect, simulators
from plugins.conformance.worlds import Bodies, film, play

# The radius of gyration of a link is at most this many diagonals of the box around its collision shapes. Of the
# default arm's links, whose identified inertias shift mass between neighbours, the first has 1.15.
_SPREAD = 1.5
_WHOLE = 0.02  # radians between the axes of the mount at home and the world's
_ROOM = 0.01  # radians between home and the limits
_POSES, _OFF = 500, 0.1  # radians that inverse kinematics starts from a solution: some 2 cm, as in motions
_LINES = 200
_LINE_M, _LINE_RAD = (0.3, 0.4, 0.3), (0.4, 0.8, 0.8)  # the farthest end of a line from home, by axis
_STEP_M, _STEP_RAD = 0.02, 0.1  # between knots, as in motions
_REACHED_M, _REACHED_RAD = 0.003, 0.02
_BOW_M = 0.02  # from the line, midway between knots
_SAME_RAD = 0.5  # joints in one posture
_LAG_RAD, _END_M, _REST_RAD = 0.02, 1e-3, 2e-3  # as for the default robot in every engine
_LEAST = 0.99  # of poses
_LEAST_LINES = 0.98
_LEAST_REACHED = 0.4  # of lines around home
_HZ = 100.0


def check_limits_are_there(robot: Robot) -> None:
    driven, joints = robot.joints(robot.gripper is not None), robot.description.named
    for name in driven:
        expect(name in joints, f"the description has no joint {name!r}")
        kind, joint = "prismatic" if name in robot.finger_joints else "revolute", joints[name]
        expect(joint.kind == kind, f"joint {name!r} is {joint.kind}; it must be {kind}, with limits")
        expect(any(limit is not None for limit in joint.limits), f"joint {name!r} has no limits")
        low, high, effort, speed = (np.nan if limit is None else limit for limit in joint.limits)
        expect(low < high, f"joint {name!r} turns from {low} to {high}")
        expect(speed > 0 and effort > 0, f"joint {name!r} has the speed {speed} and the effort {effort}")
    more = sorted(name for name, joint in joints.items() if joint.kind != "fixed" and name not in driven)
    expect(not more, f"joints {', '.join(map(repr, more))} move, and are neither the arm's nor the gripper's")


def check_home_points_the_mount_down(robot: Robot) -> None:
    """At home the joints are within their limits, and the mount's axes are the base's."""
    arm = arm_of(robot)
    for name, low, here, high in zip(robot.arm_joints, arm.lower, arm.home, arm.upper, strict=True):
        expect(low + _ROOM < here < high - _ROOM, f"home of {name!r} is {here:g}; its limits are {low:g} and {high:g}")
    off = float((robot.base.rotation.inv() * arm.forward(arm.home).rotation).magnitude())
    expect(off < _WHOLE, f"at home the mount is turned by {off:.3f} rad from the base's axes; at most {_WHOLE}")


def check_inertias_are_physical(robot: Robot) -> None:
    corners: dict[str, list[Array]] = {}
    for solid in robot_solids(robot, robot.gripper is not None):
        center, half = solid.bounds()
        corners.setdefault(solid.name, []).append(np.array([center - half, center + half]))
    for name, link in assembled(robot).links.items():
        mass, center, tensor = link.inertial.placed()
        if mass == 0:
            expect(name not in corners, f"link {name!r} has a collision shape and no mass")
            continue
        expect(name in corners, f"link {name!r} has a mass and no collision shape")
        least, middle, most = np.linalg.eigvalsh(tensor)
        expect(mass > 0 and least > 0, f"link {name!r} has the mass {mass:g} kg and the inertia {least:g} kg m^2")
        expect(
            least + middle >= most * (1 - 1e-6), f"inertias {least:g}, {middle:g}, {most:g} of {name!r}: no body has"
        )
        low, high = np.min([one[0] for one in corners[name]], axis=0), np.max([one[1] for one in corners[name]], axis=0)
        size, spread = float(np.linalg.norm(high - low)), float(np.sqrt(most / mass))
        found = f"link {name!r} is {size:.3f} m large"
        expect(spread < _SPREAD * size, f"{found}, and its mass lies {spread:.3f} m from its centre on average")
        away = float(np.linalg.norm(center - (low + high) / 2))
        expect(away < size, f"{found}, and the centre of its mass lies {away:.3f} m from the middle of its shapes")


def check_collision_shapes_are_read_by_every_engine(robot: Robot) -> None:
    for shape in (shape for link in robot.description.links.values() for shape in link.collisions):
        if isinstance(file := shape.shape, Path):
            expect(file.suffix.lower() in (".stl", ".obj"), f"engines can't read {file}; convert it to STL")
            expect(min(shape.scale) > 0, f"{file} has the scale {list(shape.scale)}")


def check_shapes_are_clear_of_each_other_at_home(robot: Robot) -> None:
    """Convex hulls of links that three joints or more separate don't overlap at home; limits keep the others apart."""
    gripper = robot.gripper is not None
    model, arm = robot_model(robot, gripper), arm_of(robot)
    poses, placed = link_poses(robot, gripper, arm.home), []
    for solid in robot_solids(robot, gripper):
        here = Solid(solid.name, solid.geometry, poses[solid.name] @ solid.pose)
        placed.append((model.supports[model.links[solid.name][0]], here))
    for (before, one), (behind, other) in combinations(placed, 2):
        if len(before ^ behind) >= 3:
            deep = -signed_distance(one, other)
            expect(deep < DEEP_M, f"at home {one.name!r} is {1000 * deep:.1f} mm inside {other.name!r}")


def check_inverse_kinematics_converges(robot: Robot) -> str:
    """From joints near a solution, as in motions, it finds one for 99 % of poses drawn in the joints' ranges."""
    arm, rng, found = arm_of(robot), np.random.default_rng(0), 0
    for _ in range(_POSES):
        joints = rng.uniform(arm.lower, arm.upper)
        start = joints + rng.uniform(-_OFF, _OFF, len(joints))
        solution = arm.inverse(arm.forward(joints), np.clip(start, arm.lower, arm.upper))
        found += solution.error_m < 1e-4 and solution.error_rad < 1e-3
    expect(found >= _LEAST * _POSES, f"inverse kinematics finds {found} of {_POSES} reachable poses")
    return f"{found} of {_POSES}"


def check_posture_stays_along_straight_lines(robot: Robot) -> str:
    """On lines from home, as far as they are reached, the arm neither leaves the line nor changes its posture.

    Midway between knots it is near the line, and there and back it ends with the joints that it began with.
    """
    arm, rng = arm_of(robot), np.random.default_rng(0)
    home, straight, same, bows, reach = arm.forward(arm.home), 0, 0, [], []
    for _ in range(_LINES):
        way, turn = (rng.uniform(-1, 1, 3) * most for most in (_LINE_M, _LINE_RAD))
        positions, rotations = _line(home, way, Rotation.from_euler("xyz", turn))
        joints, errors = arm.follow(positions[1:], rotations[1:], arm.home)
        reached = (errors[:, 0] < _REACHED_M) & (errors[:, 1] < _REACHED_RAD)
        knots = np.vstack([arm.home, joints])[: len(reached) + 1 if reached.all() else int(np.argmin(reached)) + 1]
        reach.append((len(knots) - 1) / len(joints))
        back, _ = arm.follow(positions[: len(knots)][::-1], rotations[: len(knots)][::-1], knots[-1])
        same += float(np.abs(back[-1] - arm.home).max()) < _SAME_RAD
        bows.append(_bow(arm, knots, positions))
        straight += bows[-1] < _BOW_M
    share = float(np.mean(reach))
    near = f"{share:.0%} of lines around home are reached, at least {_LEAST_REACHED:.0%} should be"
    expect(share >= _LEAST_REACHED, f"{near}: choose a home away from limits and from an outstretched arm")
    found = f"from {_LINES - same} of {_LINES} lines the arm comes back in another posture"
    expect(same >= _LEAST_LINES * _LINES, found)
    found = f"leaves {_LINES - straight} of {_LINES} lines by more than {1000 * _BOW_M:.0f} mm between knots"
    expect(straight >= _LEAST_LINES * _LINES, f"the arm {found}, at most by {1000 * max(bows):.0f} mm")
    return f"{share:.0%} of lines reached, back in the same posture from {same} of {_LINES}; {found}"


def _line(home: Pose, way: Array, turn: Rotation) -> tuple[Array, npt.NDArray[np.float64]]:
    """Place knots from home: positions (K, 3) and rotations (K, 3, 3)."""
    steps = max(np.linalg.norm(way) / _STEP_M, turn.magnitude() / _STEP_RAD)
    share = np.linspace(0.0, 1.0, int(np.ceil(steps)) + 1)[:, None]
    return home.position + share * way, (Rotation.from_rotvec(share * turn.as_rotvec()) * home.rotation).as_matrix()


def _bow(arm: Arm, knots: Array, line: Array) -> float:
    """The largest distance from the line (K, 3) midway between the joints (K, J) of neighbouring knots, metres."""
    if len(knots) < 2:
        return 0.0
    off = arm.positions((knots[1:] + knots[:-1]) / 2) - (line[1 : len(knots)] + line[: len(knots) - 1]) / 2
    return float(np.linalg.norm(off, axis=1).max())


def check_every_engine_tracks_a_trajectory(robot: Robot) -> str:
    """Without contact the arm follows a motion with the error that simulators are allowed for the default robot."""
    return ", ".join(f"{name} {follow(simulator, robot, f'in {name} '):.4f} rad" for name, simulator in _engines())


def follow(simulator: Simulator, robot: Robot, where: str = "") -> float:
    """Check that the arm follows a motion around its home without contact; return its largest lag, radians."""
    arm = arm_of(robot)
    home = arm.forward(arm.home)
    plan = np.add([[0.1, 0.2, -0.2, 0, 0.3, 0], [0.0, -0.2, -0.1, 0, 0, 0.5]], [*home.position, 0, 0, 0])
    planned = plan_motion(plan, home, arm)
    expect(planned.ik_error_m < 1e-3, f"the arm misses a motion around its home by {planned.ik_error_m:.3f} m")
    outcome = _play(simulator, robot, Tool(), planned.trajectory, 0.5)
    recording, said = film(outcome), outcome.tracking_error_rad
    lag = float(np.abs(recording.arm - planned.trajectory.sample(recording.times)[0]).max())
    expect(lag < _LAG_RAD, f"{where}the arm is {lag:.4f} rad off its trajectory; at most {_LAG_RAD}")
    found = f"{where}the tracking error is {said:.4f} rad, the recording's largest miss {lag:.4f} rad"
    expect(abs(said - lag) < max(2e-3, 0.5 * lag), found)
    gap = float(np.abs(arm.forward(recording.arm[-1]).position - plan[-1][:3]).max())
    expect(gap < _END_M, f"{where}the end-effector ends {1000 * gap:.1f} mm from its last waypoint")
    return lag


def check_every_engine_holds_the_arm_at_home(robot: Robot) -> str:
    """It holds the bare arm, and the payload; the payload's centre is 5 cm below the flange."""
    weight = Component("weight", RIGID_MOUNT, Pose(np.array([0.0, 0.0, -0.05])), Box((0.1,) * 3), robot.payload_kg)
    tools = {"the bare arm": Tool(), f"the arm with {robot.payload_kg:g} kg": Tool((weight,))}
    pairs = [(name, what, simulator) for what in tools for name, simulator in _engines()]
    return ", ".join(
        f"{name} {what} {hold(simulator, robot, tools[what], f'in {name} {what}'):.5f} rad"
        for name, what, simulator in pairs
    )


def hold(simulator: Simulator, robot: Robot, tool: Tool, what: str) -> float:
    """Check that the arm stays at home with a tool; return by how much it sags, radians."""
    arm = arm_of(robot)
    still = JointTrajectory(np.zeros(1), arm.home[None], np.array([robot.opening_m]))
    outcome = _play(simulator, robot, tool, still, 3.0)
    sag, lag = float(np.abs(film(outcome).arm - arm.home).max()), outcome.tracking_error_rad
    expect(sag < _REST_RAD, f"{what} sags by {sag:.4f} rad at home; at most {_REST_RAD}")
    expect(lag < _REST_RAD, f"{what} has a tracking error of {lag:.4f} rad at home; at most {_REST_RAD}")
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
    return play(simulator, task, Rollout(tool, trajectory, 0, 0.1, hold_s, _HZ))
