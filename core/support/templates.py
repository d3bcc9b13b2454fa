"""Fill in templates of prose, such as a part of a prompt: files ``templates/NAME.md.j2`` of a package."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

import jinja2
import yaml
from jinja2.sandbox import SandboxedEnvironment

from core.support.text import number


def fill(package: str, template: str, /, **given: Any) -> str:
    """Render a template as plain text; its filter ``g`` writes a number with six digits, or as many as it is given."""
    return _environment(package).get_template(template).render(given)


def fill_text(text: str, /, **given: Any) -> str:
    """Render a template that is a text, such as the words of a kind of goal."""
    return _compile(text).render(given)


def macros(package: str, template: str) -> Any:
    """Return a template's macros, as the functions of a module: each writes a phrase."""
    return _environment(package).get_template(template).module


def fill_yaml(text: str, /, **given: Any) -> Any:
    """Fill in a template of YAML, and read it; lists and objects of Python read as YAML."""
    return yaml.safe_load(build_environment().from_string(text).render(given))


@cache
def _compile(text: str) -> jinja2.Template:
    return build_environment().from_string(text)


@cache
def _environment(package: str) -> jinja2.Environment:
    folder = files(package) / "templates"
    loader = jinja2.FunctionLoader(
        lambda name: (folder / f"{name}.md.j2").read_text("utf-8")
    )
    return build_environment(loader)


def build_environment(
    loader: jinja2.BaseLoader | None = None, **options: Any
) -> jinja2.Environment:
    """Make what compiles templates: sandboxed, because a stranger's must do no more than fill in text.

    Args:
        loader: finds templates by their names.
        options: more of Jinja's; by default what is filled in is plain text, as it is.
    """
    environment = SandboxedEnvironment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        **options,
    )
    environment.filters["g"] = lambda number, digits=6: f"{number:.{digits}g}"
    environment.filters["number"] = number
    environment.filters["counted"] = _count
    return environment


def _count(number: int, noun: str) -> str:
    """Write a number with a noun: ``one tool``, ``10 tools``."""
    return f"one {noun}" if number == 1 else f"{number} {noun}s"
