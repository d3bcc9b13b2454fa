"""Read photographs of a person's bench that a scene file names."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

from PIL import Image, ImageOps

from core.errors import UserError
from core.interfaces import Picture
from core.scene import Camera
from core.simulation.pictures import describe_camera
from core.support.sandbox import isolated
from plugins.tasks.file.imports.solids import read_inside

MAX_MB = 30
MAX_PIXELS = 64_000_000
SIDE = 1280  # pixels of the longer side that is sent
LIMIT_S = 60


def read_photograph(
    folder: Path, file: str, camera: Camera | None, name: str
) -> Picture:
    """Read a photograph as a PNG picture whose longer side has at most `SIDE` pixels, turned as it was taken.

    Raises:
        UserError: it is not in the folder, too large, or no picture.
    """
    data = read_inside(folder / file, folder, "photograph", MAX_MB)
    png = isolated(as_png, f"photograph {folder / file}", data, limit_s=LIMIT_S)
    with Image.open(io.BytesIO(png)) as sent:  # made by this program
        known = "where its camera stood is not known"
        if camera:
            known = describe_camera(camera, sent.size)
    return Picture(png, name, f"{name}: a photograph of the real bench; {known}")


def as_png(data: bytes) -> bytes:
    """Convert an untrusted picture: only its pixels go on, without profiles, places or texts that the file holds.

    Raises:
        UserError: it is too large, or no picture.
    """
    try:
        with (
            warnings.catch_warnings(),
            Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as opened,
        ):
            # The size is checked here.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            if opened.width * opened.height > MAX_PIXELS:
                raise UserError(
                    f"has {opened.width} x {opened.height} pixels; at most {MAX_PIXELS:,} are read"
                )

            photograph = ImageOps.exif_transpose(opened).convert("RGB")
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise UserError(
            f"is no PNG or JPEG picture that can be read: {error}"
        ) from error

    photograph.thumbnail((SIDE, SIDE))
    stream = io.BytesIO()
    # Pillow would hand on what else it read of the file, such as a colour profile.
    pixels = Image.frombytes("RGB", photograph.size, photograph.tobytes())
    pixels.save(stream, "PNG")

    return stream.getvalue()
