"""Say what photographs gave: where their cameras stood, how well that fits, and what to do where it doesn't."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from core.support.templates import fill
from plugins.tasks.file.bench.drafts import PACKAGE, Draft
from plugins.tasks.file.bench.fitting import Fit
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.views import View


def describe_fit(photographs: Sequence[Photograph], fit: Fit) -> list[str]:
    """List lines about each photograph whose camera is known, and warnings where a measure or lens seems wrong."""
    seen = []
    for number, photograph in enumerate(photographs):
        before = photograph.view
        if before is None:
            continue

        view = fit.views.get(number, before)
        figures = _measure_move(before, view) | {
            "view": view,
            "moves": fit.moves.get(number),
            "seen_px": fit.off_px.get(number, 0.0),
        }
        known = photograph.landmarks
        if known is not None:
            off = view.project(known.places) - known.pixels
            figures["known_px"] = np.sqrt(np.mean(np.sum(off**2, axis=1)))

        seen.append((photograph, figures))

    marked = [photo.landmarks and photo.landmarks.markers for photo in photographs]
    shift_mm = 1000 * _measure_shift(fit)
    return fill(
        PACKAGE, "findings", seen=seen, on_board=any(marked), shift_mm=shift_mm
    ).splitlines()


def _measure_shift(fit: Fit) -> float:
    """Measure how far the middle of all bodies lies at most, along x or y, from where it is in the best fit, m."""
    shifts = []
    for axis in ("x", "y"):
        places = [
            values
            for path, values in fit.benches.items()
            if path.endswith(f".position.{axis}") and path.count(".") == 3
        ]
        if places:
            middles = np.mean(places, axis=0)
            shifts.append(float(np.abs(middles - middles[0]).max()))

    return max(shifts, default=0.0)


def _measure_move(before: View, view: View) -> dict[str, Any]:
    """Measure how far a fit moved a camera, turned it, and made its field of view wider."""
    moved = np.subtract(view.camera.position, before.camera.position)
    trace = float(np.trace(view.axes @ before.axes.T))
    turned = np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0))
    return {
        "moved_mm": 1000 * np.linalg.norm(moved),
        "turned_deg": np.degrees(turned),
        "wider_deg": view.camera.fov_deg - before.camera.fov_deg,
    }


@dataclass(frozen=True)
class Verdict:
    """Where a number of the scene file comes from.

    Attributes:
        name: of the body, mark or joint.
        key: of the number in it, such as ``position.x``.
        value: of the number, m or degrees.
        source: ``measured``, ``told``, ``assumed``, or ``guessed``: it was to be seen, and no photograph fixes it.
        photos: the names of the photographs that it was measured by.
        error: half of the range that fits, m or degrees.
    """

    name: str
    key: str
    value: float
    source: str
    photos: tuple[str, ...] = ()
    error: float = 0.0

    @property
    def kind(self) -> str:
        """What is measured: a place, a turn or a size; what lies in a body makes its size."""
        if "rpy_deg" in self.key:
            return "turn"

        return "place" if self.key.startswith("position") else "size"

    @property
    def amount(self) -> str:
        """The error in words; empty: there is none."""
        if not self.error:
            return ""

        unit, factor = ("deg", 1) if self.kind == "turn" else ("mm", 1000)
        return f"± {factor * self.error:.1f} {unit}"


def judge_numbers(draft: Draft) -> list[Verdict]:
    """List a verdict for each number of bodies, marks and joints."""
    fit = draft.fit
    numbers = draft.read_numbers()
    verdicts = []
    for path, mark in numbers.marks.items():
        name, key = path.split(".", 2)[1:]
        photos = []
        source = "guessed" if mark == "seen" else mark
        if path in fit.measured and mark != "told":
            source = "measured"
            seen_in = {s.photo for s in draft.beside.sightings if s.body == name}
            for number in sorted(fit.views):
                if number + 1 in seen_in:
                    photos.append(draft.photographs[number].picture.name)

        error = float(np.ptp(fit.benches.get(path, [0.0]))) / 2
        value = numbers.values[path]
        verdicts.append(Verdict(name, key, value, source, tuple(photos), error))

    return verdicts
