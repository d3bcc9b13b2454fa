"""Compose prompts from the templates in ``prompts/``, and the JSON schema of the answer.

A prompt (first sampling, evolution, plans for a given tool) is a list of parts; part ``NAME`` is the Jinja template
``NAME.md.j2``. A template may use the names in `PromptComposer._values`, and those that plugins give (`PromptValue`);
any other name is an error.
"""

from __future__ import annotations

import copy
import importlib.resources
import json
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import jinja2
import jinja2.meta
from jinja2.sandbox import SandboxedEnvironment

from core.config.schemas import CRITIQUES, FEEDBACK, LAST, PHOTOGRAPHS, PromptSettings
from core.design import Tool
from core.designs.elites import elites_text
from core.designs.feedback import (
    combined_figures,
    critiques_text,
    generation_lines,
    last_generation,
)
from core.designs.idea import read_idea
from core.designs.plan_rules import plan_limits
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
from core.robot.trajectory import plan_motion
from core.support.text import function_source, short_numbers
from core.task import NOTHING_TOLD, Level
from core.trial import TIE

SUFFIX = ".md.j2"
REPAIR, CRITIC = "repair", "critic"
MAX_REPEATED = 400_000  # characters of a reply that are sent back

PromptValue = Callable[[Brief, Tool, RolloutSettings, str], Any]
"""Computes what templates show under a name: of a brief, what is mounted, how plans are executed, and the engine."""


