"""Composes what a model is told from the templates in ``prompts/``, and says what its answer must look like.

A use (first sampling, evolution, plans for a given tool) is a list of parts; a part ``NAME`` is the Jinja template
``NAME.md.j2``. What a template may use is in `Prompts._values`; a name that it misspells is an error, not a gap.
"""

from __future__ import annotations

import importlib.resources
import inspect
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2
from jinja2.sandbox import SandboxedEnvironment

from core.design import Evaluation, Tool
from core.errors import UserError, choices
from core.geometry import Vector
from core.interfaces import Brief, Message, Picture, RolloutSettings, Task, Text, ToolRepresentation
from core.robot import assemble
from core.rules import MAX_WAYPOINTS
from core.scene import Body, Goal, Part, floor, table
from core.trajectory import plan_motion

SUFFIX = ".md.j2"
SYSTEM = ("system",)
_RULES = (
    "tool_rules",
    "action_rules",
    "action_diversity",
    "workspace",
    "spawn_rules",
    "frames",
    "units",
    "output",
    "context",
)
INITIAL = ("mission_initial", "procedure", *_RULES)
EVOLUTION = ("mission_evolve", "procedure", "evolution_rules", *_RULES)
GIVEN = ("mission_given", "procedure", *(rule for rule in _RULES if rule not in ("tool_rules", "spawn_rules")))


class Prompts:
    """The templates of one folder, and which of them each use is composed of.

    Args:
        folder: where the templates are; None: the project's own.
        rollout: how plans are executed, since templates tell; None: the defaults.
        system: the parts of the system message; none: no system message.
        initial: the parts of a first sampling.
        evolution: the parts of a request that shows elites.
        given: the parts of a request for action plans only, for a tool that is there already.

    Raises:
        UserError: the folder or a part's template is missing, or a template is not valid Jinja.
    """

    def __init__(
        self,
        folder: Path | None = None,
        rollout: RolloutSettings | None = None,
        system: Sequence[str] = SYSTEM,
        initial: Sequence[str] = INITIAL,
        evolution: Sequence[str] = EVOLUTION,
        given: Sequence[str] = GIVEN,
    ) -> None:
        self.rollout = rollout or RolloutSettings()
        self.system, self.initial = tuple(system), tuple(initial)
        self.evolution, self.given = tuple(evolution), tuple(given)
        self._templates = _load(folder, {*self.system, *self.initial, *self.evolution, *self.given})

    def compose(self, brief: Brief, picture: Picture | None) -> tuple[Message, ...]:
        """A system message, and a user message: one text per part, then the picture.

        Raises:
            UserError: a template uses a name that is not there, or breaks otherwise.
            ValueError: an elite without a tool.
        """
        values = self._values(brief, picture)
        parts = self.evolution if brief.elites else self.initial
        parts = self.given if values["given"] is not None else parts
        user: list[Text | Picture] = [self._render(part, values) for part in parts]
        messages = [Message("user", (*user, picture) if picture else tuple(user))]
        if self.system:
            messages.insert(0, Message("system", tuple(self._render(part, values) for part in self.system)))
        return tuple(messages)

    def _values(self, brief: Brief, picture: Picture | None) -> dict[str, Any]:
        """What templates may use."""
        task, representation = brief.task, brief.representation
        given = representation.given(task)
        mounted = given if given is not None else Tool(gripper=brief.gripper)
        return {
            "given": given,
            "brief": brief,
            "task": task,
            "picture": picture is not None,
            "tool_rules": representation.instructions(brief).strip(),
            "task_source": task.source().rstrip("\n"),
            "vocabulary": "\n\n".join(inspect.getsource(of).rstrip() for of in (Task, Part, Body, Goal, table, floor)),
            "executor": inspect.getsource(plan_motion).rstrip(),
            "urdf": assemble(mounted, visuals=False, mesh_path=lambda path: path.name).rstrip(),
            "home_xyz": _numbers(task.home.position),
            "home_rpy": _numbers(task.home.rpy),
            "rollout": self.rollout,
            "max_waypoints": MAX_WAYPOINTS,
            "schema": json.dumps(answer_schema(brief), indent=1, ensure_ascii=False),
            "elites": json.dumps([_shown(e, representation) for e in brief.elites], indent=1, ensure_ascii=False),
            "other_kind": any(_tool(elite).gripper != brief.gripper for elite in brief.elites),
        }

    def _render(self, part: str, values: dict[str, Any]) -> Text:
        try:
            text = self._templates[part].render(values)
        except jinja2.TemplateError as error:
            raise UserError(
                f"prompt template {part}{SUFFIX}: {_one_line(error)}; a template may use: {', '.join(sorted(values))}"
            ) from error
        return Text(text.strip() + "\n\n")  # a blank line, however a client joins the texts


