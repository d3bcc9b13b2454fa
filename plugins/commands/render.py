"""``vlmgineer render task=NAME [designs=FILE] [output=FILE.png]``: draw a task's scene, with or without a tool."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omegaconf import MISSING, DictConfig

from core.config.compose import check_seed, load, part, task_part, tool_part
from core.config.schemas import SceneConfig
from core.designs.reading import load_tool
from core.errors import UsageError
from core.interfaces import Image
from core.plugins import SIMULATOR
from core.search.builder import warn_of_scene
from core.simulation.pictures import png
from core.support.cli import arguments, say, write_bytes

MAX_PIXELS = 4096
USAGE = "usage: vlmgineer render task=NAME [designs=FILE strategy=N] [seed=N] [width=W height=H] [output=FILE.png]"


@dataclass
class RenderConfig(SceneConfig):
    """Settings of ``vlmgineer render``, beside those of the scene.

    Attributes:
        tool: how the design's tool is written.
        designs: a file, of which a tool is mounted; None: none is.
        strategy: the number of that tool, from 0.
        output: the picture to write.
        width: pixels.
        height: pixels.
    """

    tool: dict[str, Any] = MISSING
    designs: str | None = None
    strategy: int = 0
    output: str = "scene.png"
    width: int = 640
    height: int = 480


def render(cfg: DictConfig) -> tuple[Image, str]:
    """Draw the picture.

    Returns:
        The picture (H, W, 3), and the renderer's name if there was a choice.

    Raises:
        UserError: a part, a setting or the design is wrong.
    """
    check_seed(cfg.seed)

    for name in ("width", "height"):
        pixels = cfg[name]
        if not 1 <= pixels <= MAX_PIXELS:
            raise UsageError(f"{name} must be between 1 and {MAX_PIXELS}, got {pixels}")

    task = task_part(cfg).create()
    warn_of_scene(task)
    simulator = part(SIMULATOR, cfg.sim).create()
    tool = None
    if cfg.designs is not None:
        representation = tool_part(cfg).create()
        tool = load_tool(Path(cfg.designs), cfg.strategy, representation, task)

    picture: Image = simulator.render(
        task, seed=cfg.seed, tool=tool, width=cfg.width, height=cfg.height
    )

    return picture, simulator.drawn_by


def main(words: list[str]) -> None:
    """Draw a picture and write it; say which renderer drew it, where there is a choice.

    Raises:
        UserError: see `render`; or the file can't be written.
    """
    cfg = load("render", arguments(USAGE, words), RenderConfig)
    picture, drawn_by = render(cfg)
    write_bytes(Path(cfg.output), png(picture))
    say(cfg.output)
    if drawn_by:
        say(f"drawn by {drawn_by}")
