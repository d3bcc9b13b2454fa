"""Rebuild benches at random from what is seen of them, as they are and with what a person gets wrong.

``python -m tests.benchmarks.benches [count=30] [slips=10] [click_px=2] [keep=FOLDER] [only=WORD]``. The folder gets the
benches as they are (``is_3.yaml``), those that were rebuilt with their ``seen`` (``off_3.yaml``), and
``results.jsonl``: what is in it is not done again, so that a command that was cut goes on. With ``only``, no more than
the setups and mistakes with that word are done. Each bench is seen by two cameras, as a person has them:

- ``true``: the cameras are known as they are.
- ``off``: each was measured 10 mm, 1 degree and 1 degree of field of view off (one standard deviation each),
  and its lens bends by a coefficient of 0.02. A roll nobody measured.
- ``board``: the same cameras, found by the printed board, in photographs with blur and noise. It lies 2 mm and 0.3
  degrees beside where it was measured (one standard deviation).
- ``told``: as ``board``, and a person has measured two sizes to a millimetre.
- ``blurred``: as ``board``, but no board is found in the second photograph, the only one that shows ball, jar and
  stripe; clicks in it are off by half as much again.

What a model would point at are true pixels with the errors of a person's clicks, and the middle of the robot's foot,
off by 10 pixels. Its rough numbers are off by 40 mm, 8 degrees and 15 % of what the photographs show by the cameras or
the board as the person gave them. The mistakes (`SLIPS`) are made on the first of these benches.
"""

from __future__ import annotations

import json
import math
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image

from core.config.compose import load, part
from core.config.schemas import RunConfig
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import Picture, Robot
from core.plugins import ROBOT
from core.scene import Camera
from plugins.tasks.file.bench.board import SHEET_M, find_by_board, print_board
from plugins.tasks.file.bench.drafts import BenchMistake, Draft
from plugins.tasks.file.bench.fitting import measure_off, place_points
from plugins.tasks.file.bench.marks import Numbers
from plugins.tasks.file.bench.photographs import Photograph, read_photographs
from plugins.tasks.file.bench.scene_command import read_known
from plugins.tasks.file.bench.scene_replies import Beside, Sighting
from plugins.tasks.file.bench.views import View
from plugins.tasks.file.task import FileTask
from plugins.tasks.file.tree import Tree

