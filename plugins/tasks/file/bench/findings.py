"""Say what photographs gave: where their cameras stood, how well that fits, and what to do where it doesn't."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from core.geometry import Array
from plugins.tasks.file.bench.fitting import Fit
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.views import Landmarks, View

FAR = 2.5  # standard deviations from what was measured: something is wrong
BOARD_PX = 3.0  # that the board may be off
SEEN_PX = 10.0  # that the rest may be off
_PRINT = "print the board (print_board=board.pdf), lay it in all photographs, and give board=[x,y,yaw_deg]"


def describe_fit(photographs: Sequence[Photograph], fit: Fit) -> Iterator[str]:
    """Yield lines about each photograph whose camera is known, and warnings where a measure or lens seems wrong."""
    for number, photograph in enumerate(photographs):
        view = fit.views.get(number, photograph.view)
        before = photograph.view
        if view is None or before is None:
            continue

        name = photograph.picture.name
        place = ", ".join(f"{x:.3f}" for x in view.camera.position)
        known = photograph.landmarks
        if known is not None:
            off = _measure_off(known, view)
            kind = f"{known.markers} markers" if known.markers else "known places"
            what = "board" if known.markers else "known places"
            yield (
                f"{name}: {what} found: {kind}, camera at ({place}), field of view {view.camera.fov_deg:.1f} degrees, "
                f"{off:.1f} px off"
            )
            if known.markers and off > BOARD_PX:
                yield (
                    f"warning: {name}: the board fits badly; lay it flat, check that a marker is 50 mm wide and "
                    "that no zoom or panorama was used, or give fov_deg=DEGREES"
                )

        if not photograph.found and number in fit.moves:
            yield _describe_move(name, before, view)

        if fit.moves.get(number, 0.0) > FAR and not photograph.found:
            yield (
                f"warning: {name}: its camera fits only {fit.moves[number]:.1f} times as far off as measures usually "
                f"are; measure it again, or {_PRINT}"
            )
        if fit.off_px.get(number, 0.0) > SEEN_PX:
            yield (
                f"warning: {name}: what was seen fits badly, {fit.off_px[number]:.0f} px off; a measure, the lens or "
                f"the pixels are wrong; look at the page, or {_PRINT}"
            )

    if any(photo.landmarks and photo.landmarks.markers for photo in photographs):
        yield (
            "taken on faith: where the board lies, that it is flat, and how wide its markers are (50 mm, or "
            "board_marker_mm=...); an error there moves, turns or scales the whole bench"
        )
    together = _measure_shift(fit)
    if together > 0:
        yield f"all places together may lie up to {1000 * together:.0f} mm elsewhere"


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


def _describe_move(name: str, before: View, view: View) -> str:
    moved = np.subtract(view.camera.position, before.camera.position)
    trace = float(np.trace(view.axes @ before.axes.T))
    turned = np.degrees(np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0)))
    wider = view.camera.fov_deg - before.camera.fov_deg
    return (
        f"{name}: the fit moved its camera by {1000 * np.linalg.norm(moved):.0f} mm, turned it by {turned:.1f} degrees "
        f"and made its field of view {wider:+.1f} degrees wider"
    )


def _measure_off(known: Landmarks, view: View) -> float:
    off: Array = view.project(known.places) - known.pixels
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
