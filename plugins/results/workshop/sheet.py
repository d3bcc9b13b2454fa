"""Write the sheet of a tool, one page: dimensions, what it weighs and bears, how it prints, and what fails."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from core.design import RIGID_MOUNT, Tool
from core.designs.statics import flange_moment
from core.geometry import Array
from core.interfaces import Task
from core.robot.meshes import as_held
from core.scene import Camera, Scene
from core.support.cli import write_bytes
from core.support.text import clean
from core.values.robots import Robot
from plugins.results.pages.drawing import Painted, draw, painted
from plugins.results.pages.figure import COLORS, INK, FigurePage, new_figure
from plugins.results.workshop.clearance import payload
from plugins.results.workshop.printing import Check
from plugins.results.workshop.strength import Strength, measured
from plugins.results.workshop.verdicts import carried, printable, strong

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from plugins.results.workshop.motion import PlayedMotion, Sampled
    from plugins.results.workshop.tool import PrintedTool

A4_MM = (210.0, 297.0)
RED, GREEN, SOFT = "#c62828", "#1b7f3b", "#57606a"
SCALES = (0.2, 0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 15, 20)  # millimetres of the tool to one on paper
ROWS, VERDICTS, NUMBERED = 14, 9, 26
VIEWS = {"from the side": (0.0, -1.0, 0.0), "from the front": (1.0, 0.0, 0.0), "from above": (0.0, 0.0, 1.0)}  # the eye
_CELLS = ((12.0, 204.0), (106.0, 204.0), (12.0, 136.0), (106.0, 136.0))  # lower left corners of views and picture, mm
_CELL, _ROOM = (92.0, 66.0), (24.0, 20.0)  # of a view on paper, and of it for dimensions and the title, mm
_PIXELS = 920, 660

HOW = "Strength: forces of the rollout where they act, on beams; without notches, {}axial forces and fatigue."


def figures(tool: Tool, robot: Robot, made: PrintedTool, strengths: Sequence[Strength], task: Task) -> dict[str, Any]:
    """Return all that the sheet says of a tool, as data; what bolts it to the arm is borne, too.

    ``to_mount`` (4, 4) leads from a piece's file to the frame of its mount, millimetres.
    """
    material, load = made.material, payload(robot, made.printed)
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
                "file": made.file(number),
                "size_mm": np.round(part.mesh.extents, 2).tolist(),
                "volume_cm3": round(float(part.mesh.volume) / 1000, 3),
                "mass_g": round(part.mass_g, 2),
                "to_mount": np.round(part.to_mount, 6).tolist(),
            }
            for number, part in enumerate(made.parts)
        ],
        "joints": [str(joint) for joint in made.joints],
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
    tool: Tool,
    task: Task,
    scene: Scene,
    motion: Sampled,
    replays: Mapping[str, PlayedMotion],
    folder: Path,
) -> list[Check]:
    """Write ``sheet.pdf`` and ``sheet.json`` to a folder; return what was checked.

    Raises:
        UserError: a file can't be written.
    """
    robot = task.robot
    said = figures(tool, robot, made, measured(tool, robot, made.material, scene, motion, replays), task)
    page = FigurePage("sheet", said["tool"], lambda: draw_page(tool, robot, said))
    write_bytes(folder / "sheet.pdf", page.render("pdf", titled=False))
    write_bytes(folder / "sheet.json", (json.dumps(said, indent=2) + "\n").encode())
    return [Check(**verdict) for verdict in said["verdicts"]]


def _notes(said: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Write the figures of the tool and of each piece, and what was checked, a line and its colour each."""
    center = ", ".join(str(round(1000 * value)) for value in said["center_m"])
    lines = [
        f"mass {said['mass_kg']:.3f} kg; centre of gravity ({center}) mm in {said['frame']}",
        f"moment at the flange {said['moment_nm']:.2f} N m",
    ]
    for piece in said["pieces"]:
        size = " × ".join(f"{side:.0f}" for side in piece["size_mm"])
        lines.append(f"{piece['name']}: {size} mm as it lies; {piece['mass_g']:.0f} g")
    lines += [f"joined by {joint}" for joint in said["joints"]]
    lines += [f"flange: {said['flange']}"] if said["flange"] else []
    lines += [f"bought: {'; '.join(said['hardware'])}"] if said["hardware"] else []
    shown = sorted(said["verdicts"], key=lambda of: (of["passed"] is not False, of["passed"] is True))
    looks = {True: ("✓", INK), False: ("✗", RED), None: ("–", SOFT)}
    notes = [(line, INK) for line in [*lines, ""]]
    notes += [(f"{looks[of['passed']][0]} {Check(**of)}", looks[of["passed"]][1]) for of in shown[:VERDICTS]]
    failing = sum(of["passed"] is False for of in shown[VERDICTS:])
    more = f"and {len(shown) - VERDICTS} more, {failing} of which fail"
    return [*notes, (more, SOFT)] if len(shown) > VERDICTS else notes


