"""Rebuild benches at random from what is seen of them, and count the true values inside of what fits.

``python -m tests.benchmarks.benches [count=30] [click_px=2] [keep=FOLDER]``. The folder gets the benches as
they are (``is_3.yaml``), and as they were rebuilt, with their ``seen`` (``off_3.yaml``). Each bench is seen by two
cameras, as a person has them:

- ``true``: the cameras are known as they are.
- ``off``: each was measured 10 mm, 1 degree and 1 degree of field of view off (one standard deviation each),
  and its lens bends by a coefficient of 0.02. A roll nobody measured.
- ``board``: the same cameras, found by the printed board, in photographs with blur and noise. It lies 2 mm and 0.3
  degrees beside where it was measured (one standard deviation).

What a model would point at are true pixels with the errors of a person's clicks. Its rough numbers are off
by 40 mm, 8 degrees and 15 %.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

from core.config.compose import load, part
from core.config.schemas import RunConfig
from core.geometry import Array, Pose
from core.interfaces import Picture
from core.plugins import ROBOT
from core.scene import Camera
from plugins.tasks.file.bench.board import SHEET_M, find_by_board, print_board
from plugins.tasks.file.bench.drafts import Draft
from plugins.tasks.file.bench.fitting import measure_off, place_points
from plugins.tasks.file.bench.marks import Numbers
from plugins.tasks.file.bench.photographs import Photograph, read_photographs
from plugins.tasks.file.bench.scene_replies import Beside, Sighting
from plugins.tasks.file.bench.views import View
from plugins.tasks.file.task import FileTask
from plugins.tasks.file.tree import Tree

SIZE = (1280, 960)
SETUPS = ("true", "off", "board")
BEND = 0.02
FOV_DEG = 52.0
TEXT = """
name: RollToStripe
description: A ball lies in a channel. Roll it onto the stripe. Leave jar and block where they are.
bodies:
  - name: channel
    fixed: true
    position: [{x}, {y}, 0]  # seen, seen, assumed
    rpy_deg: [0, 0, {yaw}]  # assumed, assumed, seen
    parts:
      - {{box: [{wide}, {length}, 0.006], position: [0, 0, 0.003]}}  # seen, seen, assumed, seen, seen, assumed
      - {{box: [0.008, {length}, {high}], position: [{side}, 0, {up}]}}  # assumed, seen, seen, seen, seen, seen
      - {{box: [0.008, {length}, {high}], position: [-{side}, 0, {up}]}}  # assumed, seen, seen, seen, seen, seen
  - name: ball
    sphere: {radius}  # seen
    position: [{ball_x}, {ball_y}, {ball_z}]  # seen
    mass: 0.05  # assumed
  - name: jar
    cylinder: {{radius: {jar}, length: {tall}}}  # seen
    position: [{jar_x}, {jar_y}, {jar_z}]  # seen
    mass: 0.4  # assumed
  - name: block
    box: [{block_a}, {block_b}, {block_c}]  # seen
    position: [{block_x}, {block_y}, {block_z}]  # seen
    rpy_deg: [0, 0, {block_yaw}]  # assumed, assumed, seen
    mass: 0.3  # assumed
marks:
  - {{name: stripe, position: [{stripe_x}, {stripe_y}, 0.006], radius: 0.025}}  # seen, seen, assumed, assumed
goals:
  - {{bodies: [ball], at: stripe, place: [0, 0, null], tolerance: 0.025, rest: true, keep: [jar, block]}}
