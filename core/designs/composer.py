"""Compose prompts from the templates in ``prompts/``.

A prompt (first sampling, evolution, plans for a given tool) is a list of parts; part ``NAME`` is the Jinja template
``NAME.md.j2``. A template may use the names in `core.designs.prompt_values`, and those that plugins give; any other
name is an error.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from core.config.schemas import FEEDBACK, PARTS, PHOTOGRAPHS, PromptSettings
from core.designs.idea import read_idea
from core.designs.prompt_templates import PromptTemplates
from core.designs.prompt_values import RunFacts, prompt_values
from core.designs.schema import answer_schema
from core.errors import UsageError, UserError, choices
from core.interfaces import (
    Brief,
    Message,
    Picture,
    Reply,
    Request,
    RolloutSettings,
    Text,
)
from core.plugins import installed
from core.task import Level
from core.trial import TIE

REPAIR = "repair"
CRITIC = "critic"
IDEA = "colleague"  # quotes a person's idea
PICTURE = "picture"  # the pictures of the scene follow it
MAX_REPEATED = 400_000  # characters of a reply that are sent back


class PromptComposer:
    """Composes prompts from the templates of one folder.

    Args:
        settings: those of the prompts.
        rollout: how plans are executed, as templates describe it.
        engine: the name of the engine; empty: any.
        tie: the run's (`core.trial.ranked`).
        judged: says what a design is judged by (`core.interfaces.Fitness`).

    Raises:
        UserError: the folder, a part's template or the person's file is missing, or a template is not valid Jinja.
    """

    def __init__(
        self,
        settings: PromptSettings | None = None,
        rollout: RolloutSettings | None = None,
        engine: str = "",
        *,
        tie: float = TIE,
        judged: str = "",
    ) -> None:
        self.settings = settings or PromptSettings()
        self.rollout = rollout or RolloutSettings()
        _check_settings(self.settings)
        self.level: Level = installed().factory(
            "level", self.settings.told, "prompt.told"
        )()
        parts = _list_parts(self.settings)
        folder = Path(self.settings.dir) if self.settings.dir else None
        self._templates = PromptTemplates(folder, parts)
        self._facts = RunFacts(
            settings=self.settings,
            level=self.level,
            rollout=self.rollout,
            engine=engine,
            tie=tie,
            judged=judged.strip(),
            idea=read_idea(self.settings.file, wanted=IDEA in parts),
        )

    def judged_by(self, instructions: str) -> PromptComposer:
        """Return a composer of the same prompts for designs that are judged by something else."""
        other = copy.copy(self)
        other._facts = replace(self._facts, judged=instructions.strip())
        return other

    def compose(
        self,
        brief: Brief,
        pictures: Sequence[Picture] = (),
        strips: Mapping[str, Picture] | None = None,
        *,
        schema: bool = True,
    ) -> tuple[Message, ...]:
        """Compose a system message and a user message.

        The user message has one text per part, then the brief's style, and film ``strips`` (by candidates' ids), each
        after a line that names it. The ``pictures`` of the scene follow the part `PICTURE`, with their captions.
        ``schema``: the text holds the JSON schema of the answer.

        Raises:
            UserError: a template uses an unknown name or fails otherwise; or there are no elites, and the prompt has
                no parts for a request without elites.
            ValueError: an elite has no tool.
        """
        strips = strips or {}
        values = prompt_values(self._facts, brief)
        values["picture"] = bool(pictures)
        values["pictured"] = list(strips)
        values["schema"] = ""
        if schema:
            values["schema"] = json.dumps(
                answer_schema(brief), ensure_ascii=False, separators=(",", ":")
            )

        user: list[Text | Picture] = []
        for part in self._parts(brief):
            text = self._templates.fill(part, values)
            if text.text.strip():
                user.append(text)
            if part == PICTURE:
                user += _with_captions(pictures)

        if brief.style.strip():
            user.append(Text(f"{brief.style.strip()}\n\n"))

        elites = {elite.candidate.id for elite in brief.elites}

        for name, strip in strips.items():
            which = "an elite" if name in elites else "a failure"
            caption = f"Film strip of {which}, {name}: six instants of its motion, in reading order:"
            user += _with_captions([replace(strip, caption=caption)])

        return (*self._system(values), Message("user", tuple(user)))

    def critique(
        self, brief: Brief, pictures: Sequence[Picture]
    ) -> tuple[Message, ...]:
        """Compose a request for a critique of the brief's one elite, with ``pictures`` of it.

        Raises:
            UserError: see `compose`.
            ValueError: the elite has no tool.
        """
        values = prompt_values(replace(self._facts, criticised=True), brief)
        values["pictured"] = list(pictures)
        text = self._templates.fill(CRITIC, values)
        user = (text, *_with_captions(pictures))
        return (*self._system(values), Message("user", user))

    def repair(
        self,
        request: Request,
        reply: Reply,
        problem: str,
        faults: Sequence[str] = (),
        brief: Brief | None = None,
    ) -> tuple[Message, ...]:
        """Compose the messages of a request, the reply, and a request to mend it.

        Args:
            request: that was answered.
            reply: to it.
            problem: why the reply can't be read; empty: it can.
            faults: of its designs.
            brief: of what is to be mended; None: of the whole request.

        Raises:
            UserError: the template fails.
        """
        brief = brief or request.brief
        sight = self.level.sight(brief.task, brief.scene_seed)
        values = {
            "problem": sight.text(problem),
            "faults": [sight.text(fault) for fault in faults],
            "brief": brief,
        }
        messages = list(request.messages)
        text = reply.text[:MAX_REPEATED]
        if text.strip():
            messages.append(Message("assistant", (Text(text),)))
        messages.append(Message("user", (self._templates.fill(REPAIR, values),)))

        return tuple(messages)

    def _parts(self, brief: Brief) -> Sequence[str]:
        """Choose the parts of a request."""
        settings = self.settings
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

    def _system(self, values: dict[str, Any]) -> list[Message]:
        parts = self.settings.system
        if not parts:
            return []
        texts = tuple(self._templates.fill(part, values) for part in parts)
        return [Message("system", texts)]


def _with_captions(pictures: Sequence[Picture]) -> Iterator[Text | Picture]:
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
    for name in ("generation_characters", "critic", "repair"):
        most = getattr(settings, name) or 0
        if most < 0:
            raise UsageError(f"prompt.{name} must be 0 or greater, got {most}")
    for name, values in (("feedback", FEEDBACK), ("photographs", PHOTOGRAPHS)):
        value = getattr(settings, name)
        if value not in values:
            raise choices(name, value, values, f"prompt.{name}")


def _list_parts(settings: PromptSettings) -> set[str]:
    parts = {REPAIR, CRITIC}
    for use in PARTS:
        parts |= {*getattr(settings, use)}
    return parts
