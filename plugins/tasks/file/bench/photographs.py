"""Read the photographs that a user names, as pixels only, with what is known of their cameras."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image
from pydantic import TypeAdapter, ValidationError

from core.errors import UsageError, UserError
from core.interfaces import Picture
from core.support.cli import expand
from plugins.tasks.file.bench.views import View
from plugins.tasks.file.photos import read_photograph
from plugins.tasks.file.spec import CameraSpec

_DULL = 3.0  # standard deviation of grey: nothing can be made out
_CAMERAS = TypeAdapter[Any](list[CameraSpec])


@dataclass(frozen=True)
class Photograph:
    """A photograph as it is sent: its picture, width and height, and its view if that is known."""

    picture: Picture
    size: tuple[int, int]
    view: View | None = None


def read_photographs(files: Sequence[str], cameras: Any) -> list[Photograph]:
    """Read photographs, of which the first have these cameras.

    Raises:
        UserError: one can't be read, or shows nothing; or a camera is none.
    """
    try:
        known = _CAMERAS.validate_json(json.dumps(cameras))
    except ValidationError as error:
        raise UsageError(
            "a camera needs position, target and fov_deg, such as cameras=[{position: [1.4, -0.9, 0.8], target: [0.6, "
            "0, 0.1], fov_deg: 52}]"
        ) from error

    found = []
    known += [None] * len(files)
    for number, (name, camera) in enumerate(zip(files, known, strict=False), 1):
        file = expand(name)
        picture = read_photograph(file.parent, file.name, camera, f"photo{number}")
        with Image.open(io.BytesIO(picture.png)) as sent:  # made by this program
            grey = np.asarray(sent.convert("L"))
            size = sent.size
        if grey.std() < _DULL:
            raise UserError(
                f"{file} shows nothing: all of it has one colour; take the picture again, with the bench in it"
            )
        view = camera and View(camera, size)
        found.append(Photograph(picture, size, view))
    return found
