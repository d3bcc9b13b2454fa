"""Add a scene's shapes and bodies to a MuJoCo spec."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from core.design import ToolJoint
from core.geometry import Box, Capsule, Cylinder, Pose, Shape, Sphere
from core.values.joints import Joint
from plugins.simulators.inertia import Inertia
from plugins.simulators.mujoco.engine import mujoco

Element = Any  # of an MjSpec


_GEOMS = mujoco.mjtGeom


def _round_size(shape: Cylinder | Capsule) -> list[float]:
    return [shape.radius, shape.length / 2, 0.0]


# MuJoCo's own shapes, and their sizes there; others are meshes.
_NATIVES: dict[type[Shape], tuple[Any, Callable[[Any], list[float]]]] = {
    Box: (_GEOMS.mjGEOM_BOX, lambda box: [side / 2 for side in box.size]),
    Sphere: (_GEOMS.mjGEOM_SPHERE, lambda ball: [ball.radius, 0.0, 0.0]),
    Cylinder: (_GEOMS.mjGEOM_CYLINDER, _round_size),
    Capsule: (_GEOMS.mjGEOM_CAPSULE, _round_size),
}


def add_geom(spec: Element, bearer: Element, shape: Shape, pose: Pose) -> Element:
    """Add a collision shape to a body of the spec; a mesh by its vertices alone, so that it is its convex hull."""
    kind = _GEOMS.mjGEOM_MESH
    size = [0.0, 0.0, 0.0]
    mesh = ""

    if type(shape) in _NATIVES:
        kind, measure = _NATIVES[type(shape)]
        size = measure(shape)
    else:
        mesh = f"mesh_{len(spec.meshes)}"
        spec.add_mesh(name=mesh, uservert=np.ravel(shape.triangles.vertices))

    return bearer.add_geom(
        type=kind, size=size, meshname=mesh, pos=pose.position, quat=pose.quaternion
    )


def set_springs(element: Element, joint: Joint | ToolJoint) -> None:
    """Set the spring, damper and dry friction of a joint of the spec."""
    element.stiffness[0] = joint.stiffness
    element.springref = joint.rest
    element.damping[0] = joint.damping
    element.frictionloss = joint.friction


def add_body(bearer: Element, name: str, pose: Pose, inertia: Inertia) -> Element:
    """Add a body with its exact inertia to another body, without a joint."""
    return bearer.add_body(
        name=name,
        pos=pose.position,
        quat=pose.quaternion,
        mass=inertia.mass,
        ipos=inertia.frame.position,
        iquat=inertia.frame.quaternion,
        inertia=inertia.moments,
        explicitinertial=True,
    )
