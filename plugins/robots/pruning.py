"""Remove links of a URDF before it is read: what is left out may be wrong in any way."""

from __future__ import annotations

from collections.abc import Collection
from xml.etree.ElementTree import Element

from core.errors import choices


def leave_out(root: Element, names: Collection[str]) -> None:
    """Remove links, and all that they bear, with the joints that bear them.

    Raises:
        UserError: there is no such link.
    """
    links = [link.get("name", "") for link in root.findall("link")]
    for name in names:
        if name not in links:
            raise choices("link", name, links)

    joints = {joint: _find_ends(joint) for joint in root.findall("joint")}
    removed = set[str]()
    found = set(names)
    while found:
        removed |= found
        borne = {child for parent, child in joints.values() if parent in removed}
        found = borne - removed

    for link in root.findall("link"):
        if link.get("name") in removed:
            root.remove(link)
    for joint, (_, child) in joints.items():
        if child in removed:
            root.remove(joint)


def _find_ends(joint: Element) -> list[str]:
    """Name the parent and the child of a joint; empty where there is none."""
    ends = (joint.find("parent"), joint.find("child"))
    return ["" if end is None else end.get("link", "") for end in ends]
