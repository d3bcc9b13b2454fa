"""Film what a candidate does; describe cameras, and measure what they see."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image as Pillow

from core.design import Candidate
from core.geometry import Array
from core.interfaces import Image, Recording, RolloutSettings, Simulator, Task
from core.scene import Body, Camera
from core.simulation.attempt import prepare
from core.support.cli import say
from core.support.text import clean

SIZE = 640, 480  # pixels of the scene's picture
FILM_HZ = 10
_CLEAR = (
    0.9  # opacity; a depth camera does not measure what has less: glass has no depth
)


def png(picture: Image) -> bytes:
    """Encode a picture (H, W, 3) as a PNG file."""
    buffer = io.BytesIO()
    Pillow.fromarray(picture).save(buffer, "PNG")
    return buffer.getvalue()


def report_missing(what: str, error: BaseException) -> None:
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
    recording, draw = filmed(task, simulator, candidate, seed, settings, size)
    pictures = (Pillow.fromarray(draw(index)) for index in range(len(recording.times)))
    first, *others = (
        picture.quantize(96, dither=Pillow.Dither.NONE) for picture in pictures
    )
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
    size: tuple[int, int],
) -> tuple[Recording, Callable[[int], Image]]:
    """Play a candidate: a recording, and a function that draws one of its samples."""
    _, job = prepare(task, candidate, seed, settings, record_hz=FILM_HZ)
    outcome = simulator.rollout(task, [job])[0]
    if (recording := outcome.recording) is None:
        raise ValueError(f"candidate {candidate.id} can't be filmed: {outcome.error}")

    def draw(index: int) -> Image:
        arm, fingers, state = (
            recording.arm[index],
            recording.fingers[index],
            recording.states[index],
        )
        show = partial(
            simulator.render,
            task,
            seed=seed,
            tool=candidate.tool,
            width=size[0],
            height=size[1],
        )
        return show(arm=arm, fingers=fingers, state=state)

    return recording, draw


def describe_camera(camera: Camera, size: tuple[int, int]) -> str:
    """Say where a camera stands and where it looks: what one needs to measure in its picture (width, height)."""
    at, to = (
        ", ".join(f"{x:.3f}" for x in point)
        for point in (camera.position, camera.target)
    )
    focal = size[1] / 2 / np.tan(np.radians(camera.fov_deg) / 2)
    return (
        f"perspective, camera at ({at}), its axis through ({to}) in the middle of the picture, not rolled, "
        f"{size[0]} x {size[1]} pixels, focal length {focal:.1f} pixels"
    )


def nearness(bodies: Iterable[Body], camera: Camera, wide: int, high: int) -> Array:
    """Compute how far bodies reach toward a parallel camera in each pixel (high, wide), metres from the origin.

    From above that is the height. Where nothing is, it is nan; what is clear, as glass, is left out.
    """
    found = np.full((high, wide), -np.inf)
    for body in bodies:
        for part in body.visuals:
            if part.color[3] <= _CLEAR:
                continue
            mesh = part.shape.to_trimesh()
            pose, faces = body.pose @ part.pose, np.asarray(mesh.faces)
            points = pose.apply(np.asarray(mesh.vertices, dtype=np.float64))
            pixels, toward = (
                camera.project(points, wide, high) - 0.5,
                -points @ camera.axes[2],
            )
            if mesh.is_volume:  # what faces away is hidden by the rest
                faces = faces[
                    np.asarray(mesh.face_normals)
                    @ pose.rotation.inv().apply(camera.axes[2])
                    < 0
                ]
            for corners in faces:
                _raise(found, pixels[corners], toward[corners])
    return np.where(np.isfinite(found), found, np.nan)


def _raise(found: Array, corners: Array, z: Array) -> None:
    """Raise ``found`` (H, W) to a triangle of corners (3, 2) in pixels, with the values ``z`` (3,)."""
    (x0, y0), (x1, y1) = np.ceil(corners.min(axis=0)), np.floor(corners.max(axis=0))
    columns = np.arange(max(int(x0), 0), min(int(x1), found.shape[1] - 1) + 1)
    rows = np.arange(max(int(y0), 0), min(int(y1), found.shape[0] - 1) + 1)
    edges = np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1)
    if not len(columns) or not len(rows) or abs(np.linalg.det(edges)) < 1e-9:
        return
    away = np.stack(np.meshgrid(columns, rows), axis=-1) - corners[0]
    shares = away @ np.linalg.inv(edges).T
    inside = (shares >= -1e-9).all(axis=-1) & (shares.sum(axis=-1) <= 1 + 1e-9)
    part = found[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    np.maximum(
        part, np.where(inside, z[0] + shares @ (z[1:] - z[0]), -np.inf), out=part
    )
