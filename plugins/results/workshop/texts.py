"""Read and fill the texts of ``templates/`` that an export writes: Markdown, in which others' names are no markup."""

from __future__ import annotations

import importlib.resources
import re
from typing import Any

import jinja2

from core.support.text import clean

# Besides marks: `_` at the end of a word, and what GitHub makes a link of.
_MARKUP = re.compile(r"[\\`*{}\[\]<>#+!|~&@]|(?<![^\W_])_|_(?![^\W_])|:(?=//)|(?<=www)\.", re.I)


def text_of(name: str) -> str:
    """Return a text as it is."""
    return importlib.resources.files(__package__).joinpath("templates", name).read_text(encoding="utf-8")


def plain(value: Any) -> Any:
    """Escape what Markdown and HTML read as markup in a text of others, and make it one line."""
    return _MARKUP.sub(r"\\\g<0>", clean(value, 600)) if isinstance(value, str) else value


def filled(name: str, **values: Any) -> str:
    """Render a template of a Markdown text."""
    environment = jinja2.Environment(  # noqa: S701 - `plain` escapes
        undefined=jinja2.StrictUndefined,
        finalize=plain,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.from_string(text_of(name)).render(**values)
