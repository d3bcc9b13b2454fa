"""Read the descriptions of the package example-robot-data, mend them, and read what was measured of the arms."""

from __future__ import annotations

import importlib.metadata
import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from lxml import etree

from core.errors import UserError
from core.geometry import Cylinder, Pose, Vector
from core.robot.meshes import hull_file

_PREFIX = "package://example-robot-data/"
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


class Inertial(NamedTuple):
    """The mass of a link, its centre in the link's frame, metres, and its inertia about the centre, kg m^2.

    ``moments``: xx, xy, xz, yy, yz, zz, along the axes of the link's frame.
    """

    mass: float
    center: Vector
    moments: tuple[float, float, float, float, float, float]


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

    Only its links, joints and materials are kept.

    Raises:
        LookupError: a step names a link that is not there.
    """

    def __init__(self, file: str) -> None:
        parser = etree.XMLParser(remove_comments=True, remove_blank_text=True)
        self.root: Any = etree.fromstring(description(file).encode(), parser)
        for element in list(self.root):
            if element.tag not in ("link", "joint", "material"):
                self.root.remove(element)

    def text(self) -> str:
        """Write the description."""
        return str(etree.tostring(self.root, encoding="unicode"))

    def drop(self, *links: str) -> Mending:
        """Remove links, and the joints that bear them or that they bear."""
        for name in links:
            self.root.remove(self._link(name))
            for joint in self.root.findall("joint"):
                if name in (joint.find("parent").get("link"), joint.find("child").get("link")):
                    self.root.remove(joint)
        return self

    def weigh(self, inertials: Mapping[str, Inertial]) -> Mending:
        """Replace the inertias of links."""
        for name, (mass, center, moments) in inertials.items():
            link = self._link(name)
            for old in link.findall("inertial"):
                link.remove(old)
            element = etree.SubElement(link, "inertial")
            etree.SubElement(element, "origin", xyz=_written(center), rpy="0 0 0")
            etree.SubElement(element, "mass", value=f"{mass:.15g}")
            numbers = dict(zip(_MOMENTS, moments, strict=True))
            etree.SubElement(element, "inertia", {key: f"{value:.15g}" for key, value in numbers.items()})
        return self

    def limit(self, joints: Mapping[str, Mapping[str, float]]) -> Mending:
        """Set limits of joints, by the names of URDF: lower, upper, velocity, effort. A continuous joint gets ends."""
        for name, limits in joints.items():
            joint = self.root.find(f"joint[@name='{name}']")
            for key, value in limits.items():
                joint.find("limit").set(key, f"{value:.15g}")
            if joint.get("type") == "continuous":
                joint.set("type", "revolute")
        return self

    def hull(self, meshes: Mapping[str, str]) -> Mending:
        """Replace the collision shapes of links with the convex hull of a mesh, in a file that every engine reads."""
        for name, mesh in meshes.items():
            geometry = etree.SubElement(etree.SubElement(self._uncovered(name), "collision"), "geometry")
            etree.SubElement(geometry, "mesh", filename=str(hull_file(robots_folder() / mesh)))
        return self

    def bare(self, link: str, mesh: str) -> Mending:
        """Remove what is drawn of a link with a mesh whose file has this name."""
        element = self._link(link)
        for visual in element.findall("visual"):
            if Path(visual.find("geometry/mesh").get("filename")).name == mesh:
                element.remove(visual)
        return self

    def cover(self, link: str, shape: Cylinder, pose: Pose) -> Mending:
        """Replace the collision shapes of a link with a cylinder, in its frame."""
        collision = etree.SubElement(self._uncovered(link), "collision")
        etree.SubElement(collision, "origin", xyz=_written(pose.position), rpy=_written(pose.rpy))
        sizes = {"radius": f"{shape.radius:.15g}", "length": f"{shape.length:.15g}"}
        etree.SubElement(etree.SubElement(collision, "geometry"), "cylinder", sizes)
        return self

    def _uncovered(self, link: str) -> Any:
        element = self._link(link)
        for old in element.findall("collision"):
            element.remove(old)
        return element

    def _link(self, name: str) -> Any:
        found = self.root.find(f"link[@name='{name}']")
        if found is None:
            raise LookupError(f"the description has no link {name!r}")
        return found


def _written(numbers: Any) -> str:
    return " ".join(f"{round(float(number), 12) + 0.0:.15g}" for number in numbers)
