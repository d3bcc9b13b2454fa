"""Read a photograph's pixels. This is done in a process of its own, which imports this file: so it imports little."""

from __future__ import annotations

import io
import warnings

from PIL import Image, ImageOps

from core.errors import UserError

MAX_PIXELS = 64_000_000
SIDE = 1280  # pixels of the longer side that is sent


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
