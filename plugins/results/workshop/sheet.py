"""Write the sheet of a tool, a page: what it weighs and bears, how it prints, and what fails."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from core.design import RIGID_MOUNT
from core.designs.statics import flange_moment
from core.interfaces import Task
from core.scene import Scene
from core.support.cli import write_bytes
from core.values.robots import Robot
from plugins.results.pages.page import in_viewer, render
from plugins.results.pages.tools import size
from plugins.results.workshop.clearance import payload
from plugins.results.workshop.motion import PlayedMotion, Sampled
from plugins.results.workshop.printing import Check
from plugins.results.workshop.strength import Strength, measured
from plugins.results.workshop.tool import PrintedTool
from plugins.results.workshop.verdicts import carried, printable, strong

HOW = "Strength: forces of the rollout where they act, on beams; without notches, {}axial forces and fatigue."


def figures(
    made: PrintedTool, strengths: Sequence[Strength], task: Task
) -> dict[str, Any]:
    """Return all that the sheet says of a tool, as data; what bolts it to the arm is borne, too.

    ``to_mount`` (4, 4) leads from a piece's file to the frame of its mount, millimetres.
    """
    tool = made.tool
    material = made.material
    robot = task.robot
    load = payload(robot, made.printed)
    verdicts = [
        *carried(made.printed, robot, material),
        *printable(made.parts, made.checks),
        *strong(material, strengths, task),
    ]
    held = {row.component: asdict(row) for row in strengths}
    components = [
        {
            "name": c.name,
            "size_mm": np.round(1000 * c.shape.bounds[1], 1).tolist(),
            "mass_kg": c.mass,
        }
        | held.get(c.name, {})
        for c in tool.components
    ]
    return {
        "tool": tool.name or "a tool",
        "task": task.name,
        "date": datetime.now().astimezone().date().isoformat(),
        "robot": robot.title,
        "material": f"{material.name}, {material.filling}"
        if material.density_kg_m3
        else "paper, nothing real",
        "mass_kg": load["mass_kg"],
        "center_m": load["center_m"],
        "frame": load["frame"],
        "moment_nm": flange_moment(made.printed, robot),
        "pieces": [
            {
                "name": part.name,
                "file": part.file,
                "size_mm": np.round(part.mesh.extents, 2).tolist(),
                "volume_cm3": round(float(part.mesh.volume) / 1000, 3),
                "mass_g": round(part.mass_g, 2),
                "to_mount": np.round(part.to_mount, 6).tolist(),
            }
            for part in made.parts
        ],
        "hardware": list(made.hardware),
        "flange": _flange(robot) if RIGID_MOUNT in tool.mounts else None,
        "parts": sorted(components, key=lambda part: part.get("safety") or math.inf),
        "least_safety": min(
            (row.safety for row in strengths if row.safety is not None), default=None
        ),
        "verdicts": [verdict._asdict() for verdict in verdicts],
        "ready": all(verdict.passed is not False for verdict in verdicts),
        "how": HOW.format("" if material.metal else "layers, "),
    }


def _flange(robot: Robot) -> str:
    """Describe the ring of bolts, seen against the mount's z."""
    flange = robot.flange
    turn = math.degrees(robot.flange.bolt_angle)
    ring = f"{flange.bolts} x {flange.thread} on a circle of {1000 * flange.bolt_circle_m:g} mm"
    recess = (
        "" if flange.centring_m is None else f"; recess {1000 * flange.centring_m:g} mm"
    )
    pin = (
        ""
        if flange.pin_angle is None
        else f"; pin {1000 * flange.pin_m:g} mm at {math.degrees(flange.pin_angle):g}°"
    )
    return f"{ring}, the first at {turn:g}° from the mount's x; disc {2000 * flange.disc.radius:g} mm{recess}{pin}"


def write_sheet(
    made: PrintedTool,
    task: Task,
    scene: Scene,
    motion: Sampled,
    replays: Mapping[str, PlayedMotion],
    folder: Path,
) -> list[Check]:
    """Write ``sheet.html`` and ``sheet.json`` to a folder; return what was checked.

    Raises:
        UserError: a file can't be written.
    """
    robot = task.robot
    tool = made.tool
    said = figures(
        made, measured(tool, robot, made.material, scene, motion, replays), task
    )
    checks = [Check(**verdict) for verdict in said["verdicts"]]
    page = render(
        "sheet.html.j2",
        folder,
        [in_viewer(tool, robot, said["tool"], size(tool, robot))],
        title=said["tool"],
        said=said,
        checks=sorted(
            checks, key=lambda check: (check.passed is not False, check.passed is True)
        ),
        failing={
            check.name.partition(", ")[2] for check in checks if check.passed is False
        },
    )
    write_bytes(folder / "sheet.html", page.encode())
    write_bytes(folder / "sheet.json", (json.dumps(said, indent=2) + "\n").encode())
    return checks
