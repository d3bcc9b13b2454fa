"""Self-contained HTML pages: one file, nothing loaded from elsewhere, every text escaped, and a content security policy
that makes the browser enforce it.
"""

from __future__ import annotations

import base64
import hashlib
import importlib.metadata
import importlib.resources
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2
import numpy as np
from markupsafe import Markup

from core.design import Tool
from core.support.templates import build_environment
from core.support.text import clean
from core.values.robots import Robot
from plugins.results.pages.drawing import Painted, painted
from plugins.results.pages.figure import INK
from plugins.results.pages.formats import links, printed, relative

_LONGEST = 20_000  # characters of any text
_SHARP = np.deg2rad(20.0)  # angle between two faces above which an edge is drawn
_LIGHT_INK = "#e6edf3"  # on a dark page, as in page.css


def render(
    template: str, folder: Path, viewer: Sequence[Mapping[str, Any]] = (), **values: Any
) -> str:
    """Render a template as a page.

    Args:
        template: its name.
        folder: where the page will lie; links are relative to it.
        viewer: tools to turn around (`in_viewer`).
        values: what the template shows.
    """
    style = _text("page.css")
    script = _text("tables.js")
    if viewer:
        script += _text("viewer.js")
    policy = (
        f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; script-src '{_hash(script)}'; "
        "base-uri 'none'; form-action 'none'"
    )

    def href(target: Path) -> str:
        return quote(relative(target, folder), errors="surrogateescape")

    loader = jinja2.FunctionLoader(_text)
    environment = build_environment(loader, autoescape=True, finalize=_clean)
    environment.filters |= {
        "href": href,
        "links": links,
        "printed": printed,
        "sort_key": _sort_key,
    }
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}

    return environment.get_template(template).render(
        **values,
        policy=Markup(policy),  # noqa: S704
        style=Markup(style),  # noqa: S704
        script=Markup(script),  # noqa: S704
        viewer=viewer,
        version=importlib.metadata.version("vlmgineer"),
    )


def _clean(value: Any) -> Any:
    """Take control characters from a text; what is markup already passes."""
    if isinstance(value, str) and not isinstance(value, Markup):
        return clean(value, _LONGEST)
    return value


def _sort_key(cell: Any) -> str:
    """What a browser sorts a cell of numbers by; empty: it is none."""
    if isinstance(cell, float | int) and isfinite(cell):
        return repr(cell)
    return ""


def _text(name: str) -> str:
    folder = importlib.resources.files("plugins.results.pages") / "templates"
    return (folder / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def figure_address(svg: bytes) -> Markup:
    """The data address of a figure whose ink follows the browser's colour scheme."""
    text = svg.decode().replace(INK, "currentColor")
    dark = f"@media (prefers-color-scheme: dark) {{ svg {{ color: {_LIGHT_INK} }} }}"
    ink = f"<style>svg {{ color: {INK} }} {dark}</style>"
    return data_address(text.replace("<defs>", f"{ink}<defs>", 1).encode(), "svg+xml")


def data_address(picture: bytes, format_: str = "png") -> Markup:
    """An address that holds a picture."""
    return Markup(f"data:image/{format_};base64,{base64.b64encode(picture).decode()}")  # noqa: S704


def in_viewer(tool: Tool, robot: Robot, name: str, caption: str) -> dict[str, Any]:
    """Return a tool for the viewer: triangles and sharp edges in tenths of millimetres.

    Args:
        tool: what is shown.
        robot: the arm that holds it.
        name: above it.
        caption: below it, after the tool's description.
    """
    if tool.description:
        caption = f"{tool.description} ({caption})"

    return drawn_in_viewer(painted(tool, robot), name, caption)


def drawn_in_viewer(
    items: Sequence[Painted], name: str, caption: str
) -> dict[str, Any]:
    """Return solids for the viewer; see `in_viewer`."""
    solids = []
    for item in items:
        mesh = item.solid
        sharp = mesh.face_adjacency_edges[mesh.face_adjacency_angles > _SHARP]
        solid = {
            "color": [round(float(channel), 3) for channel in item.color[:3]],
            "vertices": np.round(mesh.vertices * 1e4).astype(int).ravel().tolist(),
            "faces": np.asarray(mesh.faces).ravel().tolist(),
            "edges": np.asarray(sharp).ravel().tolist(),
        }
        solids.append(solid)

    return {"name": clean(name, 200), "caption": clean(caption, 1000), "solids": solids}
