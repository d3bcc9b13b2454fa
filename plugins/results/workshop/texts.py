"""Read and fill the texts of ``templates/`` that an export writes."""

from __future__ import annotations

import importlib.resources
from typing import Any

import jinja2


def text_of(name: str) -> str:
    """Return a text as it is."""
    return importlib.resources.files(__package__).joinpath("templates", name).read_text(encoding="utf-8")


def filled(name: str, **values: Any) -> str:
    """Render a template."""
    environment = jinja2.Environment(  # noqa: S701 - plain text
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    return environment.from_string(text_of(name)).render(**values)
