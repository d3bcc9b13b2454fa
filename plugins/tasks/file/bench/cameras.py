"""The cameras of photographs as unknowns: what a person measured of them is uncertain, and a lens distorts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from core.geometry import Array, Pose
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.views import View

_POSE = 6
_LENS = 2
_BOARD = 3


class Bundle:
    """The cameras of photographs as unknowns, in standard deviations of what was measured.

    They are, of each camera whose view is known, its place (3) and turn (3); of each kind of lens its field of view and
    bend; and of the printed board its place (2) and yaw.

    Attributes:
        size: how many unknowns there are.
    """

    def __init__(self, photographs: Sequence[Photograph]) -> None:
        self._photographs = photographs
        self._views = {n: p.view for n, p in enumerate(photographs) if p.view}
        kinds = dict[tuple[float, tuple[int, int]], int]()
        self._lens = dict[int, int]()
        for number, view in self._views.items():
            kind = (view.camera.fov_deg, view.size)
            self._lens[number] = kinds.setdefault(kind, len(kinds))

        self._poses = _POSE * len(self._views)
        self._lenses = self._poses + _LENS * len(kinds)
        boards = [p.landmarks.markers for p in photographs if p.landmarks]
        self.size = self._lenses + (_BOARD if any(boards) else 0)

    def _split(self, shifted: Array) -> Iterator[tuple[int, Array, list[float]]]:
        """Yield what is unknown of each camera: its photograph's number, its pose (6,) and its lens (2,)."""
        poses = shifted[: self._poses].reshape(-1, _POSE)
        lenses = shifted[self._poses : self._lenses].reshape(-1, _LENS)
        for number, pose in zip(self._views, poses, strict=True):
            yield number, pose, lenses[self._lens[number]].tolist()

    def move(self, shifted: Array) -> dict[int, View]:
        """Return the views by the numbers of their photographs, from 0."""
        moved = dict[int, View]()
        for number, pose, (fov, bend) in self._split(shifted):
            error = self._photographs[number].error
            metres = error.place_m * pose[:3]
            turn = np.radians(error.turn_deg) * pose[3:]
            fov_deg = error.fov_deg * fov
            moved[number] = self._views[number].shift(
                metres, turn, fov_deg, error.bend * bend
            )

        return moved

    def miss(self, views: dict[int, View], shifted: Array) -> Array:
        """Compute by how many standard deviations known places are seen elsewhere."""
        off = [np.zeros(0)]
        board = shifted[self._lenses :]
        for number, view in views.items():
            photograph = self._photographs[number]
            known = photograph.landmarks
            if known is None:
                continue

            places = known.places
            if known.markers:
                x, y, yaw = board * photograph.error.board
                middle = places.mean(axis=0)
                turned = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, np.radians(yaw)))
                places = turned.apply(places - middle) + middle + [x, y, 0.0]

            missed = view.project(places) - known.pixels
            off.append(missed.ravel() / known.error_px)

        return np.concatenate(off)

    def measure_moves(self, shifted: Array) -> dict[int, float]:
        """Say how many standard deviations a camera is at most from where it was measured, by photographs' numbers."""
        return {
            number: float(np.abs([*pose, *lens]).max())
            for number, pose, lens in self._split(shifted)
        }
