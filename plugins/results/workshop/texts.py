"""Fill the texts that an export writes: Markdown, in which others' names are no markup, and programs for controllers.

A robot's template of a program gets ``robot``, ``payload``, ``moves`` (by name, each a `Sampled`), and the function
``every(move, seconds)``.
"""

from __future__ import annotations

import importlib.resources
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from core.errors import UserError
from core.geometry import Pose
from core.support.cli import write_bytes
from core.support.templates import build_environment
from core.support.text import clean
from core.values.robots import Robot
from plugins.results.workshop.motion import Sampled

# Besides marks: `_` at the end of a word, and what GitHub makes a link of.
_MARKUP = re.compile(
    r"[\\`*{}\[\]<>#+!|~&@]|(?<![^\W_])_|_(?![^\W_])|:(?=//)|(?<=www)\.", re.IGNORECASE
)


def text_of(name: str) -> str:
    """Return a text as it is."""
    folder = importlib.resources.files(__package__) / "templates"
    return (folder / name).read_text(encoding="utf-8")


def plain(value: Any) -> Any:
    """Escape what Markdown and HTML read as markup in a text of others, and make it one line."""
    if not isinstance(value, str):
        return value
    return _MARKUP.sub(r"\\\g<0>", clean(value, 600))


def filled(name: str, **values: Any) -> str:
    """Render a template of a Markdown text."""
    environment = build_environment(finalize=plain, keep_trailing_newline=True)
    return environment.from_string(text_of(name)).render(**values)


def write_programs(
    robot: Robot, payload: Mapping[str, Any], moves: Mapping[str, Sampled], folder: Path
) -> None:
    """Render the templates of `Robot.programs` to files in a folder.

    Args:
        robot: whose templates they are.
        payload: mass, centre and inertia of the tool (`plugins.results.workshop.clearance.payload`).
        moves: the motions, by name.
        folder: where to.

    Raises:
        UserError: a template can't be rendered, or a file can't be written.
    """
    values = {"payload": payload, "moves": moves, "every": every}
    _write_all(robot, robot.programs, values, folder)


def write_plan_programs(
    robot: Robot,
    payload: Mapping[str, Any],
    bodies: Sequence[tuple[str, list[float], bool]],
    folder: Path,
) -> None:
    """Write what carries a plan out that feels or looks: a program, drivers, and a function to fill in.

    Args:
        robot: brings drivers (`Robot.drivers`).
        payload: mass, centre and inertia of the tool.
        bodies: of the scene: their names, poses, and whether they move.
        folder: where to.

    Raises:
        UserError: a template can't be rendered, or a file can't be written.
    """
    drivers = {**dict(robot.drivers), "ros2": text_of("drive_ros2.py.j2")}
    files = [(f"drive_{name}.py", driver) for name, driver in drivers.items()]
    program = ("run_plan.py", text_of("run_plan.py.j2"))
    function = ("perceive.py", text_of("perceive.py.j2"))
    values = {
        "payload": payload,
        "turn": robot.base.rotation.as_matrix().round(9).tolist(),
        "base": to_numbers(robot.base),
        "bodies": bodies,
        "drivers": list(drivers),
    }
    _write_all(robot, (program, function, *files), values, folder)


def to_numbers(pose: Pose) -> list[float]:
    """Write a pose as x, y, z, metres, and the quaternion w, x, y, z."""
    numbers = np.round([*pose.position, *pose.quaternion], 6) + 0.0
    return list(numbers.tolist())


def _write_all(
    robot: Robot,
    programs: Sequence[tuple[str, str]],
    values: Mapping[str, Any],
    folder: Path,
) -> None:
    """Render templates to files.

    Args:
        robot: whose programs they are.
        programs: pairs of file name and template.
        values: that templates get beside the robot.
        folder: where to.

    Raises:
        UserError: a template can't be rendered, or a file can't be written.
    """
    environment = build_environment()
    for name, template in programs:
        try:
            text = environment.from_string(template).render(robot=robot, **values)
        except jinja2.TemplateError as error:
            raise UserError(
                f"robot {robot.name}: its program {name} can't be written: {error}"
            ) from error

        write_bytes(folder / name, (text + "\n").encode())


def every(move: Sampled, seconds: float) -> list[tuple[float, list[float]]]:
    """Return time and joints of the samples nearest to multiples of ``seconds``, and of the last."""
    rows = []
    for sample in move.every(seconds):
        joints = np.round(move.positions[sample], 6).tolist()
        rows.append((float(move.times[sample]), joints))

    return rows
