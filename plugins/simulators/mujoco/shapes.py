"""Add a scene's shapes and bodies to a MuJoCo spec."""

from __future__ import annotations

from typing import Any

import numpy as np

from core.geometry import Box, Capsule, Cylinder, Mesh, Pose, Shape, Sphere
from plugins.simulators.inertia import Inertia
from plugins.simulators.mujoco.engine import mujoco

Element = Any  # of an MjSpec


def add_geom(spec: Element, bearer: Element, shape: Shape, pose: Pose) -> Element:
    """Add a collision shape to a body of the spec; a mesh by its vertices alone, so that it is its convex hull."""
    size = [0.0, 0.0, 0.0]
    mesh = ""

    match shape:
        case Box():
            kind = mujoco.mjtGeom.mjGEOM_BOX
            size = [side / 2 for side in shape.size]
        case Sphere():
            kind = mujoco.mjtGeom.mjGEOM_SPHERE
            size = [shape.radius, 0.0, 0.0]
        case Cylinder():
            kind = mujoco.mjtGeom.mjGEOM_CYLINDER
            size = [shape.radius, shape.length / 2, 0.0]
        case Capsule():
            kind = mujoco.mjtGeom.mjGEOM_CAPSULE
            size = [shape.radius, shape.length / 2, 0.0]
        case Mesh():
            kind = mujoco.mjtGeom.mjGEOM_MESH
            mesh = f"mesh_{len(spec.meshes)}"
            spec.add_mesh(name=mesh, uservert=np.ravel(shape.vertices))

    return bearer.add_geom(
        type=kind, size=size, meshname=mesh, pos=pose.position, quat=pose.quaternion
    )


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
