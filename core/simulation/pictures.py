"""Film what a candidate does, and describe cameras."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image as Pillow

from core.design import Candidate
from core.interfaces import Image, Recording, RolloutSettings, Simulator, Task
from core.scene import Camera
from core.simulation.attempt import prepare
from core.support.cli import say
from core.support.text import clean

SIZE = 640, 480  # pixels of the scene's picture
FILM_HZ = 10

Film = tuple[Recording, Callable[..., Image]]
"""What was played, and a function that draws one of its samples; ``aim`` makes another camera of the task's."""


def png(picture: Image) -> bytes:
    """Encode a picture (H, W, 3) as a PNG file."""
    buffer = io.BytesIO()
    Pillow.fromarray(picture).save(buffer, "PNG")

    return buffer.getvalue()


def report_missing(what: str, error: BaseException) -> None:
    """Say on standard error, in one line, which picture is missing and why."""
    say(f"no {what}: {clean(str(error), 300) or type(error).__name__}", file=sys.stderr)


def save_film(film: Film, file: Path) -> None:
    """Write an animated GIF in real time."""
    recording, draw = film
    frames = []

    for number in range(len(recording.times)):
        picture = Pillow.fromarray(draw(number))
        frames.append(picture.quantize(96, dither=Pillow.Dither.NONE))

    first, *others = frames
    first.save(
        file,
        save_all=True,
        append_images=others,
        duration=1000 // FILM_HZ,
        loop=0,
        optimize=True,
    )


def filmed(
    task: Task,
    simulator: Simulator,
    candidate: Candidate,
    seed: int,
    settings: RolloutSettings,
    size: tuple[int, int] = (400, 300),
) -> Film:
    """Play a candidate again; ``size`` is the pictures' width and height, pixels.

    Raises:
        ValueError: the rollout fails.
        NoPicture: nothing here can draw.
    """
    _, job = prepare(task, candidate, seed, settings, record_hz=FILM_HZ)
    (outcome,) = simulator.rollout(task, [job])
    recording = outcome.recording

    if recording is None:
        raise ValueError(f"candidate {candidate.id} can't be filmed: {outcome.error}")

    def draw(index: int, aim: Callable[[Camera], Camera] | None = None) -> Image:
        return simulator.render(
            task,
            camera=aim and aim(task.camera),
            seed=seed,
            tool=candidate.tool,
            arm=recording.arm[index],
            fingers=recording.fingers[index],
            state=recording.states[index],
            width=size[0],
            height=size[1],
        )

    return recording, draw


def describe_camera(camera: Camera, size: tuple[int, int]) -> str:
    """Say where a camera stands and where it looks: what one needs to measure in its picture (width, height)."""
    place = ", ".join(f"{x:.3f}" for x in camera.position)
    target = ", ".join(f"{x:.3f}" for x in camera.target)
    focal = size[1] / 2 / np.tan(np.radians(camera.fov_deg) / 2)

    return (
        f"perspective, camera at ({place}), its axis through ({target}) in the middle of the picture, not rolled, "
        f"{size[0]} x {size[1]} pixels, focal length {focal:.1f} pixels"
    )