SIZE = (1280, 960)
BEND = 0.02
FOV_DEG = 52.0
BASE_PX = 10.0
BLUR_PX = 0.8
BOARD = (0.62, 0.0, 0.0)
TEXT = """
name: RollToStripe
description: A ball lies in a channel. Roll it onto the stripe. Leave jar and block where they are.
bodies:
  - name: channel
    fixed: true
    position: [{x}, {y}, 0]  # seen, seen, assumed
    rpy_deg: [0, 0, {yaw}]  # assumed, assumed, seen
    parts:
      - {{box: [{wide}, {length}, 0.006], position: [0, 0, 0.003]}}  # seen, {l_mark}, assumed, seen, seen, assumed
      - {{box: [0.008, {length}, {high}], position: [{side}, 0, {up}]}}  # assumed, {l_mark}, seen, seen, seen, seen
      - {{box: [0.008, {length}, {high}], position: [-{side}, 0, {up}]}}  # assumed, {l_mark}, seen, seen, seen, seen
  - name: ball
    sphere: {radius}  # {r_mark}
    position: [{ball_x}, {ball_y}, {ball_z}]  # seen
    mass: 0.05  # assumed
  - name: jar
    cylinder: {{radius: {jar}, length: {tall}}}  # seen, {t_mark}
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
NAMES = {"tall": "jar.height", "length": "channel.length", "radius": "ball.radius"}
"""What a person calls a size."""

Setup = Callable[["Bench"], None]


@dataclass
class Bench:
    """A bench as it is, and what a person gives of it: a setup changes one or the other.

    Attributes:
        rng: of all errors.
        truth: its numbers, m and degrees.
        folder: for its files.
        stated: the cameras as they were measured.
        views: as they are.
        errors_px: how well one clicks in each photograph, one standard deviation.
        board: where it is said to lie; None: there is none.
        lies: where it does; None: as it is said, with a person's error.
        printed: its size, as a share of what it should be.
        known: the sizes that a person tells.
        seen: the numbers of the bench in each photograph.
        hidden: bodies that a photograph does not show, by its number.
        flips: what is done with each photograph, rows and columns from behind (-1).
        blur_px: of each photograph.
    """

    rng: np.random.Generator
    truth: dict[str, float]
    folder: Path
    stated: list[View]
    views: list[View]
    errors_px: list[float]
    board: tuple[float, ...] | None = None
    lies: tuple[float, ...] | None = None
    printed: float = 1.0
    known: dict[str, float] = field(default_factory=dict)
    seen: list[dict[str, float]] = field(default_factory=list)
    hidden: Mapping[int, Sequence[str]] = field(default_factory=dict)
    flips: list[tuple[int, int]] = field(default_factory=lambda: [(1, 1), (1, 1)])
    blur_px: list[float] = field(default_factory=lambda: [BLUR_PX, BLUR_PX])


@dataclass
class Row:
    """What came of one bench in one setup.

    Attributes:
        setup: its name.
        seed: the bench's number.
        verdict: `sound`, `right`, `wrong`, `pixels` (the model's pointing is blamed), or `silent`.
        words: what was said.
        inside: whether each true value lies in its range.
        widths: of the ranges of places, m.
        off: of places, m.
        cpu_s: processor seconds.
    """

    setup: str
    seed: int
    verdict: str
    words: str = ""
    inside: list[bool] = field(default_factory=list)
    widths: list[float] = field(default_factory=list)
    off: list[float] = field(default_factory=list)
    cpu_s: float = 0.0


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

    return rough


def write(numbers: dict[str, float], told: dict[str, float]) -> str:
    """Write a scene file of a bench; sizes that were told are as they were told."""
    written = {name: round(value, 5) for name, value in numbers.items()} | told
    written["side"] = round(written["wide"] / 2 - 0.004, 5)
    written["up"] = round(0.006 + written["high"] / 2, 5)
    written["ball_z"] = round(0.0061 + written["radius"], 5)
    written["jar_z"] = round(written["tall"] / 2, 5)
    written["block_z"] = round(written["block_c"] / 2, 5)
    marks = {f"{name[0]}_mark": "told" if name in told else "seen" for name in NAMES}
    return TEXT.format(**written, **marks)


def see_by(numbers: dict[str, float], place: Pose, scale: float) -> dict[str, float]:
    """Compute the numbers of a bench in a world that is moved, and larger by a scale."""
    turn = math.degrees(place.rpy[2])
    moved = dict[str, float]()
    for name, value in numbers.items():
        if name.endswith("yaw"):
            moved[name] = value + turn
        elif name.split("_")[-1] not in ("x", "y"):
            moved[name] = value * scale

    for name in ("", "ball_", "jar_", "block_", "stripe_"):
        there = np.array([[numbers[f"{name}x"], numbers[f"{name}y"], 0.0]])
        x, y, _ = place.apply(scale * there)[0]
        moved |= {f"{name}x": float(x), f"{name}y": float(y)}

    return moved


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


def point(bench: Bench, number: int) -> Iterator[Sighting]:
    """Yield what is pointed at in a photograph: corners of boxes, boxes around what is round, the robot's foot."""
    view = bench.views[number]
    error_px = bench.errors_px[number]
    file = bench.folder / "seen.yaml"
    file.write_text(write(bench.seen[number], {}), encoding="utf-8")
    scene = FileTask(str(file)).scene(0)
    blanks = list[Sighting]()
    common: dict[str, Any] = {"photo": number + 1}
    for corner in CORNERS:
        for body in ("block", "channel"):
            if corner[2] > 0:
                blanks.append(
                    Sighting(body=body, pixels=(0.0, 0.0), point=corner, **common)
                )
        if corner[0] > 0:
            part_of = Sighting(
                body="channel", pixels=(0.0, 0.0), point=corner, part=0, **common
            )
            blanks.append(part_of)

    for body in ("ball", "jar", "stripe"):
        blanks.append(Sighting(body=body, pixels=(0.0, 0.0, 0.0, 0.0), **common))

    for blank in blanks:
        if blank.body not in bench.hidden.get(number, ()):
            seen = measure_off(place_points(scene, blank), blank, view)
            seen = seen + error_px * bench.rng.standard_normal(len(seen))
            yield flip(blank, seen, bench.flips[number])

    foot = view.project(np.zeros((1, 3)))[0] + BASE_PX * bench.rng.standard_normal(2)
    if np.all((foot > 0) & (foot < SIZE)):
        blank = Sighting(body="robot_base", pixels=(0.0, 0.0), **common)
        yield flip(blank, foot, bench.flips[number])


def flip(sighting: Sighting, pixels: Array, signs: tuple[int, int]) -> Sighting:
    """Put pixels into a sighting of a photograph that may be upside down or mirrored; signs are of rows and columns."""
    ends = pixels.reshape(-1, 2)
    middle = np.array(SIZE) / 2
    ends = middle + (ends - middle) * [signs[1], signs[0]]
    if len(ends) == 2:
        ends = np.stack([ends.min(axis=0), ends.max(axis=0)])

    return sighting.model_copy(update={"pixels": tuple(ends.ravel().tolist())})


def photograph_board(file: Path, bench: Bench, number: int, frame: Pose) -> None:
    """Draw a photograph of the printed board on a grey table, through a lens that bends, with blur and noise."""
    import cv2

    view = bench.views[number]
    sheet = np.asarray(Image.open(bench.folder / "board.png").convert("L"))
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
    on_sheet /= bench.printed
    dots = sheet.shape[0] / SHEET_M[1]
    right = (SHEET_M[0] / 2 - on_sheet[..., 1]) * dots - 0.5
    down = (SHEET_M[1] / 2 - on_sheet[..., 0]) * dots - 0.5
    maps = (right.astype(np.float32), down.astype(np.float32))
    drawn = cv2.remap(sheet, *maps, cv2.INTER_AREA, borderValue=150)
    blur_px = bench.blur_px[number]
    blurred = cv2.GaussianBlur(drawn, (0, 0), blur_px).astype(float)
    noise = 3 * np.random.default_rng(0).standard_normal(blurred.shape)
    row, column = bench.flips[number]
    taken = (blurred + noise).clip(0, 255).astype(np.uint8)[::row, ::column]
    Image.fromarray(taken).save(file)


def set_up(seed: int, click_px: float, folder: Path) -> Bench:
    """Draw a bench and its cameras; a setup says what a person knows of them."""
    rng = np.random.default_rng(seed)
    truth = draw_bench(rng)
    stated = draw_cameras(rng)
    fov = float(rng.standard_normal())
    views = [put_off(view, fov, rng) for view in stated]
    seen = [truth, truth]
    return Bench(rng, truth, folder, stated, views, [click_px] * 2, seen=seen)


def see_truly(bench: Bench) -> None:
    bench.views = bench.stated


def measure_cameras(bench: Bench) -> None:
    """Nothing is to be done: the cameras are off."""


def lay_board(bench: Bench) -> None:
    bench.board = BOARD


def tell_sizes(bench: Bench) -> None:
    lay_board(bench)
    bench.known = {name: round(bench.truth[name], 3) for name in ("tall", "length")}


def blur_one(bench: Bench) -> None:
    lay_board(bench)
    bench.blur_px = [BLUR_PX, 8.0]
    bench.errors_px[1] *= 1.5
    bench.hidden = {0: ("ball", "jar", "stripe")}


SETUPS: dict[str, Setup] = {
    "true": see_truly,
    "off": measure_cameras,
    "board": lay_board,
    "told": tell_sizes,
    "blurred": blur_one,
}


def swap_cameras(bench: Bench) -> None:
    bench.stated.reverse()


def flip_one(bench: Bench, signs: tuple[int, int]) -> None:
    bench.flips[int(bench.rng.integers(2))] = signs


def flip_with_board(bench: Bench, signs: tuple[int, int]) -> None:
    lay_board(bench)
    flip_one(bench, signs)


def turn_board(bench: Bench) -> None:
    yaw = float(bench.rng.choice((-1, 1)) * bench.rng.integers(10, 40))
    bench.board = (0.62, 0.03, yaw)
    bench.lies = (0.62, 0.03, -yaw)


def scale_board(bench: Bench, setup: Setup) -> None:
    setup(bench)
    bench.printed = 0.94


def place_in_centimetres(bench: Bench) -> None:
    bench.board = (62.0, 3.0, 10.0)


def tell_in_centimetres(bench: Bench) -> None:
    lay_board(bench)
    name = sorted(NAMES)[int(bench.rng.integers(len(NAMES)))]
    bench.known = {name: round(100 * bench.truth[name], 1)}


def tell_wrongly(bench: Bench) -> None:
    """A person misreads a tape by a fifth to a half."""
    tell_sizes(bench)
    name = sorted(bench.known)[int(bench.rng.integers(2))]
    share = 1 + float(bench.rng.choice((-1, 1)) * bench.rng.uniform(0.2, 0.5))
    bench.known[name] = round(bench.known[name] * share, 3)


def move_body(bench: Bench, setup: Setup) -> None:
    setup(bench)
    name = ("jar", "block", "ball")[int(bench.rng.integers(3))]
    far = bench.rng.uniform(0.06, 0.12)
    angle = bench.rng.uniform(-math.pi, math.pi)
    if name == "ball":  # along the channel
        angle = math.radians(bench.truth["yaw"] + 90)

    moved = dict(bench.truth)
    moved[f"{name}_x"] += far * math.cos(angle)
    moved[f"{name}_y"] += far * math.sin(angle)
    bench.seen[1] = moved


def show_another(bench: Bench, setup: Setup) -> None:
    setup(bench)
    bench.seen[1] = draw_bench(bench.rng)


@dataclass(frozen=True)
class Slip:
    """What a person gets wrong.

    Attributes:
        setup: makes it.
        names: what has to be said of it.
    """

    setup: Setup
    names: str


SLIPS = {
    "cameras swapped": Slip(swap_cameras, "swapped"),
    "upside down": Slip(partial(flip_one, signs=(-1, -1)), "upside down"),
    "mirrored": Slip(partial(flip_one, signs=(1, -1)), "mirrored"),
    "mirrored, with a board": Slip(partial(flip_with_board, signs=(1, -1)), "mirrored"),
    "board turned the other way": Slip(turn_board, r"turned the other way.*board=\["),
    "board at 94 %, two sizes told": Slip(
        partial(scale_board, setup=tell_sizes), r"board_marker_mm=4[67]"
    ),
    "board at 94 %, nothing told": Slip(
        partial(scale_board, setup=lay_board), r"board_marker_mm=4[67]"
    ),
    "board= in centimetres": Slip(place_in_centimetres, r"type board=\[0\.62,0\.03,10"),
    "known= in centimetres": Slip(tell_in_centimetres, "of centimetres"),
    "a told size is wrong": Slip(tell_wrongly, "is told as"),
    "a body moved, measured cameras": Slip(
        partial(move_body, setup=measure_cameras), "moved in between"
    ),
    "a body moved, board": Slip(
        partial(move_body, setup=lay_board), "moved in between"
    ),
    "two scenes, measured cameras": Slip(
        partial(show_another, setup=measure_cameras), "another bench than"
    ),
    "two scenes, board": Slip(
        partial(show_another, setup=lay_board), "another bench than"
    ),
}


def find_photographs(bench: Bench) -> tuple[list[Photograph], Pose, float]:
    """Take the photographs, and find their cameras as a person would have them found.

    Returns:
        them, and by which turn and scale the bench lies elsewhere in the world in which the model sees it.
    """
    if bench.board is None:
        pictures = [Picture(b"", f"photo{n}") for n in (1, 2)]
        found = [
            Photograph(picture, SIZE, view)
            for picture, view in zip(pictures, bench.stated, strict=True)
        ]
        return found, Pose(), 1.0

    errors = bench.rng.standard_normal(3) * (0.002, 0.002, 0.3)
    x, y, yaw = np.add(bench.lies or bench.board, errors)
    frame = Pose.xyz_rpy((x, y, 0.0), (0.0, 0.0, math.radians(yaw)))
    files = [bench.folder / f"photo{n}.png" for n in (1, 2)]
    for number, file in enumerate(files):
        photograph_board(file, bench, number, frame)

    photographs = read_photographs([str(file) for file in files], [])
    photographs = find_by_board(photographs, bench.board, FOV_DEG)
    x, y, yaw = bench.board
    said = Pose.xyz_rpy((x, y, 0.0), (0.0, 0.0, math.radians(yaw)))
    scale = 1 / bench.printed
    back = frame.inverse()
    turned = replace(back, position=scale * back.position)
    return photographs, said @ turned, scale


def examine(bench: Bench, file: Path, robot: Robot) -> tuple[Draft, float]:
    """Have a bench rebuilt from what is seen of it; return it, and the processor seconds that this took.

    Raises:
        UserError: a mistake of the person is named.
    """
    names = {NAMES[name]: value for name, value in bench.known.items()}
    known = read_known(f"known={json.dumps(names)}")
    photographs, place, scale = find_photographs(bench)
    believed = see_by(bench.truth, place, scale)
    text = write(draw_rough(believed, bench.rng), bench.known)
    draft = Draft(
        file, photographs, known, robot, FOV_DEG, text, board=bench.board or ()
    )
    sightings = [sighting for n in range(2) for sighting in point(bench, n)]
    draft.beside = Beside(sightings=tuple(sightings))
    begun = time.process_time()
    draft.examine()
    return draft, time.process_time() - begun


def rebuild(
    name: str, setup: Setup, seed: int, click_px: float, folder: Path, robot: Robot
) -> Row:
    """Rebuild a sound bench, and write it and the true one into a folder."""
    bench = set_up(seed, click_px, folder)
    true_file = folder / f"is_{seed}.yaml"
    true_file.write_text(write(bench.truth, {}), encoding="utf-8")
    setup(bench)
    try:
        draft, cpu_s = examine(bench, folder / f"{name}_{seed}.yaml", robot)
    except UserError as error:
        return Row(name, seed, "wrong", str(error))

    row = compare(draft, true_file)
    row.cpu_s = cpu_s
    row.setup = name
    row.seed = seed
    if draft.faults:
        row.verdict = "pixels"
        row.words = " ".join(draft.faults)

    draft.vary()
    draft.file.write_text(draft.text, encoding="utf-8")
    return row


def compare(draft: Draft, true_file: Path) -> Row:
    """Compare what fits with the truth."""
    text = true_file.read_text(encoding="utf-8")
    truth = Numbers(Tree(true_file, text), text).values
    row = Row("", 0, "sound")
    for path, values in draft.fit.benches.items():
        low = min(values)
        high = max(values)
        if high - low < 1e-9:
            continue

        row.inside.append(bool(low <= truth[path] <= high))
        if path.endswith(("position.x", "position.y")) and ".parts." not in path:
            row.widths.append(high - low)
            row.off.append(abs(values[0] - truth[path]))

    return row


def slip(
    name: str, mistake: Slip, seed: int, click_px: float, folder: Path, robot: Robot
) -> Row:
    """Rebuild a bench of which a person got something wrong, and judge what is said."""
    bench = set_up(seed, click_px, folder)
    mistake.setup(bench)
    begun = time.process_time()
    blamed = ""
    try:
        draft, _ = examine(bench, folder / "slip.yaml", robot)
        said = " ".join(draft.faults)
        if said:
            blamed = "pixels"
    except (BenchMistake, UserError) as error:
        said = str(error)
        blamed = "wrong"

    cpu_s = time.process_time() - begun
    verdict = blamed or "silent"
    if re.search(mistake.names, said, re.DOTALL):
        verdict = "right"

    return Row(name, seed, verdict, said, cpu_s=cpu_s)


def main(words: list[str]) -> None:
    """Rebuild benches, and print what came of them."""
    settings = {
        key: yaml.safe_load(text) for key, text in (w.split("=") for w in words)
    }
    count = settings.get("count", 30)
    slips = settings.get("slips", 10)
    click_px = settings.get("click_px", 2.0)
    only = str(settings.get("only", ""))
    robot = part(ROBOT, load("config", ["task=BringCube"], RunConfig).robot).create()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(settings.get("keep", name))
        folder.mkdir(parents=True, exist_ok=True)
        print_board(f"{folder}/board.png")
        jobs = dict[tuple[str, int], Callable[[], Row]]()
        fixed = {"click_px": click_px, "folder": folder, "robot": robot}
        for seed in range(count):
            for title, setup in SETUPS.items():
                jobs[title, seed] = partial(rebuild, title, setup, seed, **fixed)
        for seed in range(slips):
            for title, mistake in SLIPS.items():
                jobs[title, seed] = partial(slip, title, mistake, seed, **fixed)

        rows = do(jobs, folder / "results.jsonl", only)

    print(f"clicks off by {click_px:g} pixels")
    tabulate([row for row in rows if row.setup in SETUPS])
    tabulate_slips([row for row in rows if row.setup in SLIPS])


def do(
    jobs: dict[tuple[str, int], Callable[[], Row]], file: Path, only: str
) -> list[Row]:
    """Do what is not done yet, and write each row at once."""
    rows = list[Row]()
    if file.exists():
        for line in file.read_text("utf-8").splitlines():
            rows.append(Row(**json.loads(line)))

    done = {(row.setup, row.seed) for row in rows}
    for (title, seed), job in jobs.items():
        if (title, seed) in done or only not in title:
            continue

        row = job()
        rows.append(row)
        print(f"{title}, bench {seed}: {row.verdict} {row.words[:300]}", flush=True)
        with file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(asdict(row)) + "\n")

    return [row for row in rows if (row.setup, row.seed) in jobs]


