"""Enlarge a small arm, so that it does in tasks as they are what it does itself in tasks that are as much smaller.

Where lengths are k times as large and nothing is denser, gravity keeps the movement alike (Froude's rule): times grow
by k^(1/2), speeds of joints by k^(-1/2), masses and forces by k^3, torques by k^4, moments of inertia by k^5.
"""

from __future__ import annotations

import math
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

from core.errors import UsageError
from core.geometry import Box, Pose
from core.interfaces import Robot
from core.robot.writing import write
from core.values.descriptions import (
    Description,
    RobotJoint,
    RobotLink,
    RobotShape,
    Triple,
)

REACH_M = 0.8  # of the arm that tasks are for
_LEAST_M = 0.05


def find_factor(reach: float | None) -> float:
    """Return how many times larger an arm of a reach, metres, has to be for tasks; None: 1.

    Raises:
        UsageError: the reach is that of no arm, or of a larger one.
    """
    if reach is None:
        return 1.0
    if not _LEAST_M <= reach <= REACH_M:
        raise UsageError(
            f"robot.reach is {reach:g}; give {_LEAST_M:g} to {REACH_M:g} m, for which tasks are, none for a longer arm"
        )
    return REACH_M / reach


def describe_factor(k: float) -> str:
    """Say what it means for an arm to be ``k`` times as large as it is."""
    percent = f"{100 / k:.3g} %"
    return (
        f"simulated {k:.3g} times as large: it does what the arm itself does in tasks of {percent} of the size. Build "
        f"tools in {percent} of their size, play motions in {100 / math.sqrt(k):.3g} % of their time"
    )


def enlarge(robot: Robot, k: float) -> Robot:
    """Enlarge a robot ``k`` times; its flange stays."""
    arm = robot.description
    links = {name: _enlarge_link(link, k) for name, link in arm.links.items()}
    joints = {child: _enlarge_joint(joint, k) for child, joint in arm.joints.items()}
    gripper = robot.gripper
    if gripper is not None:
        gripper = replace(
            gripper,
            mount=_enlarge_pose(gripper.mount, k),
            travel_m=k * gripper.travel_m,
            force_n=k**3 * gripper.force_n,
        )
    return replace(
        robot,
        title=f"{robot.title}, {k:.3g} times as large",
        urdf=write(Description(arm.name, links, joints)),
        acceleration_limits=tuple(most / k for most in robot.acceleration_limits),
        motor_inertia=tuple(inertia * k**5 for inertia in robot.motor_inertia),
        mount=_enlarge_pose(robot.mount, k),
        payload_kg=robot.payload_kg * k**3,
        gripper=gripper,
    )


def _enlarge_pose(pose: Pose, k: float) -> Pose:
    return Pose.from_rotation(k * pose.position, pose.rotation)


def _enlarge_triple(lengths: Triple, k: float) -> Triple:
    x, y, z = lengths
    return k * x, k * y, k * z


def _enlarge_link(link: RobotLink, k: float) -> RobotLink:
    weight = link.inertial
    moments: Any = tuple(value * k**5 for value in weight.moments)
    return RobotLink(
        link.name,
        replace(
            weight,
            mass=weight.mass * k**3,
            center=_enlarge_triple(weight.center, k),
            moments=moments,
        ),
        tuple(_enlarge_shape(shape, k) for shape in link.collisions),
        tuple(_enlarge_shape(shape, k) for shape in link.visuals),
    )


def _enlarge_shape(shape: RobotShape, k: float) -> RobotShape:
    origin = replace(shape.origin, xyz=_enlarge_triple(shape.origin.xyz, k))
    placed = replace(shape, origin=origin)
    solid = shape.shape
    if isinstance(solid, Path):
        return replace(placed, scale=_enlarge_triple(shape.scale, k))
    if isinstance(solid, Box):
        return replace(placed, shape=Box(_enlarge_triple(solid.size, k)))
    lengths = [k * length for length in astuple(solid)]
    return replace(placed, shape=type(solid)(*lengths))


def _enlarge_joint(joint: RobotJoint, k: float) -> RobotJoint:
    """Enlarge a joint; that of a finger slides."""
    factors = {"effort": k**4, "velocity": k**-0.5}
    if joint.kind == "prismatic":
        factors = {"lower": k, "upper": k, "effort": k**3, "velocity": k**0.5}
    limits = {}
    for name, factor in factors.items():
        value = getattr(joint.limits, name)
        limits[name] = value and value * factor
    origin = replace(joint.origin, xyz=_enlarge_triple(joint.origin.xyz, k))
    return replace(joint, origin=origin, limits=joint.limits._replace(**limits))
