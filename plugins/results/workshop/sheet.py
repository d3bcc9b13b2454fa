"""Write the sheet of a tool, a page: what it weighs and bears, how it prints, and what fails."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from core.design import RIGID_MOUNT
from core.designs.statics import flange_moment
from core.interfaces import Material, Task
from core.support.cli import write_bytes
from core.support.templates import macros
from plugins.results.pages.best_tool import size
from plugins.results.pages.page import (
    data_address,
    drawn_in_viewer,
    in_viewer,
    render,
)
from plugins.results.workshop.assembly import draw_apart, picture
from plugins.results.workshop.clearance import payload
from plugins.results.workshop.joints import Joint
from plugins.results.workshop.printing import Check, PrintedPart
from plugins.results.workshop.strength import Strength
from plugins.results.workshop.tool import PrintedTool
from plugins.results.workshop.verdicts import list_verdicts

HOW = "Strength: forces of the rollout where they act, on beams; without notches, {}axial forces and fatigue."


SHOWN = (
    False,
    None,
    True,
)  # the order of checks: what fails, what is not known, what passed


def figures(
    printed_tool: PrintedTool, strengths: Sequence[Strength], task: Task
) -> dict[str, Any]:
    """Return all that the sheet says of a tool, as data; what bolts it to the arm is borne, too.

    ``to_mount`` (4, 4) leads from a piece's file to the frame of its mount, millimetres.

    Args:
        printed_tool: the tool as parts.
        strengths: the worst of each component.
        task: what it was made for.
    """
    tool = printed_tool.tool
    material = printed_tool.material
    robot = task.robot.life_size
    verdicts = list_verdicts(printed_tool, strengths, task)
    factors = [row.safety for row in strengths if row.safety is not None]
    load = payload(robot, printed_tool.printed)
    words = macros("plugins.results.workshop", "words")
    flange = words.flange(robot.flange, math.degrees)

    return {
        "tool": tool.name or "a tool",
        "task": task.name,
        "date": datetime.now().astimezone().date().isoformat(),
        "robot": robot.title,
        "material": _describe_material(material),
        "mass_kg": load["mass_kg"],
        "center_m": load["center_m"],
        "frame": load["frame"],
        "moment_nm": flange_moment(printed_tool.printed, robot),
        "pieces": [_describe_piece(part) for part in printed_tool.parts],
        "sliced": dict(printed_tool.sliced),
        "hardware": list(printed_tool.hardware),
        "flange": flange if RIGID_MOUNT in tool.mounts else None,
        "joints": [_describe_joint(joint) for joint in printed_tool.joints],
        "parts": _describe_components(printed_tool, strengths),
        "least_safety": min(factors, default=None),
        "verdicts": [verdict._asdict() for verdict in verdicts],
        "ready": all(verdict.passed is not False for verdict in verdicts),
        "how": HOW.format("" if material.is_metal else "layers, "),
    }


def _describe_material(material: Material) -> str:
    if not material.density_kg_m3:
        return "paper, nothing real"
    return f"{material.name}, {material.filling}"


def _describe_piece(part: PrintedPart) -> dict[str, Any]:
    return {
        "name": part.name,
        "file": part.file,
        "size_mm": np.round(part.lying.size, 2).tolist(),
        "volume_cm3": round(float(part.mesh.volume) / 1000, 3),
        "contact_mm2": round(part.lying.contact_mm2, 1),
        "overhang_mm2": round(part.lying.overhang_mm2, 1),
        "mass_g": round(part.mass_g, 2),
        "to_mount": np.round(part.to_mount, 6).tolist(),
    }


def _describe_joint(joint: Joint) -> dict[str, Any]:
    """Describe what joins two pieces: ``place_mm`` (3,) and ``along`` (3,) are in the frame of the mount."""
    below, above = joint.pieces
    return {
        "name": joint.name,
        "component": joint.component,
        "tongue_of": below,
        "socket_of": above,
        "screw": joint.screw,
        "reach_mm": round(joint.reach_mm, 1),
        "thicker_mm": round(joint.thicker_mm, 2),
        "place_mm": np.round(1000 * joint.place, 2).tolist(),
        "along": np.round(joint.along, 4).tolist(),
    }


def _describe_components(
    printed_tool: PrintedTool, strengths: Sequence[Strength]
) -> list[dict[str, Any]]:
    """Return the components and the joints with what they bear, the weakest first."""
    borne = {row.component: asdict(row) for row in strengths}
    names = {joint.name for joint in printed_tool.joints}
    joints = [
        component
        for component in printed_tool.mounted.components
        if component.name in names
    ]
    components = []
    for component in (*printed_tool.tool.components, *joints):
        row = {
            "name": component.name,
            "size_mm": np.round(1000 * component.shape.bounds[1], 1).tolist(),
            "mass_kg": component.mass,
        }
        components.append(row | borne.get(component.name, {}))

    return sorted(components, key=lambda row: row.get("safety") or math.inf)


def write_sheet(
    printed_tool: PrintedTool,
    task: Task,
    strengths: Sequence[Strength],
    folder: Path,
    held: Sequence[str] = (),
) -> list[Check]:
    """Write ``sheet.html`` and ``sheet.json`` to a folder.

    Args:
        printed_tool: the tool as parts.
        task: what it was made for.
        strengths: the worst of each component.
        folder: where to.
        held: in how many layouts the design holds, in words.

    Returns:
        What was checked.

    Raises:
        UserError: a file can't be written.
    """
    robot = task.robot.life_size
    tool = printed_tool.tool
    data = figures(printed_tool, strengths, task) | {"held": list(held)}
    checks = [Check(**verdict) for verdict in data["verdicts"]]
    shown = [in_viewer(tool, robot, data["tool"], size(tool, robot))]
    apart = None
    if printed_tool.joints:
        pieces = draw_apart(printed_tool.parts, printed_tool.joints, robot)
        shown.append(drawn_in_viewer(pieces, "In pieces", "drawn apart"))
        drawn = picture(pieces)
        write_bytes(folder / "tool" / "pieces.png", drawn)
        apart = data_address(drawn)

    page = render(
        "sheet.html.j2",
        folder,
        shown,
        title=data["tool"],
        apart=apart,
        sheet=data,
        checks=sorted(checks, key=lambda check: SHOWN.index(check.passed)),
        failing={check.part for check in checks if check.passed is False},
    )
    write_bytes(folder / "sheet.html", page.encode())
    write_bytes(folder / "sheet.json", (json.dumps(data, indent=2) + "\n").encode())

    return checks
