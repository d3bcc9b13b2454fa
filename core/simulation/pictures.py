"""Draw what a candidate does: PNG files, four stages in one picture, and films."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image as Pillow

from core.cli import say
from core.design import Candidate
from core.geometry import Array
from core.interfaces import Image, RolloutSettings, Simulator, Task
from core.simulation.rollout import prepare
from core.text import clean

FILM_HZ = 10


def png(picture: Image) -> bytes:
    """Encode a picture (H, W, 3) as a PNG file."""
    buffer = io.BytesIO()
    Pillow.fromarray(picture).save(buffer, "PNG")
    return buffer.getvalue()


def report_missing(what: str, error: Exception) -> None:
    """Say on standard error, in one line, which picture is missing and why."""
    say(f"no {what}: {clean(str(error), 300) or type(error).__name__}", file=sys.stderr)


def save_film(
    task: Task,
    simulator: Simulator,
    candidate: Candidate,
    seed: int,
    settings: RolloutSettings,
    file: Path,
    size: tuple[int, int] = (400, 300),
) -> None:
    """Play a candidate again and write an animated GIF in real time; ``size`` is width and height, pixels.

    Raises:
        ValueError: the rollout fails.
        NoPicture: nothing here can draw.
    """
    times, draw = _filmed(task, simulator, candidate, seed, settings, size)
    pictures = (Pillow.fromarray(draw(index)) for index in range(len(times)))
    first, *others = (picture.quantize(96, dither=Pillow.Dither.NONE) for picture in pictures)
    first.save(file, save_all=True, append_images=others, duration=1000 // FILM_HZ, loop=0, optimize=True)


def draw_stages(task: Task, simulator: Simulator, candidate: Candidate, seed: int, settings: RolloutSettings) -> Image:
    """Play a candidate again and draw four instants in one picture (480, 640, 3): top row first, left to right.

    They are a third of the time apart, from the start of the motion to the end of the rollout.

    Raises:
        ValueError: the rollout fails.
        NoPicture: nothing here can draw.
    """
    times, draw = _filmed(task, simulator, candidate, seed, settings, (320, 240))
    top_left, top_right, left, right = (
        draw(int(np.abs(times - instant).argmin())) for instant in np.linspace(0.0, times[-1], 4)
    )
    return np.vstack([np.hstack([top_left, top_right]), np.hstack([left, right])])


def _filmed(
    task: Task, simulator: Simulator, candidate: Candidate, seed: int, settings: RolloutSettings, size: tuple[int, int]
) -> tuple[Array, Callable[[int], Image]]:
    """Play a candidate: the times (T,) of a recording, and a function that draws one of its samples."""
    _, job = prepare(task, candidate, seed, settings, record_hz=FILM_HZ)
    outcome = simulator.rollout(task, [job])[0]
    if (recording := outcome.recording) is None:
        raise ValueError(f"candidate {candidate.id} can't be filmed: {outcome.error}")

    def draw(index: int) -> Image:
        return simulator.render(
            task,
            seed=seed,
            tool=candidate.tool,
            arm=recording.arm[index],
            fingers=recording.fingers[index],
            state=recording.states[index],
            width=size[0],
            height=size[1],
        )

    return recording.times, draw
