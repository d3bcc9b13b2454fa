"""Make PhysX collision shapes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from core.geometry import Box, Capsule, Cylinder, Mesh, Pose, Shape, Sphere
from core.support.scratch import write_once
from plugins.simulators.sapien.engine import physx, sapien

_SIDES = 64
_UPRIGHT = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))


def to_sapien(pose: Pose) -> Any:
    return sapien.Pose(pose.position, pose.quaternion)


def place(collider: Any, shape: Shape | Path, pose: Pose) -> None:
    """Place a collision shape in its link or body; PhysX has capsules along x."""
    collider.local_pose = to_sapien(
        pose @ _UPRIGHT if isinstance(shape, Capsule) else pose
    )


def collision(shape: Shape, material: Any, folder: Path) -> Any:
    """Make a collision shape. Hulls are computed once per file; the files are written to ``folder``."""
    match shape:
        case Box(size=size):
            # As a hull: PhysX's box-box test loses the contact of an edge that leans on a thin wall's edge.
            return hull(
                _file(folder, "box", lambda: trimesh.creation.box((1.0, 1.0, 1.0))),
                material,
                size,
            )
        case Sphere(radius=radius):
            return physx.PhysxCollisionShapeSphere(radius, material)
        case Cylinder(radius=radius, length=length):
            # PhysX lacks it: a prism whose corners are as far outside the cylinder as its sides are inside.
            corner = 2 / (1 + np.cos(np.pi / _SIDES))
            prism = partial(
                trimesh.creation.cylinder, radius=corner, height=1.0, sections=_SIDES
            )
            return hull(
                _file(folder, "cylinder", prism), material, (radius, radius, length)
            )
        case Capsule(radius=radius, length=length):
            return physx.PhysxCollisionShapeCapsule(radius, length / 2, material)
        case Mesh(vertices=vertices, faces=faces):
            content = hashlib.sha256(vertices.tobytes() + faces.tobytes()).hexdigest()[
                :16
            ]
            return hull(_file(folder, content, shape.to_trimesh), material)


def hull(
    file: Path, material: Any, scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> Any:
    """Make the convex hull of a mesh file."""
    return physx.PhysxCollisionShapeConvexMesh(str(file), np.array(scale), material)


def _file(folder: Path, name: str, make: Callable[[], trimesh.Trimesh]) -> Path:
    """Return the mesh's file, writing it if there is none of that name."""
    return write_once(
        folder / f"{name}.obj", lambda: str(make().export(file_type="obj"))
    )
