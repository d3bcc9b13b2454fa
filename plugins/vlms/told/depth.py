"""Measure heights from above as a depth camera does: a coloured picture with a scale, and a coarse grid of numbers."""

from __future__ import annotations

import math

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw

from core.geometry import Array
from core.interfaces import Picture, Task
from core.scene import Camera
from core.simulation.pictures import nearness, png
from plugins.vlms.told.views import SIZE, draw_grid, top_camera

PIXEL = 4  # of the picture, for one that the camera measures
ABOVE_M = 1.0  # the camera stands so far above the highest thing
STEPS_M = (0.01, 0.02, 0.05, 0.1)  # between numbers of the grid
MOST = 800  # numbers
_COLORS = np.array([[48, 18, 100], [50, 100, 190], [40, 170, 130], [150, 205, 60], [250, 220, 60], [200, 50, 30]])
_HOLE = (0, 0, 0)


def noise_m(depth: Array) -> Array:
    """Compute the standard deviation of a depth camera's readings, metres, at distances (...,), metres.

    That of a Kinect, straight on: C. V. Nguyen, S. Izadi, D. Lovell, "Modeling Kinect Sensor Noise for Improved 3D
    Reconstruction and Tracking", 3DIMPVT 2012.
    """
    return 0.0012 + 0.0019 * (depth - 0.4) ** 2


def depth_picture(task: Task, seed: int) -> Picture:
    """Draw the measured heights of the scene without the arm; the caption holds the grid of numbers."""
    bodies, camera = task.scene(seed).bodies, top_camera(task, seed)
    assert camera.height_m is not None
    wide, high = SIZE[0] // PIXEL, SIZE[1] // PIXEL
    exact = nearness(bodies, camera, wide, high)
    depth = np.nanmax(exact) + ABOVE_M - exact
    measured = exact + noise_m(depth) * np.random.default_rng(seed).standard_normal(exact.shape)
    low, top = (float(x) for x in np.nanpercentile(measured, (1, 99.9)))
    shades = np.clip((measured - low) / max(top - low, 1e-3), 0, 1) * (len(_COLORS) - 1)
    mixed = np.stack([np.interp(shades, range(len(_COLORS)), channel) for channel in _COLORS.T], axis=-1)
    pixels = np.where(np.isnan(mixed), _HOLE, mixed).astype(np.uint8)
    picture = Pillow.fromarray(pixels.repeat(PIXEL, axis=0).repeat(PIXEL, axis=1))
    draw_grid(picture, camera, 0, 1)
    _scale(picture, low, top)
    return Picture(png(np.asarray(picture)), "depth", _caption(camera, measured))


def _scale(picture: Pillow.Image, low: float, top: float) -> None:
    """Draw the colours with their heights in metres at the right edge."""
    pen, (wide, high) = ImageDraw.Draw(picture), (18, 240)
    left, upper = SIZE[0] - 80, 30
    pen.rectangle([(left - 6, upper - 24), (SIZE[0] - 2, upper + high + 12)], fill=(255, 255, 255))
    pen.text((left, upper - 20), "z (m)", fill=(20, 20, 20), font_size=13)
    for row in range(high):
        share = (1 - row / high) * (len(_COLORS) - 1)
        color = [int(np.interp(share, range(len(_COLORS)), _COLORS[:, channel])) for channel in range(3)]
        pen.line([(left, upper + row), (left + wide, upper + row)], fill=tuple(color))
    for share in np.linspace(0, 1, 6):
        pen.text(
            (left + wide + 4, upper + (1 - share) * high - 7), f"{low + share * (top - low):.3f}", fill=(20, 20, 20)
        )


def _caption(camera: Camera, measured: Array) -> str:
    """Describe the picture, and list a reading at each point of a grid."""
    assert camera.height_m is not None
    (high, wide), per_m = measured.shape, measured.shape[0] / camera.height_m
    step = next((s for s in STEPS_M if measured.size / (per_m * s) ** 2 <= MOST), STEPS_M[-1])
    x_m, y_m, _ = camera.target
    spans = [(middle, side / 2 / per_m) for middle, side in ((x_m, wide), (y_m, high))]
    xs, ys = (
        step * np.arange(math.ceil((middle - half) / step), math.floor((middle + half) / step) + 1)
        for middle, half in spans
    )
    columns = ((xs - x_m) * per_m + wide / 2).astype(int).clip(0, wide - 1)
    rows = (high / 2 - (ys - y_m) * per_m).astype(int).clip(0, high - 1)
    lines = [
        f"{y:.2f}: " + " ".join("-" if math.isnan(z) else f"{1000 * z:.0f}" for z in measured[row, columns])
        for y, row in sorted(zip(ys, rows, strict=True), reverse=True)
    ]
    spread = 1000 * float(noise_m(np.array(ABOVE_M)))
    return (
        "depth: heights of the scene above z = 0 without the arm, as a depth camera measures them from above, with "
        f"noise of {spread:.1f} mm and more for what is lower; clear things are not measured (-).\n"
        f"A reading in millimetres every {step:g} m, a line for each y; the first is at x = {xs[0]:.2f}:\n"
        + "\n".join(lines)
    )