def tabulate(rows: Sequence[Row]) -> None:
    """Print a line for each setup of sound benches."""
    print(
        "setup     inside                benches with all  alarms  width, mm  "
        "off, mm: median, worst  cpu s"
    )
    for setup in SETUPS:
        here = [row for row in rows if row.setup == setup]
        fitted = [row for row in here if row.inside]
        if not fitted:
            continue

        inside = np.concatenate([row.inside for row in fitted])
        alarms = sum(row.verdict != "sound" for row in here)
        whole = sum(all(row.inside) for row in fitted)
        width = 1000 * np.median(np.concatenate([row.widths for row in fitted]))
        off = 1000 * np.concatenate([row.off for row in fitted])
        share = f"{inside.sum():4} of {inside.size:4} ({inside.mean():.1%})"
        cpu_s = np.mean([row.cpu_s for row in fitted])
        print(
            f"{setup:8}  {share}  {whole:3} of {len(here)}         {alarms:3}    {width:7.1f}     "
            f"{np.median(off):5.1f}, {off.max():5.1f}          {cpu_s:.1f}"
        )

    blurred = [max(row.off) for row in rows if row.setup == "blurred" and row.off]
    near = sum(off < 0.015 for off in blurred)
    print(
        f"one photograph blurred: all places within 15 mm in {near} of {len(blurred)}"
    )


def tabulate_slips(rows: Sequence[Row]) -> None:
    """Print a line for each mistake."""
    print("mistake                          right  wrong  pixels  silent   of  cpu s")
    for title in SLIPS:
        here = [row for row in rows if row.setup == title]
        if here:
            verdicts = [row.verdict for row in here]
            counts = [verdicts.count(v) for v in ("right", "wrong", "pixels", "silent")]
            columns = "".join(f"{count:7}" for count in [*counts, len(here)])
            cpu_s = np.mean([row.cpu_s for row in here])
            print(f"{title:31}{columns}  {cpu_s:.1f}")


if __name__ == "__main__":
    main(sys.argv[1:])
