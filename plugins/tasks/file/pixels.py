"""Read a photograph's pixels. This is done in a process of its own, which imports this file: so it imports little."""

from __future__ import annotations

import io
import math
import warnings

from PIL import ExifTags, Image, ImageOps, UnidentifiedImageError

from core.errors import UserError

MAX_PIXELS = 64_000_000
SIDE = 1280  # pixels of the longer side that is sent
_CAMERA = 0x8769  # EXIF: where tags of the camera are
_FOCAL_35 = 0xA405  # the focal length with the same diagonal angle on 35 mm film, mm
_UPRIGHT = (5, 6, 7, 8)  # orientations in which a photograph is turned by 90 degrees
_DIAGONAL_35 = 43.27  # of such a film, mm


def read_pixels(data: bytes) -> bytes:
    """Convert an untrusted picture: only its pixels go on, without profiles, places or texts that the file holds.

    Returns:
        A line, and a PNG picture. The line is the vertical field of view that EXIF gives, degrees in digits, or empty.
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

            fov_deg = _find_fov(opened)
            photograph = ImageOps.exif_transpose(_read_grey(opened)).convert("RGB")
    except UnidentifiedImageError as error:  # it names a stream of this program
        raise UserError("is no PNG or JPEG picture that can be read") from error
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise UserError(
            f"is no PNG or JPEG picture that can be read: {error}"
        ) from error

    photograph.thumbnail((SIDE, SIDE))
    stream = io.BytesIO()
    # Pillow would hand on what else it read of the file, such as a colour profile.
    pixels = Image.frombytes("RGB", photograph.size, photograph.tobytes())
    pixels.save(stream, "PNG")

    return f"{fov_deg}\n".encode() + stream.getvalue()


def _read_grey(picture: Image.Image) -> Image.Image:
    """Return a picture whose 16 bits of grey became 8; others as they are."""
    if not picture.mode.startswith("I"):
        return picture

    return picture.convert("I").point(lambda value: value * (1 / 256)).convert("L")


def _find_fov(picture: Image.Image) -> str:
    """Read the vertical field of view that a picture's EXIF gives; return degrees in digits, or nothing."""
    try:
        exif = picture.getexif()
        focal = float(exif.get_ifd(_CAMERA).get(_FOCAL_35, 0))
        width, height = picture.size
        if exif.get(ExifTags.Base.Orientation, 1) in _UPRIGHT:
            width, height = height, width
    except (OSError, SyntaxError, TypeError, ValueError):
        return ""

    if not 1 <= focal <= 1000:
        return ""

    half = _DIAGONAL_35 / 2 * height / math.hypot(width, height)
    return f"{math.degrees(2 * math.atan(half / focal)):.3f}"
