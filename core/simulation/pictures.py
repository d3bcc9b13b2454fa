"""Film what a candidate does, and describe cameras."""

from __future__ import annotations

import io
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw

from core.design import Candidate, Tool
from core.errors import RAISED
from core.interfaces import (
    Felt,
    Image,
    Looked,
    Recording,
    RolloutSettings,
    Simulator,
    Task,
)
from core.scene import Camera, State
from core.simulation.attempt import prepare
from core.simulation.closing import choose_closing, fly
from core.support.cli import say
from core.support.progress_display import busy
from core.support.text import clean

SIZE = 640, 480  # pixels of the scene's picture
SMALL = 160, 120  # of the pictures by which a film's end is chosen
FILM_HZ = 10
MOST = 60  # pictures of a motion
CLOSING_S = 0.8  # the camera's way to the end of a film
STAY_MS = 1500  # how long the end is shown
LABEL_S = 1.5  # how long a film says what a look saw, or how a guard ended

_WIDE = 6.5  # pixels of a letter of a label, about
_LABEL = 18  # pixels of its height


def png(picture: Image) -> bytes:
    """Encode a picture (H, W, 3) as a PNG file."""
    buffer = io.BytesIO()
    Pillow.fromarray(picture).save(buffer, "PNG")

    return buffer.getvalue()


def label(picture: Image, text: str) -> Image:
    """Return a picture (H, W, 3) with a line of text across its top, cut off where it is too long."""
    drawn = Pillow.fromarray(picture)
    wide = drawn.width
    pen = ImageDraw.Draw(drawn)
    pen.rectangle([(0, 0), (wide, _LABEL - 1)], fill=(255, 255, 255))
    short = clean(text, int(wide / _WIDE))
    pen.text((4, 2), short, fill=(30, 30, 30), font_size=12)

    return np.asarray(drawn)


def report_missing(what: str, error: BaseException) -> None:
    """Say on standard error, in one line, which picture is missing and why."""
    say(f"no {what}: {clean(str(error), 300) or type(error).__name__}", file=sys.stderr)


@dataclass(frozen=True, eq=False)
class Film:
    """A rollout that was recorded, and what draws it.

    Attributes:
        task: which was tried.
        simulator: draws it.
        tool: of the candidate.
        seed: of the layout.
        recording: of the rollout, at `FILM_HZ`.
        size: of the pictures, width and height, pixels.
        happened: how guards ended and what looks saw, in the order of time.
    """

    task: Task
    simulator: Simulator
    tool: Tool | None
    seed: int
    recording: Recording
    size: tuple[int, int] = SIZE
    happened: tuple[Felt | Looked, ...] = ()

    def draw(self, index: int, aim: Callable[[Camera], Camera] | None = None) -> Image:
        """Draw a sample of the recording; ``aim`` makes another camera of the task's.

        Raises:
            NoPicture: nothing here can draw.
        """
        state = self.recording.states[index]
        return self._see(index, aim and aim(self.task.camera), state, self.size)

    def _see(
        self, index: int, camera: Camera | None, state: State, size: tuple[int, int]
    ) -> Image:
        return self.simulator.render(
            self.task,
            camera=camera,
            seed=self.seed,
            tool=self.tool,
            arm=self.recording.arm[index],
            fingers=self.recording.fingers[index],
            state=state,
            width=size[0],
            height=size[1],
        )

    def frames(self) -> Iterator[tuple[Image, int]]:
        """Draw the motion, then fly to the goals and the bodies that they are about, and stay there.

        A long motion has fewer pictures in a second, so that there are about `MOST` at most. For `LABEL_S` they say
        what a look saw, or how a guard ended.

        Yields:
            Pictures, and for how long each is shown, ms.
        """
        count = len(self.recording.times)
        every = math.ceil(count / MOST)
        shown_ms = 1000 * every // FILM_HZ
        for number in range((count - 1) % every, count, every):
            yield self._draw_labelled(number), shown_ms

        closing = self.find_closing()
        if closing is None:
            return

        last = count - 1
        steps = max(round(CLOSING_S * FILM_HZ / every), 1)
        for step in range(1, steps + 1):
            aim = partial(fly, after=closing, share=step / steps)
            stay_ms = shown_ms if step < steps else STAY_MS
            yield self.draw(last, aim), stay_ms

    def _draw_labelled(self, number: int) -> Image:
        """Draw a sample with what happened last, if that was not long before."""
        drawn = self.draw(number)
        now = self.recording.times[number]
        last = None
        for event in self.happened:
            if 0 <= now - event.at_s < LABEL_S:
                last = event

        return drawn if last is None else label(drawn, str(last))

    def find_closing(self) -> Camera | None:
        """Find the camera of the film's end (`core.simulation.closing.choose_closing`)."""
        last = len(self.recording.times) - 1
        scene = self.task.scene(self.seed).furnished(self.tool)
        end = self.recording.states[last]

        def draw(camera: Camera, state: State) -> Image:
            return self._see(last, camera, state, SMALL)

        return choose_closing(self.task, scene, end, draw)


def save_film(film: Film, file: Path) -> None:
    """Write an animated GIF in real time, which ends close to the goal."""
    pictures = []
    shown_ms = []
    for drawn, milliseconds in film.frames():
        picture = Pillow.fromarray(drawn)
        pictures.append(picture.quantize(96, dither=Pillow.Dither.NONE))
        shown_ms.append(milliseconds)

    first, *others = pictures
    first.save(
        file,
        save_all=True,
        append_images=others,
        duration=shown_ms,
        loop=0,
        optimize=True,
    )


def filmed(
    task: Task,
    simulator: Simulator,
    candidate: Candidate,
    seed: int,
    settings: RolloutSettings,
    size: tuple[int, int] = SIZE,
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

    events: list[Felt | Looked] = [*outcome.felt, *outcome.looked]
    happened = tuple(sorted(events, key=lambda event: event.at_s))

    return Film(task, simulator, candidate.tool, seed, recording, size, happened)


def write_film(
    task: Task,
    simulator: Simulator,
    candidate: Candidate,
    seed: int,
    settings: RolloutSettings,
    file: Path,
) -> Film | None:
    """Write the film of a candidate; None: it can't be filmed, which costs the film alone: standard error says why."""
    try:
        with busy(f"drawing the film {file.name}"):
            file.parent.mkdir(parents=True, exist_ok=True)
            film = filmed(task, simulator, candidate, seed, settings)
            save_film(film, file)
    except RAISED as error:
        report_missing("film", error)
        return None

    return film


def describe_camera(camera: Camera, size: tuple[int, int]) -> str:
    """Say where a camera stands and where it looks: what one needs to measure in its picture (width, height)."""
    place = ", ".join(f"{x:.3f}" for x in camera.position)
    target = ", ".join(f"{x:.3f}" for x in camera.target)
    focal = size[1] / 2 / np.tan(np.radians(camera.fov_deg) / 2)

    return (
        f"perspective, camera at ({place}), its axis through ({target}) in the middle of the picture, not rolled, "
        f"{size[0]} x {size[1]} pixels, focal length {focal:.1f} pixels"
    )
