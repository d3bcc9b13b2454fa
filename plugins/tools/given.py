"""Tools that are there: the bare gripper, those of a file or a library, and four by hand for RLBench's tasks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from omegaconf import OmegaConf

from core.config.compose import part
from core.design import Tool
from core.designs.reading import load_tool
from core.errors import UsageError, choices
from core.hooks import Names, PartsOf
from core.interfaces import GivenTools, Task, ToolRepresentation
from core.plugins import TOOL
from plugins.tools.library import Library, make_form

# Sizes and positions approximate those of the paper's ablation. Handles extend to the mount's origin, so that they
# touch the flange.
_RLBENCH = Path(__file__).with_name("rlbench.json")
_RLBENCH_TASKS = ("BringCube", "CleanTable", "ScoreGoal", "GatherSpheres")


class BareGripper(GivenTools):
    """The arm with its own gripper, or with nothing."""

    def given(self, task: Task) -> Tool:
        title = task.robot.title
        if task.robot.gripper is None:
            return Tool(
                name="bare flange",
                description=f"the flange of {title}, which has no gripper",
            )
        return Tool(
            gripper=True,
            name="bare gripper",
            description=f"the gripper of {title}, with its fingers",
        )


class FileTools(GivenTools):
    """The tool of the first design in a designs file, for which plans alone are designed.
    Args:
        file: the designs file.
        of: the representation in which tools are written: a name, or a mapping of a ``name`` and settings.
    """

    def __init__(self, file: str | Path, of: str | dict[str, Any] = "urdf") -> None:
        self._file = Path(file)
        self._form = {"name": of} if isinstance(of, str) else of
        self._tools: dict[int, Tool] = {}

    def given(self, task: Task) -> Tool:
        return self.read(0, task)

    def read(self, number: int, task: Task) -> Tool:
        """Read the tool of the design with this number, and keep it.

        Raises:
            UserError: there is none, or it can't be read.
        """
        if number not in self._tools:
            form = make_form(self._form, self)
            self._tools[number] = load_tool(self._file, number, form, task)

        return self._tools[number]


def make_known_tools(
    file: Annotated[str | Path, Names("file")] = "",
    library: Annotated[str | Path, Names("folder")] = "",
    of: Annotated[str | dict[str, Any], PartsOf("tool")] = "urdf",
) -> ToolRepresentation:
    """Make a representation of tools that are known.

    Args:
        file: a designs file, whose first tool is the only one: plans alone are designed.
        library: a folder that ``vlmgineer toolbox add`` wrote; its tools are tried before others are designed.
        of: the representation in which tools are written: a name, or a mapping of a ``name`` and settings.

    Raises:
        UsageError: both a file and a library are given, or neither.
    """
    if file and library:
        raise UsageError(
            "tool.file gives one tool, and tool.library many to begin with; leave one of them away"
        )
    if library:
        form = {"name": of} if isinstance(of, str) else of
        tools = part(TOOL, OmegaConf.create(form)).create()
        if isinstance(tools, GivenTools):
            raise UsageError(
                f"tool.of={form['name']} gives a tool; name a form in which tools are written, such as tool.of=urdf"
            )

        # An attribute of the object hides that of the class.
        vars(tools).update(kept=Library(Path(library), form, tools).read)
        return tools

    if file:
        return FileTools(file, of)
    raise UsageError(
        "tool=known needs tools: tool.file=FILE, a designs file, or tool.library=FOLDER, a library"
    )


class RLBenchTools(FileTools):
    """One tool for each of four tasks."""

    def __init__(self) -> None:
        super().__init__(_RLBENCH, "boxes")

    def given(self, task: Task) -> Tool:
        if task.name not in _RLBENCH_TASKS:
            raise choices(
                "given tool for task", task.name, _RLBENCH_TASKS, "tool=rlbench"
            )
        return self.read(_RLBENCH_TASKS.index(task.name), task)
