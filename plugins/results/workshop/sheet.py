"""Write the sheet of a tool, a page to print: dimensions, what it weighs and bears, how it prints, and what fails."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from core.design import RIGID_MOUNT, Tool
from core.designs.statics import flange_moment
from core.geometry import Array
from core.interfaces import Task
from core.scene import Camera, Scene
from core.simulation.pictures import png
from core.support.cli import write_bytes
from core.values.robots import Robot
from plugins.results.pages.drawing import Painted, as_held, draw, painted
from plugins.results.pages.page import data_address, render
from plugins.results.workshop.clearance import payload
from plugins.results.workshop.motion import PlayedMotion, Sampled
from plugins.results.workshop.printing import Check
from plugins.results.workshop.strength import Strength, measured
from plugins.results.workshop.tool import PrintedTool
from plugins.results.workshop.verdicts import carried, printable, strong

SCALES = (0.2, 0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 15, 20)  # millimetres of the tool to one on paper
NUMBERED = 26  # components at most
VIEWS = {"from the side": (0.0, -1.0, 0.0), "from the front": (1.0, 0.0, 0.0), "from above": (0.0, 0.0, 1.0)}  # the eye
CELL_MM, _ROOM_MM = (92.0, 66.0), (24.0, 20.0)  # of a view on paper, and of it for dimensions
_PIXELS = 920, 660
PALE = (0.9, 0.93, 0.96, 1.0)  # of a view, in which numbers are read

HOW = "Strength: forces of the rollout where they act, on beams; without notches, {}axial forces and fatigue."


def figures(made: PrintedTool, strengths: Sequence[Strength], task: Task) -> dict[str, Any]:
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
    placed = tool.placed()
    components = [
        {
            "name": c.name,
            "size_mm": np.round(1000 * c.shape.bounds[1], 1).tolist(),
            "turned_deg": (np.round(placed[c.name][1].rotation.as_euler("xyz", degrees=True), 1) + 0.0).tolist(),
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
        "material": f"{material.name}, {material.filling}" if material.density_kg_m3 else "paper, nothing real",
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
        "least_safety": min((row.safety for row in strengths if row.safety is not None), default=None),
        "verdicts": [verdict._asdict() for verdict in verdicts],
        "ready": all(verdict.passed is not False for verdict in verdicts),
        "how": HOW.format("" if material.metal else "layers, "),
    }


def _flange(robot: Robot) -> str:
    """Describe the ring of bolts, seen against the mount's z."""
    flange, turn = robot.flange, math.degrees(robot.flange.bolt_angle)
    ring = f"{flange.bolts} x {flange.thread} on a circle of {1000 * flange.bolt_circle_m:g} mm"
    recess = "" if flange.centring_m is None else f"; recess {1000 * flange.centring_m:g} mm"
    pin = "" if flange.pin_angle is None else f"; pin {1000 * flange.pin_m:g} mm at {math.degrees(flange.pin_angle):g}°"
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
    said = figures(made, measured(tool, robot, made.material, scene, motion, replays), task)
    checks = [Check(**verdict) for verdict in said["verdicts"]]
    page = render(
        "sheet.html.j2",
        folder,
        title=said["tool"],
        said=said,
        checks=sorted(checks, key=lambda check: (check.passed is not False, check.passed is True)),
        failing={check.name.partition(", ")[2] for check in checks if check.passed is False},
        views=views(tool, robot, [part["name"] for part in said["parts"]]),
        picture=data_address(png(draw(painted(tool, robot), *_PIXELS))),
        cell=CELL_MM,
    )
    write_bytes(folder / "sheet.html", page.encode())
    write_bytes(folder / "sheet.json", (json.dumps(said, indent=2) + "\n").encode())
    return checks


def views(tool: Tool, robot: Robot, names: Sequence[str]) -> list[dict[str, Any]]:
    """Draw the views to one scale, for the template: lengths are millimetres, to the right and down.

    ``names`` are those of the components by their numbers, the first 1.
    """
    held = as_held(tool, robot)
    solids = [Painted(solid, PALE) for _, solid in held]
    places = {names.index(component.name) + 1: 1000 * solid.bounds.mean(axis=0) for component, solid in held}
    points = 1000 * np.concatenate([solid.vertices for _, solid in held])
    masses = [component.mass for component, _ in held]
    center = 1000 * np.average([solid.center_mass for _, solid in held], axis=0, weights=masses)

    ways = {title: Camera(eye, (0.0, 0.0, 0.0)).axes[:2] * [[1], [-1]] for title, eye in VIEWS.items()}
    room = np.subtract(CELL_MM, _ROOM_MM)
    wanted = max(float((np.ptp(points @ way.T, axis=0) / room).max()) for way in ways.values())
    scale = next((scale for scale in SCALES if scale >= wanted), wanted)
    shown = scale * np.array(CELL_MM)

    drawn = []
    for title, way in ways.items():
        low = (points @ way.T).min(axis=0)
        high = (points @ way.T).max(axis=0)
        view = {
            "title": title,
            "scale": scale,
            "picture": data_address(png(draw(solids, *_PIXELS, VIEWS[title], shown[0] / 1000))),
            "numbers": _numbers({number: way @ place for number, place in places.items()}, 0.045 * shown[0]),
            "low": low,
            "high": high,
            "corner": (low + high - shown) / 2,
            "center": way @ center,
        }
        drawn.append(view)
    return drawn


def _numbers(places: Mapping[int, Array], apart: float) -> list[tuple[str, Array]]:
    """Return what to write where (2,): the numbers of components at nearly one place are written side by side."""
    if len(places) > NUMBERED:
        return []
    near: dict[tuple[float, ...], list[int]] = {}
    for number in sorted(places):
        near.setdefault(tuple(np.round(places[number] / apart)), []).append(number)
    return [(", ".join(map(str, numbers)), places[numbers[0]]) for numbers in near.values()]
