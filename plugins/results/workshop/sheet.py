"""Write the sheet of a tool, one page: dimensions, what it weighs and bears, how it prints, and what fails."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from core.config.settings import Printer
from core.design import Tool
from core.designs.weight import flange_moment
from core.scene import Scene
from core.support.cli import write_bytes
from core.values.materials import Material
from core.values.robots import Robot
from plugins.results.pages.figure import FigurePage
from plugins.results.pages.page import data_address, render
from plugins.results.workshop.payload import payload
from plugins.results.workshop.printing import LAYER_S, Check, Piece, estimate
from plugins.results.workshop.sheet_drawing import HEADS, draw_page, draw_views, lines, table
from plugins.results.workshop.strength import Strength, measured
from plugins.results.workshop.verdicts import Verdict, carried, printable, strong

if TYPE_CHECKING:
    from plugins.results.workshop.motion import Sampled
    from plugins.results.workshop.replay import Replay
    from plugins.results.workshop.tool import PrintedTool

HOW = (
    f"Print time: plastic at {{flow:g}} mm³/s and {LAYER_S:g} s for each layer of {{layer:g}} mm, no supports. "
    "Strength: forces of the rollout where they act, on beams; without notches, layers, axial forces and fatigue."
)


def printed(piece: Piece, material: Material, printer: Printer) -> dict[str, Any]:
    """Estimate how a piece prints; mass, time and filament only for walls with infill."""
    found = estimate(piece, material, printer)
    if not (material.density_kg_m3 and material.wall_mm):
        found = {"overhang_share": found["overhang_share"]}
    return {"name": piece.name, "size_mm": np.round(piece.mesh.extents, 2).tolist()} | found


def figures(
    tool: Tool,
    robot: Robot,
    material: Material,
    printer: Printer,
    made: Sequence[Piece],
    strengths: Sequence[Strength],
    mounted: Tool | None = None,
    checks: Sequence[Check] = (),
) -> dict[str, Any]:
    """Return all that the sheet says of a tool that is ``made`` of pieces, as data.

    ``mounted`` is the tool with what bolts it to the arm, which is borne too; ``checks`` are those of the whole tool.
    """
    mounted = mounted or tool
    load = payload(robot, mounted)
    verdicts = [*carried(mounted, robot, material), *printable(made, checks), *strong(material, strengths)]
    held = {row.component: row for row in strengths}
    parts = []
    for component in tool.components:
        row = held.get(component.name)
        size = np.round(1000 * component.shape.bounds[1], 1).tolist()
        parts.append(
            {"name": component.name, "size_mm": size, "mass_kg": component.mass} | (asdict(row) if row else {})
        )
    return {
        "tool": tool.name or "a tool",
        "robot": robot.title,
        "material": f"{material.name}, {material.filling}" if material.density_kg_m3 else "paper, nothing real",
        "mass_kg": load["mass_kg"],
        "center_m": load["center_m"],
        "frame": load["frame"],
        "moment_nm": flange_moment(mounted, robot),
        "pieces": [printed(piece, material, printer) for piece in made],
        "parts": sorted(parts, key=lambda part: part.get("safety") or math.inf),
        "least_safety": min((row.safety for row in strengths if row.safety is not None), default=None),
        "verdicts": [verdict._asdict() for verdict in verdicts],
        "ready": all(verdict.passed is not False for verdict in verdicts),
        "how": HOW.format(flow=printer.flow_mm3_s, layer=printer.layer_mm),
    }


def write_sheet(
    solid: PrintedTool,
    tool: Tool,
    robot: Robot,
    scene: Scene,
    motion: Sampled,
    replays: Mapping[str, Replay],
    folder: Path,
) -> list[Verdict]:
    """Write ``sheet.pdf``, ``sheet.html`` and ``sheet.json`` to a folder; return what was checked.

    Raises:
        UserError: a file can't be written.
    """
    material, made = solid.material, [part.piece for part in solid.parts]
    strengths = measured(tool, robot, material, scene, motion, replays)
    said = figures(tool, robot, material, solid.printer, made, strengths, solid.mounted, solid.checks)
    page = FigurePage("sheet", said["tool"], "", lambda: draw_page(tool, robot, said))
    views = replace(page, paint=lambda: draw_views(tool, robot, said))
    write_bytes(folder / "sheet.pdf", page.render("pdf", titled=False))
    drawing = data_address(views.render("svg", titled=False), "svg+xml")
    text: dict[str, Any] = {"lines": lines(said), "heads": HEADS, "rows": table(said)}
    html = render("sheet.html.j2", folder, title=f"{said['tool']}: sheet", said=said, drawing=drawing, **text)
    write_bytes(folder / "sheet.html", html.encode())
    write_bytes(folder / "sheet.json", (json.dumps(said, indent=2) + "\n").encode())
    return [Verdict(**of) for of in said["verdicts"]]