def answer_schema(brief: Brief) -> dict[str, Any]:
    """JSON schema of the answer to ``brief``: a scene analysis, and strategies, each a tool and its action plans."""
    numbers = 7 if brief.gripper else 6
    given = brief.representation.given(brief.task) is not None
    waypoint = _list({"type": "number"}, numbers, numbers)
    plan = _list(waypoint, 1)
    strategy: dict[str, Any] = {
        "strategy_name": {"type": "string"},
        "strategy_description": {"type": "string"},
        **({} if given else {"tool_name": {"type": "string"}, "tool_description": {"type": "string"}}),
        "gripper": {"type": "boolean", "enum": [brief.gripper]},
        **brief.representation.schema(),
        "action_description": {"type": "string"},
        "action_sets": _list(plan, brief.n_action, brief.n_action),
    }
    if brief.elites:
        ids = [elite.candidate.id for elite in brief.elites]
        strategy = {"parents": _list({"type": "string", "enum": ids}, 1, min(2, len(ids))), **strategy}
    strategies = _list(_object(strategy), brief.n_tool, brief.n_tool)
    return _object({"scene_analysis": {"type": "string"}, "strategies": strategies})


def _object(properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}


def _list(items: dict[str, Any], least: int, most: int | None = None) -> dict[str, Any]:
    limits = {"minItems": least} if most is None else {"minItems": least, "maxItems": most}
    return {"type": "array", "items": items, **limits}


def _load(folder: Path | None, parts: set[str]) -> dict[str, jinja2.Template]:
    root = importlib.resources.files("prompts") if folder is None else folder
    if not root.is_dir():
        raise UserError(f"no prompt folder {root}; name one that holds the templates, or none for the project's own")
    # Sandboxed: a folder may be a stranger's, and a template fills in text, no more.
    environment = SandboxedEnvironment(
        undefined=jinja2.StrictUndefined, autoescape=False, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["counted"] = counted
    there = {file.name: file for file in root.iterdir() if file.name.endswith(SUFFIX)}
    templates = {}
    for part in sorted(parts):
        name = part + SUFFIX
        if name not in there:
            raise choices("prompt template", name, there, str(root))
        try:
            templates[part] = environment.from_string(there[name].read_text(encoding="utf-8"))
        except jinja2.TemplateSyntaxError as error:
            raise UserError(f"prompt template {name}, line {error.lineno}: {_one_line(error)}") from error
    return templates


def counted(number: int, what: str) -> str:
    """A template's filter: ``one tool``, ``10 tools``."""
    return f"one {what}" if number == 1 else f"{number} {what}s"


def _shown(elite: Evaluation, representation: ToolRepresentation) -> dict[str, Any]:
    """What an evolution request tells of an elite."""
    candidate, tool = elite.candidate, _tool(elite)
    return {
        "id": candidate.id,
        "reward": round(elite.reward, 4),
        "strategy_name": candidate.strategy_name,
        "strategy_description": candidate.strategy_description,
        "tool_name": tool.name,
        "tool_description": tool.description,
        "gripper": tool.gripper,
        **representation.dump(tool),
    }


def _tool(elite: Evaluation) -> Tool:
    if elite.candidate.tool is None:
        raise ValueError(f"elite {elite.candidate.id} has no tool")
    return elite.candidate.tool


def _numbers(values: Vector) -> str:
    return "(" + ", ".join(f"{round(float(value), 4) + 0.0:g}" for value in values) + ")"


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
