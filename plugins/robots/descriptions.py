"""Read the descriptions of the package example-robot-data, and what was measured of the arms that they describe."""

from __future__ import annotations

import importlib.metadata
import json
from functools import lru_cache
from pathlib import Path

from core.errors import UserError

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
    """Read what ``python -m core.facts`` measured of a robot, by engine and figure; empty if it was not."""
    file = Path(__file__).with_name("measured") / f"{name}.json"
    figures: dict[str, dict[str, float | None]] = json.loads(file.read_text("utf-8")) if file.exists() else {}
    return figures
