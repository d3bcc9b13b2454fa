"""Measure what the joints of a tool move: how light it is where all else gives way, and how fast springs make it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from core.design import Tool
from core.geometry import Array

_JOINTS = {
    "hinge": pin.JointModelRevoluteUnaligned,
    "slider": pin.JointModelPrismaticUnaligned,
}


def measure_lightness(tool: Tool) -> Array:
    """Measure how a torque or force of 1 accelerates each joint, while all others are free.

    The most counts of how the tool is built, and with all joints at either end of their ranges.

    Args:
        tool: with K joints.

    Returns:
        Accelerations (K,), 1/(kg m^2) or 1/kg.
    """
    model = pin.Model()
    numbers = dict.fromkeys(tool.mounts, 0)

    for name, parent, pose, joint in tool.bearers:
        moving = _JOINTS[joint.kind](np.array(joint.axis))
        place = pin.SE3(pose.matrix)
        numbers[name] = model.addJoint(numbers[parent], moving, place, name)

    for component in tool.components:
        name, pose = tool.borne[component.name]
        mass = component.mass
        inertia = pin.Inertia(mass, *component.shape.inertia(mass))
        model.appendBodyToJoint(numbers[name], inertia, pin.SE3(pose.matrix))

    data = model.createData()
    ranges = [(bearer.joint.lower, bearer.joint.upper) for bearer in tool.bearers]
    most = np.zeros(len(ranges))

    for values in [most, *np.reshape(ranges, (-1, 2)).T]:
        inverse = pin.computeMinverse(model, data, values)
        most = np.maximum(most, np.diag(inverse))

    return most


def measure_levers(tool: Tool) -> Array:
    """Measure how far from each joint's axis what it bears ends.

    Args:
        tool: with K joints.

    Returns:
        Levers (K,), metres; 1 for a slider.
    """
    levers = []

    for name, _, _, joint in tool.bearers:
        ends = [p.pose.apply(p.shape.corners) for p in tool.parts if p.bearer == name]
        across = np.cross(joint.axis, np.vstack(ends))
        lever = float(np.linalg.norm(across, axis=1).max())
        levers.append(1.0 if joint.kind == "slider" else lever)

    return np.array(levers)


def bound_speeds(tool: Tool) -> Array:
    """Bound how fast what each joint bears moves on it, if all springs of the tool gave it their energy.

    Returns:
        Speeds (K,), m/s.
    """
    energy = sum(bearer.joint.energy for bearer in tool.bearers)
    return measure_levers(tool) * np.sqrt(2 * energy * measure_lightness(tool))
