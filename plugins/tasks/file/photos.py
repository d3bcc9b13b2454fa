"""Read photographs of a person's bench that a scene file names."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

from PIL import Image, ImageOps

from core.errors import UserError
from core.interfaces import Picture
from core.scene import Camera
from core.simulation.views import describe_camera
from core.support.files import read_untrusted

MAX_BYTES = 30_000_000
MAX_PIXELS = 64_000_000
SIDE = 1280  # pixels of the longer side that is sent


def read_photograph(folder: Path, file: str, camera: Camera | None, name: str) -> Picture:
    """Read a photograph as a PNG picture whose longer side has at most `SIDE` pixels, turned as it was taken.

    Raises:
        UserError: it is not in the folder, too large, or no picture.
    """
    path = folder / file
    if not path.resolve().is_relative_to(folder.resolve()):
        raise UserError(f"pictures: {file} is not in the scene file's folder {folder}; copy it there")
    data = read_untrusted(path, MAX_BYTES)
    try:
        with warnings.catch_warnings(), Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as opened:
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # the size is checked here
            if opened.width * opened.height > MAX_PIXELS:
                raise UserError(
                    f"pictures: {path} has {opened.width} x {opened.height} pixels; at most {MAX_PIXELS:,} are read"
                )
            photograph = ImageOps.exif_transpose(opened).convert("RGB")
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise UserError(f"pictures: {path} is no PNG or JPEG picture that can be read: {error}") from error
    photograph.thumbnail((SIDE, SIDE))
    stream = io.BytesIO()
    photograph.save(stream, "PNG")
    known = describe_camera(camera, name, photograph.size) if camera else "where its camera stood is not known"
    return Picture(stream.getvalue(), name, f"{name}: a photograph of the real bench; {known}")