HEADS = ("", "component", "size, mm", "turned, °", "g", "load", "N", "lever, mm", "MPa", "safety", "bends, mm")
_WIDTHS = (5, 29, 32, 22, 8, 28, 9, 17, 9, 12, 15)  # of the columns, mm


def _row(number: int, part: Mapping[str, Any]) -> list[str]:
    """Write the cells of a component."""
    size = " × ".join(f"{side:g}" for side in part["size_mm"])
    turned = " ".join(f"{angle:g}" for angle in part["turned_deg"]) if any(part["turned_deg"]) else ""
    cells = [str(number), clean(part["name"], 20), size, turned, f"{1000 * part['mass_kg']:.0f}"]
    if "stress_pa" not in part:
        return [*cells, *[""] * 6]
    safety = "–" if part["safety"] is None else f"{part['safety']:.2f}" if part["safety"] < 100 else "> 100"
    load = f"{part['load']}, {part['engine']}" if part["engine"] else part["load"]
    cells += [clean(load, 18), f"{part['newtons']:.1f}", f"{1000 * part['lever_m']:.0f}"]
    return [*cells, f"{part['stress_pa'] / 1e6:.1f}", safety, f"{1000 * part['bend_m']:.1f}"]


def draw_page(tool: Tool, robot: Robot, said: Mapping[str, Any]) -> Figure:
    """Draw the whole sheet on A4: three views and a picture, text, and a table of the weakest components."""
    figure = new_figure(A4_MM[0] / 25.4, A4_MM[1] / 25.4)
    figure.set_layout_engine("none")
    page = figure.add_axes((0, 0, 1, 1))
    page.set(xlim=(0, A4_MM[0]), ylim=(0, A4_MM[1]))
    page.axis("off")
    page.text(12, 284, clean(str(said["tool"]), 60), fontsize=15, fontweight="bold", va="center")
    origin = f"{said['task']}; {said['robot']}; {said['material']}; {said['date']}"
    page.text(12, 277.5, origin, fontsize=8, color=SOFT, va="center")
    verdict, color = ("ready to make", GREEN) if said["ready"] else ("not to be made as it is", RED)
    page.text(198, 284, verdict, fontsize=11, fontweight="bold", color=color, ha="right", va="center")
    _views(figure, tool, robot, said)
    at = 130.0
    for line, color in _notes(said):
        wrapped = textwrap.wrap(clean(line, 600), 130, subsequent_indent="   ")
        page.text(12, at, "\n".join(wrapped), fontsize=7.5, color=color, va="top", linespacing=1.25)
        at -= 3.6 * len(wrapped) + 0.4
    _table(page, at - 2, said)
    page.text(12, 13, said["how"], fontsize=6, color=SOFT, va="top")
    return figure


def _table(page: Axes, top: float, said: Mapping[str, Any]) -> None:
    """Draw a row for each component, the weakest first; what fails is red."""
    from matplotlib.transforms import Bbox

    parts = said["parts"][: min(ROWS, int((top - 24) / 3.6))]
    rows = [_row(number, part) for number, part in enumerate(parts, 1)]
    widths, height = np.array(_WIDTHS) / A4_MM[0], 3.6 * (len(rows) + 1) / A4_MM[1]
    box = Bbox.from_bounds(12 / A4_MM[0], top / A4_MM[1] - height, float(widths.sum()), height)
    grid = page.table([list(HEADS), *rows], colWidths=widths.tolist(), cellLoc="left", bbox=box, edges="")
    grid.auto_set_font_size(False)
    failing = {of["name"].partition(", ")[2] for of in said["verdicts"] if of["passed"] is False}
    for (row, _), cell in grid.get_celld().items():
        weight, bad = "normal" if row else "bold", row > 0 and parts[row - 1]["name"] in failing
        cell.set(fontsize=7, linewidth=0)
        cell.PAD = 0
        cell.get_text().set(color=RED if bad else INK, fontweight=weight)
    if left := len(said["parts"]) - len(parts):
        page.text(12, top - A4_MM[1] * height - 1, f"and {left} stronger ones", fontsize=7, color=SOFT, va="top")


