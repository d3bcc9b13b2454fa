"""A scene's shapes and bodies in MuJoCo's terms."""

from __future__ import annotations

from typing import Any

import numpy as np

from core.geometry import Box, Cylinder, Mesh, Pose, Shape, Sphere
from core.scene import Body, Inertia
from plugins.simulators.mujoco.engine import mujoco

Element = Any  # of an MjSpec


def add_geom(spec: Element, bearer: Element, shape: Shape, pose: Pose) -> Element:
    """A shape on a body of the spec, to be felt; a mesh by its vertices alone, which is its convex hull."""
    size, mesh = [0.0, 0.0, 0.0], ""
    match shape:
        case Box():
            kind, size = mujoco.mjtGeom.mjGEOM_BOX, [side / 2 for side in shape.size]
        case Sphere():
            kind, size = mujoco.mjtGeom.mjGEOM_SPHERE, [shape.radius, 0.0, 0.0]
        case Cylinder():
            kind, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [shape.radius, shape.length / 2, 0.0]
        case Mesh():
            kind, mesh = mujoco.mjtGeom.mjGEOM_MESH, f"mesh_{len(spec.meshes)}"
            spec.add_mesh(name=mesh, uservert=np.ravel(shape.vertices))
    return bearer.add_geom(type=kind, size=size, meshname=mesh, pos=pose.position, quat=pose.quaternion)


def add_free_body(spec: Element, name: str, body: Body, inertia: Inertia) -> Element:
    """A body that can move, with its exact inertia; its frame is the joint's, so that the state speaks of it."""
    element = spec.worldbody.add_body(
        name=name,
        pos=body.pose.position,
        quat=body.pose.quaternion,
        mass=inertia.mass,
        ipos=inertia.frame.position,
        iquat=inertia.frame.quaternion,
        inertia=inertia.moments,
        explicitinertial=True,
    )
    element.add_freejoint(name=name)
    return element
