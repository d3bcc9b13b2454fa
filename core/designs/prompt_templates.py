"""Load the templates of a prompt's parts, and fill them in."""

from __future__ import annotations

import importlib.resources
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import jinja2

from core.errors import UserError, choices
from core.interfaces import Text
from core.support.templates import build_environment

SUFFIX = ".md.j2"


class PromptTemplates:
    """The templates of prompts' parts in a folder, the project's own if it is None: part ``NAME`` is ``NAME.md.j2``.

    Raises:
        UserError: there is no such folder.
    """

    def __init__(self, folder: str | None) -> None:
        self._root = Path(folder or str(importlib.resources.files("prompts")))
        if not self._root.is_dir():
            raise UserError(
                f"no prompt folder {self._root}; name a folder of templates, or leave prompt.dir out"
            )
        self._templates: dict[str, jinja2.Template] = {}

    def load(self, part: str) -> None:
        """Load the template of a part, so that it can be filled.

        Raises:
            UserError: it is missing, or is not valid Jinja.
        """
        self._templates[part] = _load(self._root, part + SUFFIX)

    def fill(self, part: str, values: Mapping[str, Any]) -> Text:
        """Fill in the template of a part that is loaded.

        Raises:
            UserError: the template uses an unknown name, or fails otherwise.
        """
        try:
            text = self._templates[part].render(values)
        except jinja2.TemplateError as error:
            raise UserError(
                f"prompt template {part}{SUFFIX}: {_one_line(error)}; a template may use: {', '.join(sorted(values))}"
            ) from error

        # A blank line at the end, however a client joins the texts.
        return Text(text.strip() + "\n\n")


def _load(root: Path, name: str) -> jinja2.Template:
    try:
        return _environment(root).get_template(name)
    except jinja2.TemplateNotFound as error:
        there = [file.name for file in root.glob(f"*{SUFFIX}")]
        raise choices("prompt template", name, there, str(root)) from error
    except jinja2.TemplateSyntaxError as error:
        raise UserError(
            f"prompt template {name}, line {error.lineno}: {_one_line(error)}"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(
            f"prompt template {name} can't be read: {_one_line(error)}"
        ) from error


@cache
def _environment(root: Path) -> jinja2.Environment:
    return build_environment(jinja2.FileSystemLoader(root))


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
