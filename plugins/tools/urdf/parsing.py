"""Parse a tool's text as XML, and read attributes and numbers of its elements.

A model wrote the text, so it is untrusted. DTD, entities and external references are refused, and length, number and
depth of elements are limited.
"""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element, ParseError, TreeBuilder

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from core.design import DesignError
from core.geometry import Pose
from core.support.text import shorten

MAX_CHARACTERS = 1_000_000
MAX_ELEMENTS = 10_000
MAX_DEPTH = 8
MAX_NUMBER = 1000.0  # far above every length, angle and mass of a tool; keeps products finite

# Possessive quantifiers keep the time linear for every text.
_NUMBER = re.compile(r"[+-]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?+", re.ASCII)
_DECLARATION = re.compile(r"\s*<\?xml[^>]*\?>")


class _BoundedBuilder(TreeBuilder):
    """Builds elements, and raises `DesignError` where they are too many or nest too deep."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = self._count = 0

    def start(self, tag: str, attributes: dict[str, str], /) -> Element:
        self._depth += 1
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise DesignError(f"tool_urdf has more than {MAX_ELEMENTS} elements; a tool needs far fewer")
        if self._depth > MAX_DEPTH:
            raise DesignError(f"tool_urdf nests elements more than {MAX_DEPTH} deep; links and joints are side by side")
        return super().start(tag, attributes)

    def end(self, tag: str, /) -> Element:
        self._depth -= 1
        return super().end(tag)


def parse_xml(text: str) -> Element:
    """Parse ``text``; return the root, whose children are the tool's elements.

    Raises:
        DesignError: the text is too long, malformed or not plain XML.
    """
    if len(text) > MAX_CHARACTERS:
        raise DesignError(f"tool_urdf is {len(text)} characters long; at most {MAX_CHARACTERS} are allowed")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DesignError("tool_urdf must not have a DOCTYPE or entities; write plain <link> and <joint> elements")
    declaration = _DECLARATION.match(text)
    block = text[declaration.end() :] if declaration else text
    parser = DefusedXMLParser(target=_BoundedBuilder(), forbid_dtd=True)
    try:
        parser.feed(f"<robot>\n{block}\n</robot>")
        root: Element = parser.close()
    except ParseError as error:
        row, column = error.position
        what = str(error).partition(":")[0]
        raise DesignError(f"tool_urdf is not well-formed XML: {what} in line {row - 1}, column {column + 1}") from error
    except DefusedXmlException as error:
        raise DesignError("tool_urdf must not have a DOCTYPE, entities or external references") from error
    except UnicodeEncodeError as error:
        raise DesignError("tool_urdf has characters that are not valid Unicode (lone surrogates)") from error
    if len(root) == 1 and root[0].tag == "robot":
        return root[0]
    return root


def only_child(element: Element, tag: str, where: str) -> Element | None:
    """The child of that tag; None: there is none; `DesignError`: there are several."""
    found = element.findall(tag)
    if len(found) > 1:
        raise DesignError(f"{where} has {len(found)} <{tag}> elements; give one")
    return found[0] if found else None


def attribute(element: Element | None, tag: str, name: str, where: str) -> str:
    """The value of <tag name="...">; `DesignError`: it is missing."""
    value = None if element is None else element.get(name)
    if value is None:
        raise DesignError(f'{where} needs <{tag} {name}="...">')
    return value


def read_numbers(text: str, count: int, where: str) -> list[float]:
    """``count`` numbers, separated by white space, each at most `MAX_NUMBER` in size."""
    words = text.split()
    if len(words) != count or not all(_NUMBER.fullmatch(word) for word in words):
        raise DesignError(f"{where} must be {count} plain number{'s' * (count > 1)}, not {shorten(text)}")
    values = [float(word) for word in words]
    if not all(abs(value) <= MAX_NUMBER for value in values):
        raise DesignError(
            f"{where} is {shorten(text)}; metres, radians and kilograms of a tool are far below {MAX_NUMBER:g}"
        )
    return values


def read_origin(element: Element, where: str) -> Pose:
    """The pose in an element's <origin>; the identity without one."""
    found = only_child(element, "origin", where)
    if found is None:
        return Pose()
    xyz = read_numbers(found.get("xyz", "0 0 0"), 3, f"{where}: origin xyz")
    return Pose.xyz_rpy(xyz, read_numbers(found.get("rpy", "0 0 0"), 3, f"{where}: origin rpy"))
