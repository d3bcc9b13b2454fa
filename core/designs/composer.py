"""Compose prompts from the templates in ``prompts/``.

A prompt (first sampling, evolution, plans for a given tool) is a list of parts; part ``NAME`` is the Jinja template
``NAME.md.j2``. A template may use the names in `core.designs.prompt_values`, and those that plugins give; any other
name is an error.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

from core.config.schemas import FEEDBACK, PARTS, PHOTOGRAPHS, PromptSettings
from core.designs.idea import read_idea
from core.designs.prompt_templates import PromptTemplates
from core.designs.prompt_values import RunFacts, prompt_values
from core.designs.schema import answer_schema
from core.errors import UsageError, UserError, choices
from core.interfaces import Brief, Message, Picture, Text

IDEA = "colleague"  # quotes a person's idea
PICTURE = "picture"  # the pictures of the scene follow it


class PromptComposer:
    """Composes prompts from the templates of one folder.

    Attributes:
        facts: what templates may say of the run.
        templates: those of the settings' parts, and what plugins load.

    Raises:
        UserError: the folder, a part's template or the person's file is missing, or a template is not valid Jinja.
    """

    def __init__(self, facts: RunFacts | None = None) -> None:
        facts = facts or RunFacts()
        settings = facts.settings
        _check_settings(settings)
        parts = _list_parts(settings)
        self.templates = PromptTemplates(settings.dir)
        for part in sorted(parts):
            self.templates.load(part)

        idea = read_idea(settings.file, wanted=IDEA in parts)
        self.facts = replace(facts, idea=idea)

    def compose(
        self,
        brief: Brief,
        pictures: Sequence[Picture] = (),
        strips: Mapping[str, Picture] | None = None,
        *,
        schema: bool = True,
    ) -> tuple[Message, ...]:
        """Compose a system message and a user message.

        The user message has one text per part, then the brief's style, and film ``strips`` (by candidates' ids). The
        ``pictures`` of the scene follow the part `PICTURE`. Each picture comes after its caption.
        ``schema``: the text holds the JSON schema of the answer.

        Raises:
            UserError: a template uses an unknown name or fails otherwise; or there are no elites, and the prompt has
                no parts for a request without elites.
            ValueError: an elite has no tool.
        """
        strips = strips or {}
        values = prompt_values(self.facts, brief)
        values["picture"] = bool(pictures)
        values["pictured"] = list(strips)
        values["schema"] = ""
        if schema:
            values["schema"] = json.dumps(
                answer_schema(brief), ensure_ascii=False, separators=(",", ":")
            )

        user: list[Text | Picture] = []
        for part in self._parts(brief):
            text = self.templates.fill(part, values)
            if text.text.strip():
                user.append(text)
            if part == PICTURE:
                user += with_captions(pictures)

        if brief.style.strip():
            user.append(Text(f"{brief.style.strip()}\n\n"))

        user += with_captions(strips.values())
        return (*self.system(values), Message("user", tuple(user)))

    def _parts(self, brief: Brief) -> Sequence[str]:
        """Choose the parts of a request."""
        settings = self.facts.settings
        use = "initial"
        if brief.representation.given(brief.task) is not None:
            use = "given"
        elif not brief.n_action:
            use = "tools"
        elif brief.elites:
            use = "evolution"

        parts: Sequence[str] = getattr(settings, use)
        if not parts:
            if use != "initial":
                raise UserError(
                    f"prompt.{use} names no parts, and this request needs some"
                )
            raise UserError(
                "this prompt evolves elites, and there are none: prompt.initial names no parts; "
                "use prompt=vlmgineer, or add designs=FILE with elites to vlmgineer prompt"
            )
        return parts

    def system(self, values: Mapping[str, Any]) -> list[Message]:
        """Compose the system message; none: the settings have no parts for it."""
        parts = self.facts.settings.system
        if not parts:
            return []
        texts = tuple(self.templates.fill(part, values) for part in parts)
        return [Message("system", texts)]


def with_captions(pictures: Iterable[Picture]) -> Iterator[Text | Picture]:
    """Yield pictures, each after its caption."""
    for picture in pictures:
        if picture.caption:
            yield Text(f"{picture.caption}\n\n")
        yield picture


def as_markdown(message: Message) -> str:
    """The texts of a message; each picture becomes a Markdown image that names its file."""
    return "".join(
        part.text if isinstance(part, Text) else f"![{part.name}]({part.name}.png)\n\n"
        for part in message.parts
    )


def _check_settings(settings: PromptSettings) -> None:
    settings.check_lessons()
    for name in ("generation_characters", "critic", "repair"):
        most = getattr(settings, name) or 0
        if most < 0:
            raise UsageError(f"prompt.{name} must be 0 or greater, got {most}")
    for name, values in (("feedback", FEEDBACK), ("photographs", PHOTOGRAPHS)):
        value = getattr(settings, name)
        if value not in values:
            raise choices(name, value, values, f"prompt.{name}")


def _list_parts(settings: PromptSettings) -> set[str]:
    """List the parts of all requests."""
    return set(chain(*(getattr(settings, use) for use in PARTS)))
