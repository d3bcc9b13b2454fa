"""Read the photographs that a user names, as pixels only, with what is known of their cameras."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from PIL import Image
from pydantic import TypeAdapter, ValidationError

from core.errors import UsageError, UserError
from core.interfaces import Picture
from core.simulation.pictures import describe_camera
from core.support.cli import expand
from plugins.tasks.file.bench.views import CameraError, Landmarks, View, find_view
from plugins.tasks.file.photos import read_with_fov, write_caption
from plugins.tasks.file.spec import CameraSpec

FOUND_M = 0.3  # of a camera that known places fix, one standard deviation
FOUND_DEG = 20.0
FOV_DEG = 53.0  # of most phones, held across
FOV_ERROR_DEG = 4.0
_DULL = 3.0  # standard deviation of grey: nothing can be made out
_CAMERAS = TypeAdapter[Any](list[CameraSpec])


@dataclass(frozen=True)
class Photograph:
    """A photograph as it is sent.

    Attributes:
        picture: of it.
        size: its width and height, pixels.
        view: where its camera stood, as measured or as found by landmarks; None: not known.
        error: of what was measured.
        landmarks: known places in it.
        found: whether its camera was found by them.
        fov_deg: its vertical field of view, as its EXIF says; None: it doesn't.
    """

    picture: Picture
    size: tuple[int, int]
    view: View | None = None
    error: CameraError = field(default_factory=CameraError)
    landmarks: Landmarks | None = None
    found: bool = False
    fov_deg: float | None = None

    def find(self, landmarks: Landmarks, fov_deg: float | None) -> Photograph:
        """Find the camera by known places, with a vertical field of view, degrees; None: EXIF's, or a phone's.

        Raises:
            UserError: OpenCV is not installed, or no camera sees them so.
        """
        known = fov_deg or self.fov_deg
        fov = known or FOV_DEG
        view = find_view(landmarks.places, landmarks.pixels, self.size, fov)
        anywhere = {"place_m": FOUND_M, "turn_deg": FOUND_DEG}
        if known is None:
            anywhere["fov_deg"] = FOV_ERROR_DEG

        error = self.error.model_copy(update=anywhere)
        return replace(self, view=view, error=error, landmarks=landmarks, found=True)


def read_photographs(
    files: Sequence[str], cameras: Any, error: CameraError | None = None
) -> list[Photograph]:
    """Read photographs, of which the first have these cameras, measured with such an error.

    A field of view that is not given is what the photograph's EXIF says.

    Raises:
        UserError: one can't be read, or shows nothing; or a camera is none.
    """
    words = (
        "a camera needs position, target and fov_deg, such as cameras=[{position: [1.4, -0.9, 0.8], target: [0.6, 0, "
        "0.1], fov_deg: 52}]"
    )
    try:
        known = _CAMERAS.validate_json(json.dumps(cameras))
    except ValidationError as problem:
        raise UsageError(words) from problem

    error = error or CameraError()
    found = []
    known += [None] * len(files)
    for number, (name, camera) in enumerate(zip(files, known, strict=False), 1):
        file = expand(name)
        picture, fov_deg = read_with_fov(
            file.parent, file.name, camera, f"photo{number}"
        )
        with Image.open(io.BytesIO(picture.png)) as sent:  # made by this program
            grey = np.asarray(sent.convert("L"))
            size = sent.size
        if grey.std() < _DULL:
            raise UserError(
                f"{file} shows nothing: all of it has one colour; take the picture again, with the bench in it"
            )

        if camera and "fov_deg" not in cameras[number - 1]:
            if fov_deg is None:
                raise UsageError(f"{words}; {name} does not say its field of view")

            view = View(replace(camera, fov_deg=fov_deg), size)
            picture = write_caption(picture, describe_camera(view.camera, size))
        else:
            view = camera and View(camera, size)

        found.append(Photograph(picture, size, view, error, fov_deg=fov_deg))

    return found