"""
CORNERS = [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]


@dataclass
class Found:
    """What came of one bench: by paths the true value, what fits best, and the least and most of what fits."""

    inside: list[bool] = field(default_factory=list)
    is_sound: bool = True
    widths: list[float] = field(default_factory=list)
    off: list[float] = field(default_factory=list)


def draw_bench(rng: np.random.Generator) -> dict[str, float]:
    """Draw the numbers of a bench, m and degrees."""
    draw = rng.uniform
    n = {"x": draw(0.75, 0.92), "y": draw(-0.06, 0.06), "yaw": draw(-12, 12)}
    n |= {"length": draw(0.4, 0.55), "wide": draw(0.08, 0.1), "high": draw(0.02, 0.03)}
    n |= {"side": n["wide"] / 2 - 0.004, "up": 0.006 + n["high"] / 2}
    n["radius"] = draw(0.02, 0.027)
    frame = Pose.xyz_rpy((n["x"], n["y"], 0.0), (0.0, 0.0, math.radians(n["yaw"])))
    ball = frame.apply(np.array([[0.0, -0.3 * n["length"], 0.0]]))[0]
    stripe = frame.apply(np.array([[0.0, 0.25 * n["length"], 0.0]]))[0]
    n |= {"ball_x": ball[0], "ball_y": ball[1], "ball_z": 0.0061 + n["radius"]}
    n |= {"stripe_x": stripe[0], "stripe_y": stripe[1]}
    n |= {"jar": draw(0.03, 0.05), "tall": draw(0.08, 0.15)}
    n |= {"jar_x": draw(0.5, 0.6), "jar_y": draw(0.12, 0.25), "jar_z": n["tall"] / 2}
    n |= {"block_a": draw(0.04, 0.1), "block_b": draw(0.04, 0.1)}
    n |= {"block_c": draw(0.03, 0.12), "block_yaw": draw(-30, 30)}
    n |= {"block_x": draw(0.45, 0.55), "block_y": draw(-0.25, -0.1)}
    n["block_z"] = n["block_c"] / 2
    return {name: round(float(value), 5) for name, value in n.items()}


def draw_rough(numbers: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    """Draw what a model says of them; what rests goes on resting."""
    rough = dict[str, float]()
    for name, value in numbers.items():
        if name.endswith("yaw"):
            rough[name] = value + 8 * rng.standard_normal()
        elif name.split("_")[-1] in ("x", "y"):
            rough[name] = value + 0.04 * rng.standard_normal()
        else:
            rough[name] = value * (
                1 + 0.15 * float(np.clip(rng.standard_normal(), -2, 2))
            )

    rough["side"] = rough["wide"] / 2 - 0.004
    rough["up"] = 0.006 + rough["high"] / 2
    rough["ball_z"] = 0.0061 + rough["radius"]
    rough["jar_z"] = rough["tall"] / 2
    rough["block_z"] = rough["block_c"] / 2
    return {name: round(float(value), 4) for name, value in rough.items()}


def draw_cameras(rng: np.random.Generator) -> list[View]:
    """Draw where two photographs were taken from."""
    views = list[View]()
    for side in (-1, 1):
        place = (1.45 + 0.1 * rng.uniform(-1, 1), side * rng.uniform(0.65, 0.85), 0.85)
        target = (0.68, 0.05 * rng.uniform(-1, 1), 0.0)
        views.append(View(Camera(place, target, FOV_DEG), SIZE))

    return views


def put_off(view: View, fov: float, rng: np.random.Generator) -> View:
    """Return where a camera stood that was measured as ``view``."""
    metres = 0.01 * rng.standard_normal(3)
    turn = np.radians(rng.standard_normal(3))
    return view.shift(metres, turn, fov, BEND)


def point(
    task: FileTask, views: list[View], click_px: float, rng: np.random.Generator
) -> Iterator[Sighting]:
    """Yield what is pointed at in the photographs: the upper corners of boxes, and boxes around what is round."""
    scene = task.scene(0)
    wanted: list[tuple[str, int | None, tuple[int, int, int]]]
    wanted = [("block", None, corner) for corner in CORNERS if corner[2] > 0]
    wanted += [("channel", None, corner) for corner in CORNERS if corner[2] > 0]
    wanted += [("channel", 0, corner) for corner in CORNERS if corner[0] > 0]
    for number, view in enumerate(views, 1):
        for name, index, corner in wanted:
            blank = Sighting(
                body=name, photo=number, pixels=(0.0, 0.0), point=corner, part=index
            )
            seen = measure_off(place_points(scene, blank), blank, view)
            x, y = seen + click_px * rng.standard_normal(2)
            yield blank.model_copy(update={"pixels": (float(x), float(y))})

        for name in ("ball", "jar", "stripe"):
            blank = Sighting(body=name, photo=number, pixels=(0.0, 0.0, 0.0, 0.0))
            seen = measure_off(place_points(scene, blank), blank, view)
            sides = (seen + click_px * rng.standard_normal(4)).tolist()
            yield blank.model_copy(update={"pixels": tuple(sides)})


def photograph_board(file: Path, view: View, frame: Pose, sheet: Array) -> None:
    """Draw a photograph of the printed board on a grey table, through a lens that bends, with blur and noise."""
    import cv2

    width, height = SIZE
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    bent = np.stack([columns - width / 2, height / 2 - rows], axis=-1) / view.focal
    tangents = bent.copy()
    for _ in range(8):
        squares = np.sum(tangents**2, axis=-1, keepdims=True)
        tangents = bent / (1 + view.bend * squares)

    rays = tangents @ view.axes[:2] + view.axes[2]
    place = np.array(view.camera.position)
    met = place + rays * (-place[2] / rays[..., 2:])
    on_sheet = frame.inverse().apply(met.reshape(-1, 3)).reshape(met.shape)
    dots = sheet.shape[0] / SHEET_M[1]
    right = (SHEET_M[0] / 2 - on_sheet[..., 1]) * dots - 0.5
    down = (SHEET_M[1] / 2 - on_sheet[..., 0]) * dots - 0.5
    maps = (right.astype(np.float32), down.astype(np.float32))
    drawn = cv2.remap(sheet, *maps, cv2.INTER_AREA, borderValue=150)
    blurred = cv2.GaussianBlur(drawn, (0, 0), 0.8).astype(float)
    noise = 3 * np.random.default_rng(0).standard_normal(blurred.shape)
    Image.fromarray((blurred + noise).clip(0, 255).astype(np.uint8)).save(file)


def rebuild(seed: int, click_px: float, folder: Path) -> dict[str, Found]:
    """Rebuild a bench in each of the three setups, and write it and the true one into a folder."""
    import cv2

    rng = np.random.default_rng(seed)
    truth = draw_bench(rng)
    true_file = folder / f"is_{seed}.yaml"
    true_file.write_text(TEXT.format(**truth), encoding="utf-8")
    true = FileTask(str(true_file))
    text = TEXT.format(**draw_rough(truth, rng))
    stated = draw_cameras(rng)
    fov = float(rng.standard_normal())
    moved = [put_off(view, fov, rng) for view in stated]
    robot = part(ROBOT, load("config", ["task=BringCube"], RunConfig).robot).create()
    sheet = cv2.imread(f"{folder}/board.png", cv2.IMREAD_GRAYSCALE)

    found = dict[str, Found]()
    for setup in SETUPS:
        views = stated if setup == "true" else moved
        photographs = [Photograph(Picture(b""), SIZE, view) for view in stated]
        if setup == "board":
            x = 0.62 + 0.002 * rng.standard_normal()
            y = 0.002 * rng.standard_normal()
            yaw = math.radians(0.3 * rng.standard_normal())
            frame = Pose.xyz_rpy((x, y, 0.0), (0.0, 0.0, yaw))
            files = [folder / f"photo{n}.png" for n in range(len(views))]
            for file, view in zip(files, views, strict=True):
                photograph_board(file, view, frame, sheet)

            photographs = read_photographs([str(file) for file in files], [])
            photographs = find_by_board(photographs, (0.62, 0.0, 0.0), FOV_DEG)

        draft = Draft(
            folder / f"{setup}_{seed}.yaml", photographs, {}, robot, FOV_DEG, text
        )
        draft.beside = Beside(sightings=tuple(point(true, views, click_px, rng)))
        draft.examine()
        found[setup] = compare(draft, true_file)
        found[setup].is_sound = not draft.faults
        draft.vary()
        draft.file.write_text(draft.text, encoding="utf-8")
        if draft.faults:
            print(f"bench {seed}, {setup}: {draft.faults}")

    return found


def compare(draft: Draft, true_file: Path) -> Found:
    """Compare what fits with the truth."""
    text = true_file.read_text(encoding="utf-8")
    truth = Numbers(Tree(true_file, text), text).values
    found = Found()
    for path, values in draft.fit.benches.items():
        low = min(values)
        high = max(values)
        if high - low < 1e-9:
            continue

        is_inside = bool(low <= truth[path] <= high)
        found.inside.append(is_inside)
        if not is_inside:
            print(f"  {path} is {truth[path]:.5g}, outside of {low:.5g} to {high:.5g}")

        if path.endswith(("position.x", "position.y")) and ".parts." not in path:
            found.widths.append(high - low)
            found.off.append(abs(values[0] - truth[path]))

    return found


def main(words: list[str]) -> None:
    """Rebuild benches, and print how many true values are inside of what fits."""
    settings = {
        key: yaml.safe_load(text) for key, text in (w.split("=") for w in words)
    }
    count = settings.get("count", 30)
    click_px = settings.get("click_px", 2.0)
    every = dict[str, list[Found]]()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(settings.get("keep", name))
        folder.mkdir(parents=True, exist_ok=True)
        print_board(f"{folder}/board.png")
        for seed in range(count):
            for setup, found in rebuild(seed, click_px, folder).items():
                every.setdefault(setup, []).append(found)
                inside = f"{sum(found.inside)} of {len(found.inside)} inside"
                print(f"bench {seed}, {setup}: {inside}", flush=True)

    print(f"{count} benches, clicks off by {click_px:g} pixels")
    tabulate(every)


def tabulate(every: dict[str, list[Found]]) -> None:
    """Print a line for each kind of cameras."""
    print(
        "cameras   inside          benches with all   refused   width, mm   off, mm: median, worst"
    )
    for setup, all_found in every.items():
        inside = np.concatenate([found.inside for found in all_found])
        refused = sum(not found.is_sound for found in all_found)
        whole = sum(all(found.inside) for found in all_found)
        width = 1000 * np.median(np.concatenate([found.widths for found in all_found]))
        off = 1000 * np.concatenate([found.off for found in all_found])
        share = f"{inside.sum():4} of {inside.size:4} ({inside.mean():.1%})"
        print(
            f"{setup:8}  {share}  {whole:3} of {len(all_found)}         {refused:3}    "
            f"{width:7.1f}     {np.median(off):5.1f}, {off.max():5.1f}"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
