"""Parse the XML that others made, and tell what a file is by its content, and how to make of it what is read.

XML is parsed without DTD, entities and network.
"""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from core.errors import UserError
from core.support.text import shorten

MAX_BYTES = 10_000_000
_MAX_ELEMENTS = 50_000

_XACRO = re.compile(r"\{[^}]*xacro\}")  # begins the tag of an element of its namespace
_CALLS = re.compile(r"\$[({]")  # what Xacro fills in
_USD = (
    "USD, of which a URDF is to be made first: pip install nvidia-srl-usd-to-urdf, then: "
    "usd_to_urdf {path} {stem}.urdf"
)
_XACRO_REMEDY = (
    "Xacro, of which a URDF is to be made first: pip install 'xacrodoc>=2,<3', then: "
    "xacrodoc {path} -o {stem}_plain.urdf; with NAME:=VALUE for each of its arguments that has no default or shall "
    "differ, and -d FOLDER if it names packages ($(find NAME)) that lie in FOLDER"
)
# What files of other kinds begin with, and what to do.
_BEGINNINGS = (
    (
        b"pk\x03\x04",
        "a zip archive; unpack it: unzip {path} -d {stem}, then name a file in {stem}",
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


def read_xml(data: bytes, file: Path) -> Element:
    """Parse XML that lies at ``file``, without DTD and entities.

    Raises:
        UserError: it is no plain XML, or has too many elements.
    """
    try:
        root = fromstring(data, forbid_dtd=True)
    except ParseError as error:
        raise UserError(f"{file} is malformed XML: {error}") from error
    except (DefusedXmlException, ValueError, LookupError) as error:
        # Of the last two kinds is an encoding that does not exist.
        raise UserError(
            f"{file} must be plain XML without DOCTYPE and entities ({type(error).__name__})"
        ) from error

    count = sum(1 for _ in root.iter())

    if count > _MAX_ELEMENTS:
        raise UserError(
            f"{file} has {count} elements; at most {_MAX_ELEMENTS} are read"
        )

    return root


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
        if root.tag == "robot" and _is_xacro(root):
            known = [_XACRO_REMEDY]
    if known:
        raise UserError(f"{path} is {known[0].format(path=path, stem=path.stem)}")
    if root.tag not in ("robot", "mujoco"):
        tag = shorten(root.tag)[1:-1]
        raise UserError(
            f"{path} is no URDF or MJCF: its root is <{tag}> instead of <robot> or <mujoco>"
        )

    return root


def _is_xacro(root: Element) -> bool:
    """Tell whether something is left to be filled in: a URDF that Xacro made has its namespace, too."""
    texts = [value for element in root.iter() for value in element.attrib.values()]
    called = any(map(_CALLS.search, texts))
    return called or any(_XACRO.match(element.tag) for element in root.iter())
