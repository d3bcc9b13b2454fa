"""Tools of a library, which are tried before a model is asked for others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from core.config.compose import part
from core.design import Candidate, DesignError, Tool
from core.designs.reading import dump_names, load_designs, read_designs
from core.designs.tool_fields import dump_fixture, read_tool
from core.errors import UsageError
from core.geometry import Array
from core.interfaces import Brief, JsonObject, Numbers, Task, ToolRepresentation
from core.plugins import TOOL
from core.store.library import DESIGN, list_library, read_kept
from core.values.plans import NO_PLAN

Form = Mapping[str, Any]
"""A representation: its ``name`` and settings."""


class LibraryTools(ToolRepresentation):
    """A representation of tools with those of a library beside it: they are tried first (`kept`).

    Args:
        library: the folder.
        form: the representation in which the model writes others, and in which all are stored.
    """

    def __init__(self, library: Path, form: Form) -> None:
        self._library = library
        self._settings = form
        self.shapes = part(TOOL, OmegaConf.create({**form})).declared(
            "shapes", ToolRepresentation.shapes
        )

    @cached_property
    def _form(self) -> ToolRepresentation:
        return self._make(self._settings)

    def _make(self, form: Form) -> ToolRepresentation:
        """Make a representation for the robot, the material and the printer of this one."""
        chosen = part(TOOL, OmegaConf.create({**form}))
        return replace(chosen, material=self.material, printer=self.printer).create(
            robot=self.robot
        )

    # --- the library ------------------------------------------------------------------------------------------------

    def kept(self, task: Task) -> Sequence[Candidate]:
        if self._form.given(task) is not None:
            name = self._settings["name"]
            raise UsageError(
                f"tool.of={name} gives a tool; name a form in which tools are written, such as tool.of=urdf"
            )

        folders = list_library(self._library)
        return [
            self._read(folder, number, task) for number, folder in enumerate(folders)
        ]

    def _read(self, folder: Path, number: int, task: Task) -> Candidate:
        """Read a tool and its plan, for this robot and material."""
        _, config = read_kept(folder, ["tool"])
        document = load_designs(folder / DESIGN, within=folder)
        base = Candidate(None, NO_PLAN, 0, number)
        theirs = self._make(config["tool"])
        candidate = read_designs(document, theirs, task, base=base)[0]
        if candidate.tool is None:
            return candidate

        same = read_designs(document, self._form, task, base=base)[0]
        if same.tool is not None and same.tool.content == candidate.tool.content:
            return same

        try:
            tool = self._rewrite(candidate, task)
        except DesignError as error:
            name = self._settings["name"]
            problem = f"tool.of={name} can't write this tool: {error}"
            return replace(candidate, tool=None, problem=problem)

        return replace(candidate, tool=tool)

    def _rewrite(self, candidate: Candidate, task: Task) -> Tool:
        """Write a tool in the form that the model uses, and read it.

        Raises:
            DesignError: the form can't write it.
        """
        tool = candidate.tool
        assert tool is not None
        fields = dump_names(candidate) | self._form.dump(tool)
        fields |= dump_fixture(tool, self._form)

        return read_tool(fields, self._form, tool.gripper, task)

    # --- what the form does -----------------------------------------------------------------------------------------

    def instructions(self, brief: Brief) -> str:
        return self._form.instructions(brief)

    def schema(self) -> JsonObject:
        return self._form.schema()

    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        return self._form.parse(data, gripper=gripper)

    def dump(self, tool: Tool) -> JsonObject:
        return self._form.dump(tool)

    def abridge(self, tool: Tool) -> JsonObject:
        return self._form.abridge(tool)

    def parameters(self, design: Tool) -> Numbers:
        return self._form.parameters(design)

    def with_parameters(self, design: Tool, values: Array) -> Tool:
        return self._form.with_parameters(design, values)

    def toward(self, design: Tool, other: Tool) -> Array | None:
        return self._form.toward(design, other)
