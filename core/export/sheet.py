"""Write the sheet of a tool, one page: dimensions, what it weighs and bears, how it prints, and what fails."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from core.cli import write_bytes
from core.design import Tool
from core.designs.weight import flange_moment
from core.export.payload import payload
from core.export.sheet_drawing import HEADS, draw_page, draw_views, lines, table
from core.export.strength import Strength, measured
from core.export.verdicts import carried, printable, strong
from core.materials import Material
from core.report.page import data_address, render
from core.report.plots import Picture
from core.report.printing import Piece
from core.robots import Robot
from core.scene import Scene

if TYPE_CHECKING:
    from core.export.motion import Sampled
    from core.export.replay import Replay

FLOW_MM3_S = 5.0  # of molten plastic, on average: a careful guess for a nozzle of 0.4 mm
LAYER_MM, LAYER_S = 0.2, 4.0  # of a layer: its height, and the time that its change takes, a guess
FILAMENT_MM = 1.75
STEEP = math.cos(math.pi / 4)  # a face that looks down by more than 45 degrees overhangs
_ON_PLATE_MM = 0.01

HOW = (
    f"Print time: plastic at {FLOW_MM3_S:g} mm³/s and {LAYER_S:g} s for each layer of {LAYER_MM:g} mm, no supports. "
    "Strength: forces of the rollout, whole and across, on beams; without notches, layers, torsion and fatigue."
)


def printed(piece: Piece, tool: Tool, material: Material) -> dict[str, Any]:
    """Estimate how a piece of a tool prints; mass, time and filament only for walls with infill."""
    mesh = piece.mesh
    down = np.asarray(mesh.face_normals)[:, 2] < -STEEP
    above = np.asarray(mesh.triangles)[:, :, 2].max(axis=1) > _ON_PLATE_MM
    found: dict[str, Any] = {
        "name": piece.name,
        "size_mm": np.round(mesh.extents, 2).tolist(),
        "overhang_share": float(mesh.area_faces[down & above].sum() / mesh.area),
    }
    if material.density_kg_m3 is not None and material.wall_mm > 0:
        shapes = [component.shape for component in tool.components]
        filled = sum(map(material.volume_of, shapes)) / sum(shape.volume for shape in shapes)
        plastic = filled * float(mesh.volume)
        layers = math.ceil(mesh.extents[2] / LAYER_MM)
        found["grams"] = plastic * material.density_kg_m3 * 1e-6
        found["filament_m"] = plastic / (math.pi / 4 * FILAMENT_MM**2) / 1000
        found["hours"] = (plastic / FLOW_MM3_S + layers * LAYER_S) / 3600
    return found


def figures(
    tool: Tool, robot: Robot, material: Material, made: Sequence[Piece], strengths: Sequence[Strength]
) -> dict[str, Any]:
    """Return all that the sheet says of a tool that is ``made`` of pieces, as data."""
    load = payload(robot, tool)
    verdicts = [*carried(tool, robot, material), *printable(made), *strong(material, strengths)]
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
        "moment_nm": flange_moment(tool, robot),
        "pieces": [printed(piece, tool, material) for piece in made],
        "parts": sorted(parts, key=lambda part: part.get("safety") or math.inf),
        "least_safety": min((row.safety for row in strengths if row.safety is not None), default=None),
        "verdicts": [verdict._asdict() for verdict in verdicts],
        "ready": all(verdict.passed is not False for verdict in verdicts),
        "how": HOW,
    }


def write_sheet(
    tool: Tool,
    robot: Robot,
    material: Material,
    made: Sequence[Piece],
    scene: Scene,
    motion: Sampled,
    replays: Mapping[str, Replay],
    folder: Path,
) -> dict[str, Any]:
    """Write ``sheet.pdf``, ``sheet.html`` and ``sheet.json`` to a folder; return what they say.

    Raises:
        UserError: a file can't be written.
    """
    said = figures(tool, robot, material, made, measured(tool, robot, material, scene, motion, replays))
    page = Picture("sheet", said["tool"], "", lambda: draw_page(tool, robot, said))
    views = replace(page, paint=lambda: draw_views(tool, robot, said))
    write_bytes(folder / "sheet.pdf", page.render("pdf", titled=False))
    drawing = data_address(views.render("svg", titled=False), "svg+xml")
    text: dict[str, Any] = {"lines": lines(said), "heads": HEADS, "rows": table(said)}
    html = render("sheet.html.j2", folder, title=f"{said['tool']}: sheet", said=said, drawing=drawing, **text)
    write_bytes(folder / "sheet.html", html.encode())
    write_bytes(folder / "sheet.json", (json.dumps(said, indent=2) + "\n").encode())
    return said
