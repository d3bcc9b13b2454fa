"""Draw the page of a tool's sheet: three views with dimensions, a picture, text and a table.

Covered by `tests/plugins/results/workshop/test_sheet.py`.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.solids.held import as_held
from core.support.text import clean, shorten
from core.values.robots import Robot
from plugins.results.pages.drawing import draw, painted
from plugins.results.pages.figure import COLORS, INK, new_figure
from plugins.results.workshop.printing import Check

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

A4_MM = (210.0, 297.0)
RED, GREEN, SOFT = "#c62828", "#1b7f3b", "#57606a"
SCALES = (0.2, 0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 15, 20)  # millimetres of the tool to one on paper
ROWS, VERDICTS, NUMBERED = 14, 9, 26
_EDGE = np.deg2rad(20.0)  # between two faces, above which their edge is drawn
_CELL, _ROOM = (92.0, 66.0), (24.0, 20.0)  # of a view on paper, and of it for dimensions and the title, mm
_CORNER = (12.0, 136.0)  # the lower left one of the views, mm
# Title; which axes go right, up, and toward the reader, and with which sign.
VIEWS = (
    ("from the side", np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])),
    ("from the front", np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])),
    ("from above", np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])),
)

HEADS = ("", "component", "size, mm", "turned, °", "g", "load", "N", "lever, mm", "MPa", "safety", "bends, mm")
_AT = (0, 5, 34, 66, 88, 96, 126, 135, 150, 159, 171)  # where the columns begin, mm


def lines(said: Mapping[str, Any]) -> list[str]:
    """Write the figures of the whole tool, and of each piece, a line each."""
    x, y, z = (1000 * value for value in said["center_m"])
    found = [
        f"mass {said['mass_kg']:.3f} kg; centre of gravity ({x:.0f}, {y:.0f}, {z:.0f}) mm in {said['frame']}",
        f"moment at the flange {said['moment_nm']:.2f} N m",
    ]
    for piece in said["pieces"]:
        size = " × ".join(f"{side:.0f}" for side in piece["size_mm"])
        found.append(f"{piece['name']}: {size} mm as it lies; {piece['mass_g']:.0f} g")
    found += [f"joined by {joint}" for joint in said["joints"]]
    found += [f"flange: {said['flange']}"] * (said["flange"] is not None)
    return [*found, f"bought: {'; '.join(said['hardware'])}"] if said["hardware"] else found


def table(said: Mapping[str, Any]) -> list[tuple[list[str], bool]]:
    """Write a row for each component, the weakest first, and whether it is one that fails."""
    failing = {of["name"].partition(", ")[2] for of in said["verdicts"] if of["passed"] is False}
    found = []
    for number, part in enumerate(said["parts"], start=1):
        size = " × ".join(f"{side:g}" for side in part["size_mm"])
        turned = " ".join(f"{angle:g}" for angle in part["turned_deg"]) if any(part["turned_deg"]) else ""
        cells = [str(number), part["name"], size, turned, f"{1000 * part['mass_kg']:.0f}"]
        if "stress_pa" in part:
            safety = "–" if part["safety"] is None else f"{part['safety']:.2f}" if part["safety"] < 100 else "> 100"
            by = f", {part['engine']}" if part["engine"] else ""
            cells += [part["load"] + by, f"{part['newtons']:.1f}", f"{1000 * part['lever_m']:.0f}"]
            cells += [f"{part['stress_pa'] / 1e6:.1f}", safety, f"{1000 * part['bend_m']:.1f}"]
        found.append((cells, part["name"] in failing))
    return found


def draw_page(tool: Tool, robot: Robot, said: Mapping[str, Any]) -> Figure:
    """Draw the whole sheet on A4."""
    figure = new_figure(A4_MM[0] / 25.4, A4_MM[1] / 25.4)
    figure.set_layout_engine("none")
    page = figure.add_axes((0, 0, 1, 1))
    page.set(xlim=(0, A4_MM[0]), ylim=(0, A4_MM[1]))
    page.axis("off")
    page.text(12, 284, clean(str(said["tool"]), 60), fontsize=15, fontweight="bold", va="center")
    page.text(
        12,
        277.5,
        f"{said['task']}; {said['robot']}; {said['material']}; {said['date']}",
        fontsize=8,
        color=SOFT,
        va="center",
    )
    verdict, color = ("ready to make", GREEN) if said["ready"] else ("not to be made as it is", RED)
    page.text(198, 284, verdict, fontsize=11, fontweight="bold", color=color, ha="right", va="center")
    _views(figure, page, tool, robot, said)
    at = 130.0
    for line in lines(said):
        at = _write(page, 12, at, line, 8, 125)
    at -= 2
    shown = sorted(said["verdicts"], key=lambda of: (of["passed"] is not False, of["passed"] is True))
    for of in shown[:VERDICTS]:
        mark = {True: "✓", False: "✗", None: "–"}[of["passed"]]
        color = {True: INK, False: RED, None: SOFT}[of["passed"]]
        text = f"{mark} {Check(**of)}"
        at = _write(page, 12, at, text, 7.5, 132, color)
    if len(shown) > VERDICTS:
        failing = sum(of["passed"] is False for of in shown[VERDICTS:])
        at = _write(page, 12, at, f"and {len(shown) - VERDICTS} more, {failing} of which fail", 7.5, 132, SOFT)
    _table(page, at - 3, table(said))
    _write(page, 12, 13, said["how"], 6, 170, SOFT)
    return figure


def _write(page: Axes, x: float, y: float, text: str, size: float, width: int, color: str = INK) -> float:
    """Write a text of several lines; return where the next one begins."""
    wrapped = textwrap.wrap(clean(text, 600), width, subsequent_indent="   ")
    page.text(x, y, "\n".join(wrapped), fontsize=size, color=color, va="top", linespacing=1.25)
    return y - 0.47 * size * len(wrapped) - 0.4


def _table(page: Axes, at: float, rows: Sequence[tuple[Sequence[str], bool]]) -> None:
    room = min(ROWS, int((at - 20) / 3.6))
    for number, (cells, bad) in enumerate([(HEADS, False), *rows[:room]]):
        style: dict[str, Any] = {"fontsize": 7, "va": "center", "color": RED if bad else INK}
        style |= {"fontweight": "bold"} if number == 0 else {}
        for x, cell, longest in zip(_AT, cells, (3, 20, 22, 18, 6, 18, 8, 9, 9, 9, 9), strict=False):
            page.text(12 + x, at - 3.6 * number, shorten(cell, longest) if len(cell) > longest else cell, **style)
    if len(rows) > room:
        page.text(
            12, at - 3.6 * (room + 1), f"and {len(rows) - room} stronger ones", fontsize=7, color=SOFT, va="center"
        )


def _views(figure: Figure, page: Axes, tool: Tool, robot: Robot, said: Mapping[str, Any]) -> None:
    """Draw three views to one scale and a picture, in four cells."""
    held = as_held(tool, robot)
    solids = [(component.name, solid.apply_scale(1000.0)) for component, solid in held]
    numbers = {part["name"]: number for number, part in enumerate(said["parts"], start=1)}
    points = np.concatenate([solid.vertices for _, solid in solids])
    room = np.subtract(_CELL, _ROOM)
    weights = [component.mass for component, _ in held]
    center = np.average([solid.center_mass for _, solid in solids], axis=0, weights=weights)
    wanted = max(float((np.ptp(points @ axes[:2].T, axis=0) / room).max()) for _, axes in VIEWS)
    scale = next((scale for scale in SCALES if scale >= wanted), wanted)
    (left, bottom), (width, height) = _CORNER, A4_MM
    cells = [(0, 1), (1, 1), (0, 0), (1, 0)]
    for (title, axes), (column, row) in zip(VIEWS, cells, strict=False):
        x, y = left + column * (_CELL[0] + 2), bottom + row * (_CELL[1] + 2)
        ax = figure.add_axes((x / width, y / height, _CELL[0] / width, _CELL[1] / height))
        flat = points @ axes[:2].T
        low, high = flat.min(axis=0), flat.max(axis=0)
        middle = (low + high) / 2 + scale * np.array([2.0, -1.0])
        for set_limits, at, side in ((ax.set_xlim, middle[0], _CELL[0]), (ax.set_ylim, middle[1], _CELL[1])):
            set_limits(at - scale * side / 2, at + scale * side / 2)
        ax.axis("off")
        _view(ax, solids, axes, numbers)
        _dimensions(ax, low, high, scale)
        for mark, at in (("+", np.zeros(3)), ("x", center)):
            ax.plot(*(axes[:2] @ at), mark, color=RED, ms=4, mew=0.7)
        page.text(x, y + _CELL[1] - 1, title, fontsize=7, color=SOFT, va="top")
    x, y = left + _CELL[0] + 2, bottom
    ax = figure.add_axes((x / width, y / height, _CELL[0] / width, (_CELL[1] - 6) / height))
    ax.imshow(draw(painted(tool, robot), 736, 480))
    ax.axis("off")
    page.text(
        x,
        y + _CELL[1] - 1,
        f"1 : {scale:.3g}, millimetres, as held at home; + flange, × centre of gravity",
        fontsize=7,
        color=SOFT,
        va="top",
    )


def _view(ax: Axes, solids: Sequence[tuple[str, Any]], axes: Array, numbers: Mapping[str, int]) -> None:
    """Draw solids in outline, the nearest last."""
    from matplotlib.collections import LineCollection, PolyCollection

    for name, solid in sorted(solids, key=lambda of: float((of[1].vertices @ axes[2]).max())):
        seen = np.asarray(solid.vertices) @ axes.T
        front = np.asarray(solid.face_normals) @ axes[2] > 1e-6
        pairs = np.asarray(solid.face_adjacency)
        sides = front[pairs]
        drawn = sides.any(axis=1) & ((np.asarray(solid.face_adjacency_angles) > _EDGE) | ~sides.all(axis=1))
        color = COLORS[(numbers[name] - 1) % len(COLORS)]
        faces = seen[np.asarray(solid.faces)[front]][:, :, :2]
        ax.add_collection(PolyCollection(list(faces), facecolors="white", edgecolors="none"))
        ax.add_collection(PolyCollection(list(faces), facecolors=color, edgecolors="none", alpha=0.15))
        edges = seen[np.asarray(solid.face_adjacency_edges)[drawn]][:, :, :2]
        ax.add_collection(LineCollection(list(edges), colors=INK, linewidths=0.5))
    if len(solids) > NUMBERED:
        return
    apart, balloons = 0.045 * float(np.ptp(ax.get_xlim())), list[tuple[Array, list[int]]]()
    for name, solid in solids:
        at = np.asarray(solid.bounds).mean(axis=0) @ axes[:2].T
        near = next((of for other, of in balloons if np.abs(at - other).max() < apart), None)
        if near is None:
            balloons.append((at, near := []))
        near.append(numbers[name])
    frame = {"boxstyle": "round,pad=0.2", "fc": "white", "ec": INK, "lw": 0.4}
    for at, of in balloons:
        text = ", ".join(str(number) for number in sorted(of))
        ax.text(at[0], at[1], text, fontsize=5, ha="center", va="center", bbox=frame)


def _dimensions(ax: Axes, low: Array, high: Array, scale: float) -> None:
    """Draw the overall width below, the overall height on the right."""
    below, beside, away = low[1] - 5 * scale, high[0] + 5 * scale, 1.5 * scale
    arrow = {
        "arrowstyle": "<|-|>,head_width=0.12,head_length=0.25",
        "lw": 0.5,
        "color": INK,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    for start, end in (((low[0], below), (high[0], below)), ((beside, low[1]), (beside, high[1]))):
        ax.annotate("", start, end, arrowprops=arrow)
    thin: dict[str, Any] = {"color": SOFT, "lw": 0.3}
    for x in (low[0], high[0]):
        ax.plot([x, x], [low[1] - away, below - away], **thin)
    for y in (low[1], high[1]):
        ax.plot([high[0] + away, beside + away], [y, y], **thin)
    ax.text((low[0] + high[0]) / 2, below - away, f"{high[0] - low[0]:.1f}", fontsize=6.5, ha="center", va="top")
    ax.text(beside + away, (low[1] + high[1]) / 2, f"{high[1] - low[1]:.1f}", fontsize=6.5, ha="left", va="center")