class PromptComposer:
    """Composes prompts from the templates of one folder.

    Templates describe how plans are executed by the settings ``rollout`` in the ``engine`` of this name. None stands
    for default settings, and an engine whose arm was not measured for all those in which it was. ``tie`` is the run's
    (`core.trial.ranked`); ``judged`` says what a design is judged by (`core.interfaces.Fitness`).

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
        self.engine = engine
        self.settings = settings = settings or PromptSettings()
        self.rollout = rollout or RolloutSettings()
        self.tie, self.judged = tie, judged.strip()
        for name, most in (
            ("generation_characters", settings.generation_characters),
            ("critic", settings.critic),
        ):
            if most < 0:
                raise UsageError(f"prompt.{name} must be 0 or greater, got {most}")
        if settings.feedback not in FEEDBACK:
            raise choices("feedback", settings.feedback, FEEDBACK, "prompt.feedback")
        self.level: Level = installed().factory("level", settings.told, "prompt.told")()
        if settings.photographs not in PHOTOGRAPHS:
            raise choices(
                "value", settings.photographs, PHOTOGRAPHS, "prompt.photographs"
            )
        parts = {
            *settings.system,
            *settings.initial,
            *settings.evolution,
            *settings.given,
            REPAIR,
        }
        left_out = {LAST} if settings.feedback == "paper" else set()
        left_out |= {CRITIQUES} if not settings.critic else set()
        parts -= left_out
        parts |= (
            {CRITIC} if settings.critic else set()
        )  # a folder of older templates has none
        self._templates, names = _load(
            Path(settings.dir) if settings.dir else None,
            parts,
            {*settings.tools} - left_out,
        )
        self._idea = read_idea(settings.file, wanted="idea" in names)

    def judged_by(self, instructions: str) -> PromptComposer:
        """Return a composer of the same prompts for designs that are judged by something else."""
        other = copy.copy(self)
        other.judged = instructions.strip()
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

        The user message has one text per part, the brief's style, then the ``pictures`` of the scene with their
        captions, and film ``strips`` (by candidates' ids), each after a line that names it. ``schema``: the text holds
        the JSON schema of the answer.

        Raises:
            UserError: a template uses an unknown name or fails otherwise; or there are no elites, and the prompt has
                no parts for a request without elites.
            ValueError: an elite has no tool.
        """
        pictured = dict(strips or {})
        values = self._values(brief, pictures, schema)
        values |= {"pictured": list(pictured)}
        parts = self.settings.evolution if brief.elites else self.settings.initial
        if values["given"] is not None:
            parts = self.settings.given
        elif not brief.n_action:
            parts = self.settings.tools
        if not parts:
            raise UserError(
                "this prompt evolves elites, and there are none: it has no parts for a first sampling; "
                "use prompt=vlmgineer, or add designs=FILE with elites to python -m core.prompt"
            )
        lacks = {*parts} - {LAST, CRITIQUES, *self._templates}
        if lacks and not brief.n_action:
            names = ", ".join(f"{part}{SUFFIX}" for part in sorted(lacks))
            raise UserError(
                f"prompt.dir={self.settings.dir} has no {names}, which requests for tools alone need"
            )
        parts = [part for part in parts if part in self._templates]
        user: list[Text | Picture] = [
            text for part in parts if (text := self._render(part, values)).text.strip()
        ]
        user += [Text(f"{brief.style.strip()}\n\n")] if brief.style.strip() else []
        for picture in pictures:
            user += [
                *([Text(f"{picture.caption}\n\n")] if picture.caption else []),
                picture,
            ]
        for name, strip in pictured.items():
            which = (
                "an elite"
                if any(e.candidate.id == name for e in brief.elites)
                else "a failure"
            )
            user += [
                Text(
                    f"Film strip of {which}, {name}: six instants of its motion, in reading order:\n\n"
                ),
                strip,
            ]
        return (*self._system(values), Message("user", tuple(user)))

    def critique(
        self, brief: Brief, pictures: Mapping[str, Picture]
    ) -> tuple[Message, ...]:
        """Compose a request for a critique of the brief's one elite, with ``pictures`` of it by their captions.

        Raises:
            UserError: see `compose`.
            ValueError: the elite has no tool.
        """
        values = self._values(brief, (), False, numbers=True) | {
            "pictured": list(pictures)
        }
        shown = [
            part
            for caption, picture in pictures.items()
            for part in (Text(f"{caption}:\n\n"), picture)
        ]
        return (
            *self._system(values),
            Message("user", (self._render(CRITIC, values), *shown)),
        )

    def _system(self, values: dict[str, Any]) -> list[Message]:
        texts = tuple(self._render(part, values) for part in self.settings.system)
        return [Message("system", texts)] if texts else []

    def repair(
        self, request: Request, reply: Reply, problem: str
    ) -> tuple[Message, ...]:
        """Compose the messages of ``request``, the reply, and a request to mend its ``problem``.

        Raises:
            UserError: the template fails.
        """
        problem = self.level.sight(request.brief.task, request.brief.scene_seed).text(
            problem
        )
        message = Message(
            "user",
            (self._render(REPAIR, {"problem": problem, "brief": request.brief}),),
        )
        text = reply.text[:MAX_REPEATED]
        answer = [Message("assistant", (Text(text),))] if text.strip() else []
        return (*request.messages, *answer, message)

    def _values(
        self,
        brief: Brief,
        pictures: Sequence[Picture],
        schema: bool,
        *,
        numbers: bool = False,
    ) -> dict[str, Any]:
        """The names that templates may use, and their values."""
        task, representation = brief.task, brief.representation
        given = representation.given(task)
        mounted = given if given is not None else Tool(gripper=brief.gripper)
        bare, robot = given is not None and not given.components, task.robot
        # Numbers are all that plans for a given tool differ in.
        numbers = numbers or given is not None or self.settings.feedback != "paper"
        last = () if self.settings.feedback == "paper" else last_generation(brief.tried)
        sight = self.level.sight(task, brief.scene_seed)
        more = installed().factories("prompt_value").items()
        return {
            **{
                name: value(brief, mounted, self.rollout, self.engine)
                for name, value in more
            },
            "given": given,
            "bare": bare,
            "head": "tool" if not bare else "gripper" if brief.gripper else "flange",
            "brief": brief,
            "task": task,
            "idea": self._idea,
            "instructed": self._idea is not None,
            "feedback": self.settings.feedback,
            "picture": bool(pictures),
            "told": self.settings.told,
            "unseen": not self.level.numbers,
            **NOTHING_TOLD,
            **self.level.values(task, brief.scene_seed),
            "robot": robot,
            "friction": {
                "arm": robot.friction,
                "tool": representation.material.made(mounted).friction,
                "fingers": robot.gripper.friction if robot.gripper else None,
            },
            "action_rules": brief.actions.instructions(brief).strip(),
            "tool_rules": representation.instructions(brief).strip(),
            "executor": function_source(plan_motion),
            "home_xyz": f"({short_numbers(task.home.position, 4, ', ')})",
            "home_rpy": f"({short_numbers(task.home.rpy, 4, ', ')})",
            "rollout": self.rollout,
            "hold_s": max(self.rollout.hold_s, task.hold_s),
            **plan_limits(),
            "schema": json.dumps(
                answer_schema(brief), ensure_ascii=False, separators=(",", ":")
            )
            if schema
            else "",
            "tie": f"{self.tie:g}",
            "judged": self.judged,
            "elites": elites_text(
                brief.elites, representation, task, numbers=numbers, sight=sight
            ),
            "observed": any(elite.observation is not None for elite in brief.elites),
            "critiques": critiques_text(brief),
            "candidates": generation_lines(
                last, self.settings.generation_characters, sight
            ),
            "detailed": any(
                combined_figures(elite, brief.task) for elite in brief.elites
            ),
            "solved": any(elite.reward >= 1 - self.tie for elite in brief.elites),
            "other_kind": any(
                e.candidate.tool and e.candidate.tool.gripper != brief.gripper
                for e in brief.elites
            ),
        }

    def _render(self, part: str, values: dict[str, Any]) -> Text:
        try:
            text = self._templates[part].render(values)
        except jinja2.TemplateError as error:
            raise UserError(
                f"prompt template {part}{SUFFIX}: {_one_line(error)}; a template may use: {', '.join(sorted(values))}"
            ) from error
        return Text(
            text.strip() + "\n\n"
        )  # a blank line, however a client joins the texts


