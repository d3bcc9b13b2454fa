"""Read the descriptions of the package example-robot-data, mend them, and read what was measured of the arms."""

from __future__ import annotations

import importlib.metadata
import json
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from core.errors import UserError
from core.geometry import Cylinder, Pose
from core.robot.description import write
from core.robot.meshes import hull_file
from core.values.descriptions import Inertial, Origin, RobotLink, RobotShape, rounded
from core.values.urdf import read_description

_PREFIX = "package://example-robot-data/"


@lru_cache(maxsize=1)
def robots_folder() -> Path:
    """Find the folder of the descriptions.

    Raises:
        UserError: the package example-robot-data is not installed, or has no descriptions.
    """
    try:
        files = importlib.metadata.files("example-robot-data") or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    for file in files:
        if file.match("robots/panda_description/urdf/panda.urdf"):
            return Path(str(file.locate())).resolve().parents[2]
    raise UserError("the descriptions of robots are missing: pip install example-robot-data")


@lru_cache(maxsize=16)
def description(file: str) -> str:
    """Read a description, such as ``panda_description/urdf/panda.urdf``, with absolute paths of its meshes."""
    text = (robots_folder() / file).read_text(encoding="utf-8")
    text = text[text.index("<robot") :]  # without an XML declaration, which names an encoding
    return text.replace(_PREFIX, f"{robots_folder().parent}/")


def measured(name: str) -> dict[str, dict[str, float | None]]:
    """Read what ``vlmgineer facts`` measured of a robot, by engine and figure; empty if it was not."""
    file = Path(__file__).with_name("measured") / f"{name}.json"
    figures: dict[str, dict[str, float | None]] = json.loads(file.read_text("utf-8")) if file.exists() else {}
    return figures


class Mending:
    """A description that is mended, step by step.

    Raises:
        LookupError: a step names a link or a joint that is not there.
    """

    def __init__(self, file: str) -> None:
        self._arm = read_description(description(file).encode(), robots_folder() / file)

    def text(self) -> str:
        """Write the description."""
        return write(self._arm)

    def drop(self, *links: str) -> Mending:
        """Remove links, and the joints that bear them or that they bear."""
        for name in links:
            self._link(name)
        kept = {name: link for name, link in self._arm.links.items() if name not in links}
        joints = {child: j for child, j in self._arm.joints.items() if child in kept and j.parent in kept}
        self._arm = replace(self._arm, links=kept, joints=joints)
        return self

    def weigh(self, inertials: Mapping[str, Inertial]) -> Mending:
        """Replace the inertias of links."""
        for name, inertial in inertials.items():
            mass, center, tensor = inertial.placed()
            self._change(name, inertial=Inertial.of(mass, center, tensor))
        return self

    def limit(self, joints: Mapping[str, Mapping[str, float]]) -> Mending:
        """Set limits of joints, by the names of URDF: lower, upper, velocity, effort. A continuous joint gets ends."""
        for name, limits in joints.items():
            joint = self._arm.named[name]
            kind = "revolute" if joint.kind == "continuous" else joint.kind
            new = joint.limits._replace(**{key: rounded(value) for key, value in limits.items()})
            self._arm = replace(
                self._arm, joints=self._arm.joints | {joint.child: replace(joint, kind=kind, limits=new)}
            )
        return self

    def hull(self, meshes: Mapping[str, str]) -> Mending:
        """Replace the collision shapes of links with the convex hull of a mesh, in a file that every engine reads."""
        for name, mesh in meshes.items():
            self._change(name, collisions=(RobotShape(hull_file(robots_folder() / mesh)),))
        return self

    def bare(self, link: str, mesh: str) -> Mending:
        """Remove what is drawn of a link with a mesh whose file has this name."""
        shapes = self._link(link).visuals
        return self._change(link, visuals=tuple(shape for shape in shapes if Path(str(shape.shape)).name != mesh))

    def cover(self, link: str, shape: Cylinder, pose: Pose) -> Mending:
        """Replace the collision shapes of a link with a cylinder, in its frame."""
        return self._change(link, collisions=(RobotShape(shape, Origin.of(pose)),))

    def _change(self, name: str, **changes: Any) -> Mending:
        link = replace(self._link(name), **changes)
        self._arm = replace(self._arm, links=self._arm.links | {name: link})
        return self

    def _link(self, name: str) -> RobotLink:
        if name not in self._arm.links:
            raise LookupError(f"the description has no link {name!r}")
        return self._arm.links[name]