def _views(figure: Figure, tool: Tool, robot: Robot, said: Mapping[str, Any]) -> None:
    """Draw three views to one scale and a picture, in four cells."""
    from matplotlib.colors import to_rgb

    held = as_held(tool, robot)
    numbers = {part["name"]: number for number, part in enumerate(said["parts"], start=1)}
    colors = {name: 0.85 + 0.15 * np.array(to_rgb(COLORS[(n - 1) % len(COLORS)])) for name, n in numbers.items()}
    pale = [Painted(solid, (*colors[component.name].tolist(), 1.0)) for component, solid in held]
    places = [(numbers[component.name], 1000 * np.asarray(solid.bounds).mean(axis=0)) for component, solid in held]
    points = 1000 * np.concatenate([solid.vertices for _, solid in held])
    center = 1000 * np.average([s.center_mass for _, s in held], axis=0, weights=[c.mass for c, _ in held])
    ways = [Camera(eye, (0.0, 0.0, 0.0)).axes[:2] for eye in VIEWS.values()]  # right and up (2, 3)
    room = np.subtract(_CELL, _ROOM)
    wanted = max(float((np.ptp(points @ way.T, axis=0) / room).max()) for way in ways)
    scale = next((scale for scale in SCALES if scale >= wanted), wanted)
    titles = [*VIEWS, f"1 : {scale:.3g}, millimetres, as held at home; + flange, × centre of gravity"]
    cells = []
    for title, corner in zip(titles, _CELLS, strict=True):
        ax = figure.add_axes((*np.divide(corner, A4_MM), *np.divide(_CELL, A4_MM)))
        ax.text(0, 1, title, fontsize=7, color=SOFT, va="top", transform=ax.transAxes)
        ax.axis("off")
        cells.append(ax)
    for eye, way, ax in zip(VIEWS.values(), ways, cells, strict=False):
        flat, half = points @ way.T, scale * np.array(_CELL) / 2
        low, high = flat.min(axis=0), flat.max(axis=0)
        (x, y), (left, up) = (low + high) / 2, np.array([2.0, -1.0]) * scale
        shown = x - half[0], x + half[0], y - half[1], y + half[1]
        ax.imshow(draw(pale, *_PIXELS, eye, 2 * half[0] / 1000), extent=shown, aspect="auto")
        ax.set(xlim=(shown[0] + left, shown[1] + left), ylim=(shown[2] + up, shown[3] + up))
        _number(ax, [(number, way @ place) for number, place in places] if len(places) <= NUMBERED else [])
        _dimensions(ax, low, high, scale)
        for mark, at in (("+", np.zeros(3)), ("x", center)):
            ax.plot(*(way @ at), mark, color=RED, ms=4, mew=0.7)
    cells[-1].imshow(draw(painted(tool, robot), *_PIXELS))


def _number(ax: Axes, numbered: Sequence[tuple[int, Array]]) -> None:
    """Write the numbers of components at their places (2,); those at one place side by side."""
    apart = 0.045 * float(np.ptp(ax.get_xlim()))
    places: dict[tuple[float, ...], list[tuple[int, Array]]] = {}
    for number, at in numbered:
        places.setdefault(tuple(np.round(at / apart)), []).append((number, at))
    frame = {"boxstyle": "round,pad=0.2", "fc": "white", "ec": INK, "lw": 0.4}
    for found in places.values():
        (x, y), text = found[0][1], ", ".join(str(number) for number in sorted(number for number, _ in found))
        ax.text(x, y, text, fontsize=5, ha="center", va="center", bbox=frame)


def _dimensions(ax: Axes, low: Array, high: Array, scale: float) -> None:
    """Draw the overall width below, the overall height on the right."""
    (x, y), (width, height), away = (low + high) / 2, high - low, 5 * scale
    arrow = {"arrowstyle": "|-|,widthA=0.3,widthB=0.3", "lw": 0.5, "color": INK, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (low[0], low[1] - away), (high[0], low[1] - away), arrowprops=arrow)
    ax.annotate("", (high[0] + away, low[1]), (high[0] + away, high[1]), arrowprops=arrow)
    ax.text(x, low[1] - 1.3 * away, f"{width:.1f}", fontsize=6.5, ha="center", va="top")
    ax.text(high[0] + 1.3 * away, y, f"{height:.1f}", fontsize=6.5, ha="left", va="center")