def as_markdown(message: Message) -> str:
    """The texts of a message; each picture becomes a Markdown image that names its file."""
    return "".join(
        part.text if isinstance(part, Text) else f"![{part.name}]({part.name}.png)\n\n"
        for part in message.parts
    )


def _load(
    folder: Path | None, parts: set[str], more: set[str]
) -> tuple[dict[str, jinja2.Template], set[str]]:
    """Load the templates of ``parts``, and of ``more`` that are there; return them and the names that they use."""
    root = importlib.resources.files("prompts") if folder is None else folder
    if not root.is_dir():
        raise UserError(
            f"no prompt folder {root}; name a folder of templates, or leave prompt.dir out"
        )
    there = {file.name: file for file in root.iterdir() if file.name.endswith(SUFFIX)}
    templates, names = {}, set()
    for part in sorted(parts | {part for part in more if part + SUFFIX in there}):
        name = part + SUFFIX
        if name not in there:
            raise choices("prompt template", name, there, str(root))
        try:
            templates[part], used = _compiled(there[name].read_text(encoding="utf-8"))
            names |= used
        except jinja2.TemplateSyntaxError as error:
            raise UserError(
                f"prompt template {name}, line {error.lineno}: {_one_line(error)}"
            ) from error
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(
                f"prompt template {name} can't be read: {_one_line(error)}"
            ) from error
    return templates, names


@lru_cache(256)
def _compiled(text: str) -> tuple[jinja2.Template, set[str]]:
    """Compile a template; return it and the names that it uses.

    Sandboxed, because a third-party folder must do no more than fill in text.
    """
    environment = SandboxedEnvironment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["counted"] = counted
    return environment.from_string(text), jinja2.meta.find_undeclared_variables(
        environment.parse(text)
    )


def counted(number: int, noun: str) -> str:
    """A number with a noun, as a filter for templates: ``one tool``, ``10 tools``."""
    return f"one {noun}" if number == 1 else f"{number} {noun}s"


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
