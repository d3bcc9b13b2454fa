"""Make PhysX collision shapes, and attach them to links and bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from core.geometry import (
    Box,
    Capsule,
    Cylinder,
    Mesh,
    Pose,
    Shape,
    Sphere,
    Triple,
)
from plugins.simulators.forces import Thing
from plugins.simulators.mesh_files import mesh_file
from plugins.simulators.sapien.engine import physx, sapien
from plugins.simulators.sapien.surfaces import TOGETHER, Apart, Surface, Surfaces

_SIDES = 64
_UPRIGHT = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))


@dataclass(frozen=True, eq=False)
class Setup:
    """What the parts of one world share.

    Attributes:
        scene: SAPIEN's, which they are added to.
        surfaces: of all that collides.
        folder: for files of meshes.
        time_step: seconds.
        tracking_rate: how fast a motor converges to its target, 1/s.
        things: what each collision shape is part of, for `Impulses`; `attach` fills it.
    """

    scene: Any
    surfaces: Surfaces
    folder: Path
    time_step: float
    tracking_rate: float
    things: dict[Any, Thing] = field(default_factory=dict)

    def add(
        self, name: str, component: Any, pose: Pose | None = None, drive: Any = None
    ) -> None:
        """Add a link or body to the scene as an entity, with a drive if it has one; PhysX places links itself."""
        entity = sapien.Entity()
        entity.name = name
        entity.add_component(component)
        if pose is not None:
            entity.pose = to_sapien(pose)
        if drive is not None:
            entity.add_component(drive)
        self.scene.add_entity(entity)


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A collision shape at a pose in its link or body; a mesh file collides as its convex hull.

    Attributes:
        shape: or the file of a mesh.
        pose: in the link or body.
        part: the name of what it belongs to: a body, or a link of the robot's description.
    """

    shape: Shape | Path
    pose: Pose
    part: str


def attach(
    setup: Setup,
    component: Any,
    placed: PlacedShape,
    thing: Thing,
    surface: Surface,
    apart: Apart = TOGETHER,
    *,
    fixed: bool = False,
) -> None:
    """Attach copies of a collision shape to a link or body, one for each kind of surface that it can meet.

    Args:
        setup: of the world.
        component: SAPIEN's link or body.
        placed: the shape.
        thing: what it is part of.
        surface: its contact properties.
        apart: says what it doesn't touch.
        fixed: it can't move, and meets nothing that can't.
    """
    pose = placed.pose
    if isinstance(placed.shape, Capsule):  # PhysX has them along x
        pose = pose @ _UPRIGHT

    for copy in setup.surfaces.copies(surface, apart, fixed=fixed):
        collider = _collider(placed.shape, copy.material, setup.folder)
        collider.local_pose = to_sapien(pose)
        collider.set_collision_groups(copy.groups)
        component.attach(collider)
        setup.things[collider] = thing


def to_sapien(pose: Pose) -> Any:
    """Convert a pose."""
    return sapien.Pose(pose.position, pose.quaternion)


def _collider(shape: Shape | Path, material: Any, folder: Path) -> Any:
    """Make a collision shape. Hulls are computed once per file; the files are written to ``folder``."""
    if isinstance(shape, Path):
        return _hull(shape, material)

    if type(shape) in _NATIVES:
        return _NATIVES[type(shape)](shape, material, folder)

    return _hull(mesh_file(shape.triangles, folder), material)


def _hull(file: Path, material: Any, scale: Triple = (1.0, 1.0, 1.0)) -> Any:
    """Make the convex hull of a mesh file."""
    return physx.PhysxCollisionShapeConvexMesh(str(file), np.array(scale), material)


# Every world has some: the files are not looked for again.
@lru_cache(maxsize=8)
def _cube(folder: Path) -> Path:
    """Return the file of a box with edges of 1 m."""
    return mesh_file(Box((1.0, 1.0, 1.0)).triangles, folder)


@lru_cache(maxsize=8)
def _prism(folder: Path) -> Path:
    """Return the file of a cylinder of radius and length 1 m, which PhysX lacks.

    It is a prism whose corners are as far outside the cylinder as its sides are inside.
    """
    corner = 2 / (1 + np.cos(np.pi / _SIDES))
    prism = trimesh.creation.cylinder(radius=corner, height=1.0, sections=_SIDES)
    return mesh_file(Mesh.from_trimesh(prism), folder)


# What makes a shape of its own; others are hulls of their triangles. A box is a hull, too: PhysX's box-box test loses
# the contact of an edge that leans on a thin wall's edge.
_NATIVES: dict[type[Shape], Callable[[Any, Any, Path], Any]] = {
    Box: lambda box, material, folder: _hull(_cube(folder), material, box.size),
    Sphere: lambda ball, material, _: physx.PhysxCollisionShapeSphere(
        ball.radius, material
    ),
    Cylinder: lambda rod, material, folder: _hull(
        _prism(folder), material, (rod.radius, rod.radius, rod.length)
    ),
    Capsule: lambda rod, material, _: physx.PhysxCollisionShapeCapsule(
        rod.radius, rod.length / 2, material
    ),
}
