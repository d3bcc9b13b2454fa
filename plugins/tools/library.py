"""Tools of a library, which are tried before a model is asked for others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from core.config.compose import part
from core.design import Candidate, DesignError
from core.designs.reading import dump_names, load_designs, read_designs
from core.designs.tool_fields import dump_fixture, read_tool
from core.interfaces import Task, ToolRepresentation
from core.plugins import TOOL
from core.store.library import DESIGN, list_library, read_kept
from core.values.plans import NO_PLAN

Form = Mapping[str, Any]
"""A representation: its ``name`` and settings."""


def make_form(form: Form, tools: ToolRepresentation) -> ToolRepresentation:
    """Make a representation for the robot, the material and the printer of another one."""
    chosen = part(TOOL, OmegaConf.create({**form}))
    return replace(chosen, material=tools.material, printer=tools.printer).create(
        robot=tools.robot
    )


class Library:
    """The tools of a library, for one task after another.

    Args:
        folder: of the library.
        form: the name and settings of a representation.
        tools: that representation, in which the model writes others, and in which all are stored.
    """

    def __init__(self, folder: Path, form: Form, tools: ToolRepresentation) -> None:
        self._folder = folder
        self._name = form["name"]
        self._tools = tools

    def read(self, task: Task) -> Sequence[Candidate]:
        """Read all tools, see `core.interfaces.ToolRepresentation.kept`."""
        folders = list_library(self._folder)
        return [
            self._read(folder, number, task) for number, folder in enumerate(folders)
        ]

    def _read(self, folder: Path, number: int, task: Task) -> Candidate:
        """Read a tool and its plan, for this robot and material."""
        _, config = read_kept(folder, ["tool"])
        document = load_designs(folder / DESIGN, within=folder)
        base = Candidate(None, NO_PLAN, 0, number)
        theirs = make_form(config["tool"], self._tools)
        candidate = read_designs(document, theirs, task, base=base)[0]
        if candidate.tool is None:
            return candidate

        same = read_designs(document, self._tools, task, base=base)[0]
        if same.tool is not None and same.tool.content == candidate.tool.content:
            return same

        # The form that the model uses writes it, and reads that.
        tools = self._tools
        try:
            fields = dump_names(candidate) | tools.dump(candidate.tool)
            fields |= dump_fixture(candidate.tool, tools)
            tool = read_tool(fields, tools, candidate.tool.gripper, task)
        except DesignError as error:
            problem = f"tool.of={self._name} can't write this tool: {error}"
            return replace(candidate, tool=None, problem=problem)

        return replace(candidate, tool=tool)
