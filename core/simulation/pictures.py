"""Draw what a candidate does: PNG files, four stages in one picture, and films."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
from PIL import Image as Pillow

from core.design import Candidate
from core.interfaces import Image, Recording, RolloutSettings, Simulator, Task
from core.simulation.rollout import prepare
from core.text import clean

FILM_HZ = 10


def save_picture(picture: Image, file: Path) -> None:
    """Write a picture (H, W, 3) as PNG."""
    Pillow.fromarray(picture).save(file)


def png(picture: Image) -> bytes:
    """Encode a picture (H, W, 3) as a PNG file."""
    buffer = io.BytesIO()
    Pillow.fromarray(picture).save(buffer, "PNG")
    return buffer.getvalue()


def report_missing(what: str, error: Exception) -> None:
    """Say on standard error, in one line, which picture is missing and why."""
    sys.stderr.write(f"no {what}: {clean(str(error), 300) or type(error).__name__}\n")


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
    recording = _recorded(task, simulator, candidate, seed, settings, FILM_HZ)
    frames = []
    for index in range(len(recording.times)):
        picture = _frame(task, simulator, candidate, seed, recording, index, size)
        frames.append(Pillow.fromarray(picture).quantize(96, dither=Pillow.Dither.NONE))
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=1000 // FILM_HZ, loop=0, optimize=True)


def draw_stages(
    task: Task,
    simulator: Simulator,
    candidate: Candidate,
    seed: int,
    settings: RolloutSettings,
    size: tuple[int, int] = (640, 480),
) -> Image:
    """Play a candidate again and draw four instants in one picture of ``size``: top row first, left to right.

    They are a third of the time apart, from the start of the motion to the end of the rollout.

    Raises:
        ValueError: the rollout fails.
        NoPicture: nothing here can draw.
    """
    recording = _recorded(task, simulator, candidate, seed, settings, FILM_HZ)
    width, height = size[0] // 2, size[1] // 2
    stages = np.zeros((2 * height, 2 * width, 3), dtype=np.uint8)
    for number, time in enumerate(np.linspace(0.0, recording.times[-1], 4)):
        index = int(np.abs(recording.times - time).argmin())
        row, column = divmod(number, 2)
        picture = _frame(task, simulator, candidate, seed, recording, index, (width, height))
        stages[row * height : (row + 1) * height, column * width : (column + 1) * width] = picture
    return stages


def _recorded(
    task: Task, simulator: Simulator, candidate: Candidate, seed: int, settings: RolloutSettings, hz: float
) -> Recording:
    _, job = prepare(task, candidate, seed, settings, record_hz=hz)
    outcome = simulator.rollout(task, [job])[0]
    if outcome.recording is None:
        raise ValueError(f"candidate {candidate.id} can't be filmed: {outcome.error}")
    return outcome.recording


def _frame(
    task: Task,
    simulator: Simulator,
    candidate: Candidate,
    seed: int,
    recording: Recording,
    index: int,
    size: tuple[int, int],
) -> Image:
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
