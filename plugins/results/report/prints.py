"""The best tools as files for a printer: each rigid link one closed body, as a run's ``best/tool.stl`` has it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from plugins.results.pages.figure import slug
from plugins.results.pages.tools import Winner
from plugins.results.report.results import Results
from plugins.results.workshop.printing import PrintedPart, grams, to_3mf, to_stl
from plugins.results.workshop.settings import Printer
from plugins.results.workshop.tool import print_bodies

TOOLS = Path("tools")  # the folder of the files, beside the page


@dataclass(frozen=True, eq=False)
class ToolPrint:
    """A tool of a report as bodies to print; ``folder`` is that of its files, from the page's."""

    title: str
    winner: Winner
    parts: list[PrintedPart]
    folder: Path

    @property
    def grams(self) -> float:
        return grams(self.parts)

    @property
    def ready(self) -> bool:
        return all(part.ready for part in self.parts)

    def files(self) -> dict[str, Callable[[], bytes]]:
        """The design, and STL and 3MF files in millimetres, laid on the plate; each with what makes it."""
        design = json.dumps({"strategies": [self.winner.design]}, indent=2) + "\n"
        files: dict[str, Callable[[], bytes]] = {part.file: partial(to_stl, part) for part in self.parts}
        files |= {"tool.3mf": partial(to_3mf, self.parts), "design.json": design.encode}
        return {(self.folder / name).as_posix(): make for name, make in files.items()}


def tool_prints(results: Results) -> list[ToolPrint]:
    """Make the best tool of each task and method, as a usual printer takes it."""
    printer = Printer()
    prints = []
    for number, ((task, method), winner) in enumerate(results.tools.best.items(), 1):
        parts = print_bodies(winner.tool, printer, winner.material)
        folder = TOOLS / f"{number}_{slug(task, 40)}_{slug(winner.name, 40) or 'tool'}"
        prints.append(ToolPrint(f"{task}, {method}: {winner.name}", winner, parts, folder))
    return prints
