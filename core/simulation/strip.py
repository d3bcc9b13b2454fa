"""Draw a film strip of a rollout: the six instants at which something happens."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw

from core.design import Candidate
from core.interfaces import (
    Image,
    Observation,
    Recording,
    RolloutSettings,
    Simulator,
    Task,
)
from core.simulation.pictures import filmed
from core.support.text import clean

FRAMES, APART_S = 6, 0.15  # of a strip
STIRRED_M, LIFTED_M = 0.003, 0.02


def draw_strip(
    task: Task,
    simulator: Simulator,
    candidate: Candidate,
    seed: int,
    settings: RolloutSettings,
    seen: Observation | None = None,
) -> Image:
    """Play a candidate again and draw six instants in one picture (480, 960, 3): top row first, left to right.

    They are those at which something happens, from the start of the motion to the end of the rollout (`moments`); each
    has its time and what happens. ``seen``: what was observed of the rollout, if it was.

    Raises:
        ValueError: the rollout fails.
        NoPicture: nothing here can draw.
    """
    recording, draw = filmed(task, simulator, candidate, seed, settings, (320, 240))
    frames = []
    for instant, what in moments(recording, seen):
        frame = Pillow.fromarray(draw(int(np.abs(recording.times - instant).argmin())))
        pen = ImageDraw.Draw(frame)
        pen.rectangle([(0, 0), (320, 17)], fill=(255, 255, 255))
        pen.text(
            (4, 2),
            clean(f"{instant:.1f} s{what and f': {what}'}", 60),
            fill=(30, 30, 30),
            font_size=12,
        )
        frames.append(np.asarray(frame))
    return np.vstack([np.hstack(frames[:3]), np.hstack(frames[3:])])


def moments(
    recording: Recording, seen: Observation | None = None
) -> list[tuple[float, str]]:
    """Choose `FRAMES` instants of a recording to show, seconds, each with what happens then, in the order of time.

    The first are the start and the end, then what ``seen`` names: the first touches, and when it went wrong; else the
    first motion of a body. Then come the highest points of bodies that are lifted, and the fastest motions. Instants
    less than `APART_S` apart count as one. At last, the longest gaps are halved.
    """
    times, states = recording.times, recording.states
    end = float(times[-1])
    happened = [(0.0, "start"), (end, "end")]
    if seen is not None:
        touches: dict[str, tuple[float, str]] = {}  # the first of each body
        for c in sorted(
            (c for c in seen.contacts if c.kind != "body"),
            key=lambda contact: contact.first_s,
        ):
            touches.setdefault(c.other, (c.first_s, f"{c.one} touches {c.other}"))
        first, *others = touches.values() or [(0.0, "")]
        happened.append(first)
        happened += (
            [(seen.at_s, f"{seen.result}: {seen.what}" if seen.what else seen.result)]
            if seen.at_s
            else []
        )
        happened += others
    moving = times >= 0
    if moving.any() and len(states.names):
        shifts = (
            np.linalg.norm(states.positions - states.positions[moving][0], axis=-1)
            * moving[:, None]
        )
        for name, shift in sorted(
            zip(states.names, shifts.T, strict=True), key=lambda item: -item[1].max()
        )[:2]:
            height = (
                states.position(name)[:, 2] - states.position(name)[moving][0, 2]
            ) * moving
            speed = np.abs(np.gradient(shift, times))
            if shift.max() > STIRRED_M:
                happened.append(
                    (float(times[np.argmax(shift > STIRRED_M)]), f"{name} moves")
                )
                happened += (
                    [(float(times[height.argmax()]), f"{name} is highest")]
                    if height.max() > LIFTED_M
                    else []
                )
                happened.append((float(times[speed.argmax()]), f"{name} is fastest"))
    chosen: list[tuple[float, str]] = []
    for instant, what in happened:
        if len(chosen) < FRAMES and all(
            abs(instant - other) >= APART_S for other, _ in chosen
        ):
            chosen.append((instant, what))
    while len(chosen) < FRAMES:
        chosen.sort()
        before, after = max(
            pairwise(chosen),
            key=lambda pair: pair[1][0] - pair[0][0],
            default=(chosen[0], chosen[-1]),
        )
        chosen.append(((before[0] + after[0]) / 2, ""))
    return sorted(chosen)
