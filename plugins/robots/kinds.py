"""Tell what a file is by its content, and how to make of it what is read."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import Element

from core.errors import UserError
from core.support.text import shorten
from core.values.urdf import read_xml

ARMS = (".urdf", ".xml", ".mjcf", ".xacro")
_SHOWN = 5  # files that a message lists
_XACRO = re.compile(r"\{[^}]*xacro\}")  # begins the tag of an element of its namespace
_CALLS = re.compile(r"\$[({]")  # what Xacro fills in
_USD = (
    "USD, of which a URDF is to be made first: pip install nvidia-srl-usd-to-urdf, then: "
    "usd_to_urdf {path} {stem}.urdf"
)
# What files of other kinds begin with, and what to do.
_BEGINNINGS = (
    (
        b"pk\x03\x04",
        "a zip archive; unpack it: unzip {path} -d {stem}, then robot.path={stem}",
    ),
    (b"version https://git-lfs", "a pointer of Git LFS; fetch the file: git lfs pull"),
    (b"<!doctype html", "a web page; download the file itself (on GitHub: Raw)"),
    (b"<html", "a web page; download the file itself (on GitHub: Raw)"),
    (b"\x1f\x8b", "a packed archive; unpack it: tar xf {path}"),
    (b"#usda", _USD),
    (b"pxr-usdc", _USD),
    (b"solid ", "a mesh; give the URDF or MJCF file that names it"),
)
# The same by the root of an XML file.
_ROOTS = {
    "sdf": "SDF, of which MJCF is to be made first: pip install sdformat-mjcf, then: sdf2mjcf {path} {stem}.xml",
    "mujocoinclude": "a part of an MJCF model; give the file that includes it",
}


def list_arms(folder: Path) -> str:
    """List files of a folder that may be arms, as words to type."""
    found = [file for file in sorted(folder.rglob("*")) if file.suffix in ARMS]
    return " or ".join(f"robot.path={file}" for file in found[:_SHOWN])


def read_root(data: bytes, path: Path) -> Element:
    """Parse a file that is URDF or MJCF, and return its root.

    Raises:
        UserError: it is something else; says what, and the command that makes a URDF of it.
    """
    head = data[:100].lstrip(b"\xef\xbb\xbf \r\n\t").lower()
    known = [remedy for beginning, remedy in _BEGINNINGS if head.startswith(beginning)]
    if not known:
        root = read_xml(data, path)
        known = [remedy for tag, remedy in _ROOTS.items() if tag == root.tag]
    if known:
        raise UserError(f"{path} is {known[0].format(path=path, stem=path.stem)}")
    if root.tag not in ("robot", "mujoco"):
        tag = shorten(root.tag)[1:-1]
        raise UserError(
            f"{path} is no URDF or MJCF: its root is <{tag}> instead of <robot> or <mujoco>"
        )
    if root.tag == "robot" and _is_xacro(root):
        raise UserError(
            f"{path} is Xacro, of which a URDF is to be made first: {_describe_xacro(root, path)}"
        )

    return root


def _is_xacro(root: Element) -> bool:
    """Tell whether something is left to be filled in: a URDF that Xacro made has its namespace, too."""
    texts = [value for element in root.iter() for value in element.attrib.values()]
    called = any(map(_CALLS.search, texts))
    return called or any(_XACRO.match(element.tag) for element in root.iter())


def _describe_xacro(root: Element, path: Path) -> str:
    """Write the command that makes a URDF of a Xacro file, with the arguments that have no default."""
    arguments = [
        f" {element.get('name')}:=VALUE"
        for element in root.iter()
        if element.tag.endswith("}arg") and element.get("default") is None
    ]
    stem = path.name.removesuffix(".xacro").removesuffix(".urdf")
    command = (
        f"xacrodoc {path} -o {stem}{'_plain' if path.suffix == '.urdf' else ''}.urdf"
    )
    return (
        f"pip install 'xacrodoc>=2,<3', then: {command}{''.join(arguments)}; with -d FOLDER if it names packages "
        "($(find NAME)) that lie in FOLDER, and NAME:=VALUE for each of its arguments that shall differ"
    )
