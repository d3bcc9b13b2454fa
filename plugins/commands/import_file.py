"""``vlmgineer import FILE``: say what a file is that others made, and write what uses it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from omegaconf import MISSING
from PIL import Image as Pillow
from PIL import ImageDraw

from core.config.compose import load, part, task_part
from core.errors import UsageError, UserError, choices
from core.geometry import Pose
from core.hooks import Taken
from core.imports.kinds import ARM, GRIPPER, SCENE, tell_kind
from core.interfaces import Image
from core.plugins import SIMULATOR, installed
from core.scene import Camera
from core.simulation.pictures import png
from core.simulation.projection import project
from core.support.cli import answer_help, arguments, expand, say, write_bytes
from plugins.commands.render import RenderConfig

USAGE = (
    "usage: vlmgineer import FILE [kind=arm|gripper|scene] [picture=FILE.png]; of an arm: [robot.flange=LINK ...] "
    "[at=[x,y,z]], where the flange is to be in the world, metres; of things for a scene: [output=FILE.yaml] "
    "[density=600] [without=[NAME]]"
)
KINDS = (ARM, GRIPPER, SCENE)
_AXIS_M = 0.08
_COLORS = ((220, 40, 40), (30, 150, 40), (40, 70, 230))  # x, y, z
_WIDE, _HIGH = 960, 720


@dataclass
class ImportConfig:
    """Settings of ``vlmgineer import``.

    Attributes:
        robot: the arm that is in the file, or that stands in the scene.
        kind: what the file is; empty: what it looks like.
        at: of an arm: where its flange is to be; None: where most tasks begin.
        output: of a scene: the file to write; empty: beside the file, or above it where its meshes lie elsewhere.
        density: of a scene: kg/m^3 of what moves and has no mass.
        without: of a scene: bodies and meshes that are left out.
        picture: the picture to write; empty: named after the file.
    """

    robot: dict[str, Any] = MISSING
    kind: str = ""
    at: list[float] | None = None
    output: str = ""
    density: float = 600.0
    without: list[str] = field(default_factory=list)
    picture: str = ""


def main(words: list[str]) -> None:
    """Take a file, say what it is and how to use it, and draw it.

    Raises:
        UserError: the file can't be used; says why, and the words or the command that mend it.
    """
    words = answer_help(USAGE, words)
    files = [word for word in words if "=" not in word and not word.startswith("-")]
    if len(files) != 1:
        raise UsageError(USAGE)

    file = expand(files[0]).absolute()
    settings = arguments(USAGE, [word for word in words if word != files[0]])
    asked = [word for word in settings if word.startswith("kind=")]
    kind = asked[-1].removeprefix("kind=") if asked else tell_kind(file)
    if kind not in KINDS:
        raise choices("kind", kind, KINDS)

    if kind == ARM:
        settings = ["robot=urdf", f"robot.path={file}", *settings]

    cfg = load("import", settings, ImportConfig)
    taken: Taken = installed().factory("importer", kind)(file, cfg)
    say(*taken.lines)
    if taken.words:
        output = expand(cfg.picture or f"{file.stem}.png")
        picture = draw(taken)
        write_bytes(output, png(picture))
        names = ", ".join(taken.frames)
        say(f"{output}: with the axes (x red, y green, z blue) of {names}")


def draw(taken: Taken) -> Image:
    """Draw the scene of what was taken, with the axes of its frames.

    Raises:
        UserError: it can't be drawn.
    """
    cfg = load("render", list(taken.words), RenderConfig)
    task = task_part(cfg).create()
    simulator = part(SIMULATOR, cfg.sim).create()
    try:
        picture = simulator.render(task, width=_WIDE, height=_HIGH)
    except UserError as error:
        raise UserError(f"no picture could be drawn: {error}") from error

    return draw_axes(picture, task.camera, taken.frames)


def draw_axes(picture: Image, camera: Camera, frames: dict[str, Pose] | Any) -> Image:
    """Draw the axes of frames, and their names, over a picture (H, W, 3)."""
    canvas = Pillow.fromarray(picture)
    pen = ImageDraw.Draw(canvas)
    for name, pose in frames.items():
        ends = np.vstack([np.zeros(3), _AXIS_M * np.eye(3)])
        pixels = project(camera, pose.apply(ends), canvas.width, canvas.height)
        origin, *tips = [tuple(pixel) for pixel in pixels.tolist()]
        for tip, color in zip(tips, _COLORS, strict=True):
            pen.line([origin, tip], fill=color, width=3)

        x, y = origin
        pen.text((x + 6, y + 6), name, fill=(0, 0, 0), font_size=13)

    return np.asarray(canvas)
