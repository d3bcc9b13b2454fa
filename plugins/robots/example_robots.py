"""Read the descriptions of the package example-robot-data, and mend them."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from core.geometry import Cylinder
from core.imports.documents import read_xml
from core.imports.urdf import read_tree
from core.values.descriptions import Description, Inertial, Origin, RobotShape, rounded
from plugins.robots.hulls import Job

_FIRST = "robots/panda_description/urdf/panda.urdf"
_PREFIX = b"package://example-robot-data/"


@lru_cache(maxsize=1)
def robots_folder() -> Path:
    """Find the folder of the descriptions."""
    files = importlib.metadata.files("example-robot-data") or ()
    first = next(file for file in files if file.match(_FIRST))
    return Path(str(first.locate())).resolve().parents[2]


@lru_cache(maxsize=16)
def description(file: str) -> Description:
    """Read a description, such as ``panda_description/urdf/panda.urdf``, with absolute paths of its meshes."""
    path = robots_folder() / file
    meshes = f"{robots_folder().parent}/".encode()
    data = path.read_bytes().replace(_PREFIX, meshes)
    return read_tree(read_xml(data, path), path.stem)


def mend(
    file: str,
    *,
    drop: Collection[str] = (),
    inertials: Mapping[str, Sequence[Any]] = MappingProxyType({}),
    limits: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
    collisions: Mapping[str, str | Mapping[str, float]] = MappingProxyType({}),
    undrawn: Collection[str] = (),
) -> Description:
    """Mend a description.

    Args:
        file: see `description`.
        drop: links that are removed, with the joints that bear them or that they bear.
        inertials: of links, in place of theirs: mass, centre (3,) and the six moments about it.
        limits: of joints, by the names of URDF: lower, upper, velocity, effort. A continuous joint gets ends.
        collisions: of links, in place of theirs: a mesh, whose hull becomes a file that every engine reads, or the
            radius and length of a cylinder along z, and the z of its middle.
        undrawn: names of the files of meshes that are not drawn."""
    arm = description(file)
    links = {}
    for name, link in arm.links.items():
        if name in drop:
            continue

        drawn = [s for s in link.visuals if Path(str(s.shape)).name not in undrawn]
        links[name] = replace(link, visuals=tuple(drawn))
        if name in inertials:
            mass, center, moments = inertials[name]
            given = Inertial(mass, tuple(center), tuple(moments))
            whole = Inertial.from_tensor(*given.placed())
            links[name] = replace(links[name], inertial=whole)

        if name in collisions:
            shape = _collision(collisions[name])
            links[name] = replace(links[name], collisions=(shape,))

    joints = {}
    for child, joint in arm.joints.items():
        if {child, joint.parent} & {*drop}:
            continue

        joints[child] = joint

        if joint.name in limits:
            numbers = limits[joint.name]
            exact = {key: rounded(value) for key, value in numbers.items()}
            kind = "revolute" if joint.kind == "continuous" else joint.kind
            ends = joint.limits._replace(**exact)
            joints[child] = replace(joint, kind=kind, limits=ends)

    return Description(arm.name, links, joints)


def _collision(given: str | Mapping[str, float]) -> RobotShape:
    """Make the hull of a mesh, or a cylinder: see `mend`."""
    if isinstance(given, str):
        return RobotShape(Job(str(robots_folder() / given)).make(ours=True))

    cylinder = Cylinder(given["radius"], given["length"])
    return RobotShape(cylinder, Origin((0.0, 0.0, given["z"])))
