"""Read photographs of a person's bench that a scene file names."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

from PIL import Image

from core.interfaces import Picture
from core.scene import Camera
from core.simulation.pictures import describe_camera
from core.support.sandbox import isolated
from plugins.tasks.file.imports.solids import read_inside
from plugins.tasks.file.pixels import read_pixels

MAX_MB = 30
LIMIT_S = 60


def read_photograph(
    folder: Path, file: str, camera: Camera | None, name: str
) -> Picture:
    """Read a photograph as a PNG picture whose longer side has at most `pixels.SIDE` pixels, turned as it was taken.

    Raises:
        UserError: it is not in the folder, too large, or no picture.
    """
    return read_with_fov(folder, file, camera, name)[0]


def read_with_fov(
    folder: Path, file: str, camera: Camera | None, name: str
) -> tuple[Picture, float | None]:
    """Read a photograph (`read_photograph`), and the vertical field of view that it says it has, degrees."""
    data = read_inside(folder / file, folder, "photograph", MAX_MB)
    read = isolated(read_pixels, f"photograph {folder / file}", data, limit_s=LIMIT_S)
    digits, _, png = read.partition(b"\n")
    with Image.open(io.BytesIO(png)) as sent:  # made by this program
        known = "where its camera stood is not known"
        if camera:
            known = describe_camera(camera, sent.size)

    return write_caption(Picture(png, name), known), float(digits) if digits else None


def write_caption(picture: Picture, where: str) -> Picture:
    """Give a photograph its caption, which says where its camera stood."""
    caption = f"{picture.name}: a photograph of the real bench; {where}"
    return replace(picture, caption=caption)
