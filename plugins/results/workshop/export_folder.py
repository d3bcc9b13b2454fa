"""Write an export to a folder: the motion as samples and programs, the scene, the checklist, the design."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from omegaconf import OmegaConf

from core.errors import UsageError, UserError
from core.interfaces import ToolRepresentation
from core.support.cli import write_bytes
from plugins.results.artifacts import save_design, save_files
from plugins.results.workshop.carrying import SETTINGS
from plugins.results.workshop.export import Export
from plugins.results.workshop.motion import to_csv
from plugins.results.workshop.ros import write_scene, write_trajectory
from plugins.results.workshop.sheet import write_sheet
from plugins.results.workshop.texts import (
    filled,
    to_numbers,
    write_plan_programs,
    write_programs,
)
from plugins.results.workshop.tool import PrintedTool
from plugins.results.workshop.ways import SLOW

LINES = 8
"""The nearest things, in the checklist."""


def new_folder(folder: Path) -> Path:
    """Make a folder to write to.

    Raises:
        UserError: it has something in it, or can't be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        written = any(folder.iterdir())
    except OSError as error:
        raise UserError(f"can't write {folder}: {error}") from error

    if written:
        raise UsageError(
            f"{folder} has files in it already; choose another output=, or remove it"
        )

    return folder


def write_export(
    export: Export,
    written: PrintedTool,
    representation: ToolRepresentation,
    folder: Path,
    held: Sequence[str] = (),
) -> Export:
    """Write the files of a task.

    Args:
        export: the motion, and what it earned.
        written: the tool, whose parts are written already.
        representation: how the design is written.
        folder: where to.
        held: in how many layouts the design holds, in words.

    Returns:
        The export with the verdicts on motion and tool.

    Raises:
        UserError: a file can't be written.
    """
    robot = export.robot
    verdicts = export.checks
    if written.parts:
        checked = replace(written, checks=(*export.checks, *written.checks))
        verdicts = write_sheet(checked, export.task, export.strengths, folder, held)

    export = replace(export, verdicts=verdicts, printed=written)

    if export.dry_run is not None:
        _write_plan(export, representation, folder / "plan")

    for name, move in export.moves.items():
        table = to_csv(move, robot)
        write_bytes(folder / "motion" / f"{name}.csv", table.encode())

    text = json.dumps(export.figures(), indent=2)
    write_bytes(folder / "figures.json", f"{text}\n".encode())
    write_bytes(folder / "CHECKLIST.md", checklist(export).encode())
    write_scene(robot, export.scene, folder / "ros2")
    if export.dry_run is None:
        write_trajectory(robot, export.motion, folder / "ros2")
        write_programs(robot, export.payload, export.moves, folder / "programs")

    save_design(export.candidate, representation, folder / "design")
    save_files(written.tool, robot, export.planned, folder / "design")

    return export


def _write_plan(
    export: Export, representation: ToolRepresentation, folder: Path
) -> None:
    """Write a plan that feels or looks, and what carries it out.

    Raises:
        UserError: a file can't be written.
    """
    text = OmegaConf.to_yaml(OmegaConf.create(dict(export.settings)))
    write_bytes(folder / SETTINGS, text.encode())
    save_design(export.candidate, representation, folder)
    bodies = [
        (body.name, to_numbers(body.pose), not body.fixed)
        for body in export.scene.bodies
    ]
    write_plan_programs(export.robot, export.payload, bodies, folder)


def checklist(export: Export) -> str:
    """Write what to do at the arm, in order, with the figures of this motion."""
    first = np.round(export.motion.positions[0], 3) + 0.0  # no -0.0
    return filled(
        "checklist.md.j2",
        export=export,
        first=first.tolist(),
        nearest=export.nearest[:LINES],
        slow=SLOW,
    )
