"""Say what photographs gave: where their cameras stood, how well that fits, and what to do where it doesn't."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from core.support.templates import fill
from plugins.tasks.file.bench.drafts import PACKAGE
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
