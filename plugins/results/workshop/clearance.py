"""Measure how near an arm and its tool come to themselves, to the scene and to its limits, and what the arm bears."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from core.design import RIGID_MOUNT, Tool
from core.geometry import Array, Pose
from core.interfaces import Recording
from core.robot.description import assemble, merge_inertias
from core.robot.kinematics import arm_of, open_mounts, robot_model
from core.scene import Scene
from core.solids.contacts import nearest
from core.solids.record_rate import subset
from core.solids.self_collision import self_pairs
from core.values.robots import Robot
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.tracks import body_tracks, robot_tracks

HZ = 25.0
"""Of the instants at which distances are measured."""

NEAR_M = 0.3
"""Farther things are not measured."""


class Nearest(NamedTuple):
    """How near the arm or the tool came to something, and when.

    Attributes:
        what: ``arm``, with its gripper, or ``tool``.
        to: the body; of the arm also ``itself``: between its parts, and between the tool and the arm, that limits don't
            keep apart.
        metres: negative for penetration; `NEAR_M` stands for more.
        seconds: of the motion.
    """

    what: str
    to: str
    metres: float
    seconds: float


def clearance(
    scene: Scene, robot: Robot, tool: Tool, recording: Recording
) -> list[Nearest]:
    """Measure distances along a recorded rollout, at `HZ`.

    Args:
        scene: its bodies.
        robot: the arm, with its gripper.
        tool: what it holds.
        recording: of the rollout.

    Returns:
        How near arm and tool came to each body, and the arm to itself; the nearest first.
    """
    wanted = np.arange(0.0, recording.times[-1] + 1 / HZ, 1 / HZ)
    chosen = np.unique(np.searchsorted(recording.times, wanted))
    taken = subset(recording, chosen[chosen < len(recording.times)])
    times = taken.times.tolist()

    gaps = _gaps_to_itself(robot, tool, taken)
    k = int(gaps.argmin())
    found = [Nearest("arm", "itself", min(float(gaps[k]), NEAR_M), times[k])]

    bodies = body_tracks(scene, robot, taken)
    parts = {component.name for component in tool.components}
    moving = robot_tracks(robot, tool, taken)
    links = [track for track in moving if track.name not in parts]
    components = [track for track in moving if track.name in parts]
    for what, tracks in (("arm", links), ("tool", components)):
        for name, near in nearest(tracks, bodies, None).items():
            gap = min(near.gap_m, NEAR_M)
            found.append(Nearest(what, name, gap, times[near.sample]))

    return sorted(found, key=lambda row: row.metres)


def _gaps_to_itself(robot: Robot, tool: Tool, recording: Recording) -> Array:
    """Return the least distance (T,) of the arm to itself and the tool, metres; negative for penetration."""
    fingers = recording.fingers[:, : len(robot.finger_joints)]
    pairs = self_pairs(robot, tool)
    gaps = [
        -pairs.depths(joints).max(initial=-np.inf)
        for joints in robot_model(robot, tool).order(recording.arm, fingers)
    ]
    return np.array(gaps)


def torques(robot: Robot, tool: Tool, motion: Sampled) -> Array:
    """Compute the joint torques that a motion needs with a tool and without contact.

    Inverse dynamics of the links and the tool, and the motors' inertia. Friction in the joints is left out.

    Args:
        robot: the arm.
        tool: what it holds.
        motion: T samples of its J joints.

    Returns:
        Torques (T, J), N m.
    """
    model = pin.buildModelFromXML(assemble(robot, tool, visuals=False))
    data = model.createData()
    names = [str(name) for name in model.names][1:]
    columns = [names.index(name) for name in robot.arm_joints]
    joints = pin.neutral(model)
    speeds = np.zeros(model.nv)
    accelerations = np.zeros(model.nv)

    found = np.empty_like(motion.positions)
    for k in range(len(motion.times)):
        joints[columns] = motion.positions[k]
        speeds[columns] = motion.velocities[k]
        accelerations[columns] = motion.accelerations[k]
        found[k] = pin.rnea(model, data, joints, speeds, accelerations)[columns]

    inertia: Array = motion.accelerations * np.array(robot.motor_inertia)

    return found + inertia


def margins(robot: Robot, tool: Tool, motion: Sampled) -> list[dict[str, Any]]:
    """Compare a motion with the arm's limits, joint by joint.

    Args:
        robot: the arm.
        tool: what it holds.
        motion: as it is exported.

    Returns:
        For each joint the distance to the nearer end of its range, radians, and the largest shares of its limits of
        velocity, acceleration and torque; of the latter None where the arm's description has no limit.
    """
    arm = arm_of(robot)
    room = np.minimum(motion.positions - arm.lower, arm.upper - motion.positions)
    least_room = room.min(axis=0)
    velocity, acceleration = motion.loads(arm)
    effort = np.abs(torques(robot, tool, motion)).max(axis=0)

    rows = []
    for i, name in enumerate(robot.arm_joints):
        limit = arm.effort_limits[i]
        row = {
            "joint": name,
            "to_limit_rad": float(least_room[i]),
            "velocity_share": float(velocity[i]),
            "acceleration_share": float(acceleration[i]),
            "computed_torque_nm": float(effort[i]),
            "computed_torque_share": float(effort[i] / limit) if limit > 0 else None,
        }
        rows.append(row)

    return rows


def payload(robot: Robot, tool: Tool) -> dict[str, Any]:
    """Return the tool's ``mass_kg``, ``center_m`` (3,) and ``inertia_kg_m2`` (3, 3) about it, in the axes of ``frame``.

    ``frame`` is the link that bears the tool; attachments to fingers count where they are with the fingers open. A
    joint of the tool counts at its rest.
    """
    mounts = open_mounts(robot, tool.gripper) | {RIGID_MOUNT: Pose()}
    placed = tool.placed()
    parts = []
    for component in tool.components:
        mount, pose = placed[component.name]
        in_link = robot.mount @ mounts[mount] @ pose
        turn = in_link.rotation_matrix
        center, inertia = component.shape.inertia(component.mass)
        turned = turn @ inertia @ turn.T
        parts.append((component.mass, in_link.apply(center), turned))

    mass, center, inertia = 0.0, np.zeros(3), np.zeros((3, 3))  # of the bare hand
    if parts:
        mass, center, inertia = merge_inertias(parts)

    return {
        "frame": robot.mount_link,
        "mass_kg": round(mass, 6),
        "center_m": np.round(center, 6).tolist(),
        "inertia_kg_m2": np.round(inertia, 9).tolist(),
        "share_of_payload": round(mass / robot.payload_kg, 4),
    }
