"""Play the designs of ``docs/gallery`` again, draw them, and write their page: ``python docs/build.py gallery``.

There is a folder of designs files for each designer, a file for each task. ``figures.json`` keeps what they earned, and
pictures go to ``docs/images/gallery``. Nothing there is made by hand.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw, ImageSequence

from core.config.compose import load, node, part, task_part, tool_part
from core.design import Candidate, Tool
from core.designs.reading import load_designs, read_designs
from core.interfaces import Condition, Image, RolloutSettings
from core.plugins import SIMULATOR
from core.scene import Camera, Scene, floor
from core.simulation.pictures import Film, filmed
from core.simulation.play import play
from core.support.text import count_words, number
from core.values.printers import Printer
from plugins.results.pages.drawing import as_held
from plugins.results.pages.page import in_viewer, render
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.slicing import ask_slicer, find_slicer
from plugins.results.workshop.tool import make_tool
from plugins.results.workshop.verdicts import carried

DOCS = Path(__file__).parent
DESIGNS = DOCS / "gallery"
PICTURES = DOCS / "images" / "gallery"
PAGE = DOCS / "gallery.md"
FIGURES = DESIGNS / "figures.json"
TOOLS = DESIGNS / "tools.html"

BEGIN = "<!-- gallery: python docs/build.py gallery -->\n"
END = "<!-- end of gallery -->\n"

DESIGNERS = {
    "model": "urdf",
    "round_2": "urdf",
    "round_3": "urdf",
    "embedded": "urdf",
    "in_pla": "urdf",
    "gripper": "none",
}
"""Who designed, by folder, and in which form tools are written there; ``round_2``: the model after it saw feedback.

``in_pla`` has what the embedded designer found with ``python -m core.run task=... sim=mujoco``.
"""

COMPARED = ("model", "embedded", "gripper")
"""Who designed for all tasks."""

MADE = {"model": "the model", "in_pla": "the embedded designer"}
"""Whose tools are printed."""

ROUNDS = {"model": "round 1", "round_2": "round 2", "round_3": "round 3"}
"""What the rounds are called of tasks for which the model saw feedback."""

TITLES = {"model": "the model", "embedded": "the embedded designer"}
"""What those who made tools are called."""

ENGINES = {"mujoco": "MuJoCo", "pybullet": "PyBullet", "sapien": "SAPIEN"}
DRAWS = "mujoco"
MATERIAL = "paper"  # in which the designs were tried
PRINTED = "pla"
SLICER = "prusa-slicer"

GOALS = {
    "BringCube": "Bring a cube of 1 kg, out of the gripper's reach, 0.4 m closer onto a mark.",
    "CleanTable": "Sweep eight scattered cubes into a circle, none past it and none off the table.",
    "DislodgeCube": "Get a cube out of the far end of a see-through pipe that has a side branch.",
    "ElevatePlate": "Lift a dinner plate by 0.4 m, level, and hold it.",
    "GatherSpheres": "Scoop thirty small spheres from between three walls, and hold them above 0.3 m.",
    "HighObject": "Bring a cube from a board 0.9 m high into a bin on the floor.",
    "LiftBox": "Lift an open cardboard box, too wide for a gripper, by 0.13 m without tilting it.",
    "MoveBall": "Bring a ball that rolls far 0.6 m to the other side, and let it rest on the mark.",
    "OneBook": "Pull one book out of a row of five, and leave the other four.",
    "ScoreGoal": "Get a puck on ice into a goal that is out of reach.",
    "SnatchCookie": "Take one cookie out of a deep jar, and hold it above the mouth.",
    "TurkeyLegs": "Bring five slippery turkey legs out of a pot into a box, but not the pot.",
}
"""What each task asks for, in a sentence; its whole description stands in the task's file."""

DONE = 0.95  # the reward from which a task counts as done

SMALL = (320, 240)  # pixels of a still
STRIP = (
    "BringCube",
    "OneBook",
    "HighObject",
    "TurkeyLegs",
    "GatherSpheres",
    "ElevatePlate",
)
FRAME = (320, 240)  # pixels of each of the strip's films
COLUMNS = 3  # of the strip
STRIP_FRAMES = 36
STRIP_MS = 150  # how long each of them is shown
FROM = (0.75, -0.85, 0.5)  # whence a tool is drawn
ROOM = 1.15  # of its size, how much the picture shows


@dataclass(frozen=True, eq=False)
class Entry:
    """A design for a task, with what plays it.

    Attributes:
        task: its name.
        designer: one of `DESIGNERS`.
    """

    task: str
    designer: str

    @property
    def file(self) -> Path:
        return DESIGNS / self.designer / f"{self.task}.json"

    def config(self, *words: str, material: str = MATERIAL) -> Any:
        """Compose the settings with which ``vlmgineer evaluate`` tries it."""
        tool = DESIGNERS[self.designer]
        mine = [f"task={self.task}", f"tool={tool}", f"material={material}"]
        return load("evaluate", [*mine, *words])

    def read(self, material: str = MATERIAL) -> Candidate:
        """Read its first plan."""
        config = self.config(material=material)
        task = task_part(config).create()
        form = tool_part(config).create()
        return read_designs(load_designs(self.file), form, task)[0]

    def condition(self, engine: str, material: str = MATERIAL) -> Condition:
        """Return where it is tried: the task's layout 0, in an engine."""
        config = self.config(f"sim={engine}", material=material)
        settings = node(config.rollout, RolloutSettings)
        engine_part = part(SIMULATOR, config.sim)
        return Condition(task_part(config), engine_part, config.seed, settings)


def entries(task: str, designers: Sequence[str] = tuple(DESIGNERS)) -> list[Entry]:
    """List the designs for a task that are there."""
    found = [Entry(task, designer) for designer in designers]
    return [entry for entry in found if entry.file.exists()]


def measure(entry: Entry) -> dict[str, Any]:
    """Play a design in each engine, and weigh and check its tool as a printer would make it."""
    if entry.designer == "in_pla":
        return measure_printed(entry)

    candidate = entry.read()
    rewards = {}
    rooms = {}
    for engine in ENGINES:
        (trial,) = play(entry.condition(engine), [candidate])
        rewards[engine] = round(trial.reward, 4)
        rooms[engine] = min((margin.margin for margin in trial.margins), default=0.0)

    figures: dict[str, Any] = {
        "tool": candidate.tool.name if candidate.tool else "",
        "says": candidate.design_description,
        "rewards": rewards,
        "room": round(rooms[DRAWS], 3),
    }
    if entry.designer in COMPARED and candidate.tool and candidate.tool.components:
        figures |= measure_printed(entry)

    return figures


def measure_printed(entry: Entry) -> dict[str, Any]:
    """Make a design's tool of PLA, ask a slicer what that takes, if there is one, and play it in each engine.

    Returns:
        its mass in simulation, what fails of it first, its pieces, what printing takes, and its rewards.
    """
    candidate = entry.read(PRINTED)
    tool = candidate.tool
    assert tool is not None
    representation = tool_part(entry.config(material=PRINTED)).create()
    material = representation.material
    robot = entry.condition(DRAWS).task.shared().robot
    made = make_tool(tool, robot, material, Printer(), Fit())
    failing = [
        check
        for check in (*carried(made.printed, robot, material), *made.verdicts)
        if check.passed is False and check.name != "weight"
    ]
    figures: dict[str, Any] = {
        "mass_g": round(1000 * tool.mass, 1),
        "problem": str(failing[0]) if failing else "",
        "pieces": len(made.parts),
    }
    if shutil.which(SLICER) and all(part.lying.fits for part in made.parts):
        slicer = find_slicer(SLICER)
        sliced, _ = ask_slicer(slicer, made.parts, Printer(), material)
        figures |= {name: sliced[name] for name in ("hours", "grams") if sliced}

    rewards = {}
    for engine in ENGINES:
        (trial,) = play(entry.condition(engine, PRINTED), [candidate])
        rewards[engine] = round(trial.reward, 4)
        if trial.status == "rejected":
            figures["rejected"] = trial.reason

    return {**figures, "printed_rewards": rewards}


def play_film(entry: Entry) -> Film:
    """Play a design again, and record it."""
    condition = entry.condition(DRAWS)
    task = condition.task.shared()
    engine = condition.sim.shared()
    return filmed(task, engine, entry.read(), condition.layout, condition.settings)


def save_webp(frames: Sequence[tuple[Image, int]], file: Path, quality: int) -> None:
    """Write pictures as a WebP file, which moves if there are several; each with how long it is shown, ms."""
    first, *others = [Pillow.fromarray(picture) for picture, _ in frames]
    moving: dict[str, Any] = {}
    if others:
        durations = [milliseconds for _, milliseconds in frames]
        moving = {
            "save_all": True,
            "append_images": others,
            "duration": durations,
            "loop": 0,
            "kmax": 1000,
        }
    first.save(file, quality=quality, method=4, **moving)


def draw_tool(film: Film) -> Image:
    """Draw a tool as the arm holds it at home, without the scene."""
    task = film.task
    tool = film.tool
    assert tool is not None

    shown = copy(task)
    shown.scene = _show_floor  # type: ignore[method-assign]

    solids = [solid for _, solid in as_held(tool, task.robot)]
    corners = np.concatenate([solid.bounds for solid in solids])
    low = np.minimum(corners.min(axis=0), -0.05)
    high = np.maximum(corners.max(axis=0), 0.05)
    middle = task.home.position + (low + high) / 2
    away = ROOM * float(np.linalg.norm(high - low)) / 2 / np.tan(np.radians(20.0))
    way = np.array(FROM) / np.linalg.norm(FROM)
    place = middle + away * way

    camera = Camera(tuple(place.tolist()), tuple(middle.tolist()), 40.0)
    return film.simulator.render(
        shown, tool=tool, camera=camera, width=SMALL[0], height=SMALL[1]
    )


def _show_floor(seed: int) -> Scene:
    return Scene((floor(),))


def draw(entry: Entry) -> None:
    """Draw a design's tool, and of the model's first and last the film."""
    if entry.designer in ("gripper", "in_pla"):
        return

    PICTURES.mkdir(parents=True, exist_ok=True)
    film = play_film(entry)
    name = f"{entry.task}_{entry.designer}"
    save_webp([(draw_tool(film), 0)], PICTURES / f"{name}.webp", 80)
    if entry.designer == "model":
        save_webp([*film.frames()], PICTURES / f"{entry.task}.webp", 45)
    if entry.designer == [*ROUNDS][-1]:
        save_webp([*film.frames()], PICTURES / f"{name}_film.webp", 45)


def save_strip() -> None:
    """Write the films of six tasks in two rows; each is shown from its start to its end in the same time."""
    films = [[*_sample(PICTURES / f"{task}.webp", task)] for task in STRIP]
    frames = [_arrange(pictures) for pictures in zip(*films, strict=True)]
    shown = [(frame, STRIP_MS) for frame in frames]
    shown[-1] = (frames[-1], 2500)
    save_webp(shown, PICTURES / "strip.webp", 45)


def _arrange(pictures: Sequence[Image]) -> Image:
    """Lay pictures of one size in rows."""
    rows = []
    for first in range(0, len(pictures), COLUMNS):
        rows.append(np.hstack(pictures[first : first + COLUMNS]))

    return np.vstack(rows)


def _sample(file: Path, title: str) -> Iterator[Image]:
    """Yield pictures of a film at even distances in time, small, with a title."""
    with Pillow.open(file) as film:
        ends_ms = []
        frames = []
        for picture in ImageSequence.Iterator(film):
            frames.append(
                picture.convert("RGB").resize(FRAME, Pillow.Resampling.LANCZOS)
            )
            ends_ms.append(film.info["duration"])

    # The end is shown for long: here only until all others have come to theirs.
    times = np.cumsum([*ends_ms[:-1], 200])
    for instant in np.linspace(0, times[-1] - 1, STRIP_FRAMES):
        picture = frames[int(np.searchsorted(times, instant, side="right"))].copy()
        pen = ImageDraw.Draw(picture)
        pen.text((6, 4), title, fill=(40, 40, 40), font_size=15)
        yield np.asarray(picture)


def save_viewer(tasks: Sequence[str]) -> None:
    """Write a page on which the model's tools can be turned."""
    shown = []
    for task in tasks:
        entry = Entry(task, "model")
        tool = entry.read().tool
        assert isinstance(tool, Tool)
        robot = tool_part(entry.config()).create().robot
        shown.append(in_viewer(tool, robot, f"{task}: {tool.name}", "drag to turn it"))

    TOOLS.write_text(
        render("tools.html.j2", DESIGNS, shown, title="Tools of the gallery"),
        encoding="utf-8",
    )


def page_part(figures: dict[str, Any]) -> str:
    """Write the part of the page that is made of the figures."""
    tasks = sorted(figures)
    sections = [_section(task, figures[task]) for task in tasks]

    return "\n".join(
        [_overview(figures), _rounds(figures), _printed_table(figures), *sections]
    )


def _overview(figures: dict[str, Any]) -> str:
    """Write a table of all tasks: whether the model's tool does it, what it earns, and what others earn."""
    lines = [
        "| task | the model's tool | it earns | embedded designer | bare gripper |",
        "|---|---|---|---|---|",
    ]
    for task in sorted(figures):
        done = "works" if _is_done(figures[task]["model"]) else "**fails**"
        rewards = " | ".join(_span(figures[task].get(name)) for name in COMPARED)
        lines.append(f"| [{task}](#{task.lower()}) | {done} | {rewards} |")

    return "\n".join([*lines, ""])


def _rounds(figures: dict[str, Any]) -> str:
    """Write what the model made of feedback: the best design of each round, for the tasks that have several."""
    lines = [
        "## After feedback",
        "",
        "The two tools that failed went back to the model with what the program had observed, and nothing else.",
        "A model that had seen no other round answered each round with three designs; you see the best.",
        "Room is the least margin to a limit, in MuJoCo: 100 % is far from all of them, below 0 % one is exceeded.",
        "",
    ]
    for task in sorted(figures):
        if [*ROUNDS][-1] in figures[task]:
            lines += _evolution(task, figures[task])

    return "\n".join(lines)


def _evolution(task: str, figures: dict[str, Any]) -> list[str]:
    """Write a task's rounds side by side, and what the model says of each of its designs."""
    found = [figures[name] for name in ROUNDS]
    heads = " | ".join(ROUNDS.values())
    pictures = " | ".join(
        f"![the tool of {title}](images/gallery/{task}_{name}.webp)"
        for name, title in ROUNDS.items()
    )
    earned = " | ".join(f"{_span(round_)}" for round_ in found)
    rooms = " | ".join(f"{100 * round_['room']:.0f} %" for round_ in found)
    said = []
    later = [*zip(ROUNDS.values(), found, strict=True)][1:]
    for title, round_ in later:
        words = _first_sentences(round_["says"], 2)
        said += [f"> **{title}**: {words}", ">"]

    return [
        f"### {task}",
        "",
        f"| | {heads} |",
        "|---" * (1 + len(ROUNDS)) + "|",
        f"| tool | {pictures} |",
        f"| earns in three engines | {earned} |",
        f"| room | {rooms} |",
        "",
        *said[:-1],
        "",
        f"![{task} after two rounds of feedback](images/gallery/{task}_{[*ROUNDS][-1]}_film.webp)",
        "",
    ]


def _is_done(figures: dict[str, Any]) -> bool:
    """Report whether a design does its task in each engine."""
    return all(reward >= DONE for reward in figures["rewards"].values())


def _span(figures: dict[str, Any] | None) -> str:
    """Write the lowest and the highest reward of the engines; equal ones once."""
    if figures is None:
        return "–"

    rewards = figures["rewards"].values()
    low = number(min(rewards), 3)
    high = number(max(rewards), 3)

    return low if low == high else f"{low} to {high}"


def _verdict(figures: dict[str, Any]) -> str:
    """Say whether the model's tool does the task."""
    return "**Works.**" if _is_done(figures["model"]) else "**Fails.**"


def _section(task: str, figures: dict[str, Any]) -> str:
    """Write what a task asks, what the model says and does, and both tools side by side."""
    model = figures["model"]
    shown = [name for name in TITLES if name in figures and _is_drawn(task, name)]
    heads = [f"{TITLES[name]}: {_mass(figures[name])}" for name in shown]
    pictures = [_picture(task, name) for name in shown]
    lines = [
        f"## {task}",
        "",
        f"{GOALS[task]} {_verdict(figures)}",
        "",
        f"> {_first_sentences(model['says'], 1)}",
        "",
        f"![{task} with the model's tool](images/gallery/{task}.webp)",
        "",
        f"| {' | '.join(heads)} |",
        "|---" * len(shown) + "|",
        f"| {' | '.join(pictures)} |",
    ]

    return "\n".join([*lines, ""])


def _is_drawn(task: str, designer: str) -> bool:
    """Report whether there is a picture of a designer's tool."""
    return (PICTURES / f"{task}_{designer}.webp").exists()


def _picture(task: str, designer: str) -> str:
    """Show a tool."""
    return f"![{TITLES[designer]}'s tool](images/gallery/{task}_{designer}.webp)"


def _one_line(text: str) -> str:
    return re.sub(r"\s+", " ", text).replace("|", "/").replace("*", "")


def _first_sentences(text: str, count: int) -> str:
    """Return a text's first sentences in one line."""
    return " ".join(re.split(r"(?<=\.) (?=[A-Z])", _one_line(text))[:count])


def _mass(figures: dict[str, Any]) -> str:
    return f"{figures['mass_g']:.0f} g" if "mass_g" in figures else "–"


def _printed_table(figures: dict[str, Any]) -> str:
    """Write a table of the tools made of PLA: pieces, hours and grams of filament, and what they earn then."""
    heads = " | ".join(f"{title}: printing | it earns" for title in MADE.values())
    lines = [
        "## Printed in PLA",
        "",
        "Pieces, hours and grams of filament on a Prusa MK4, by PrusaSlicer, and the rewards in three engines when",
        "tools weigh and bend as PLA. The embedded designer knew the material: its tools come from runs with the",
        "defaults, in MuJoCo, and only those that their run called printable are here. The model did not: its tools",
        "that bend too far or break are refused. A tool that is too large has no pieces that fit the plate. A dash",
        "means that nothing was measured.",
        "",
        f"| task | {heads} |",
        "|---" * (1 + 2 * len(MADE)) + "|",
    ]
    for task in sorted(figures):
        cells = [task]
        for designer in MADE:
            cells += _print_cells(figures[task].get(designer, {}))
        lines.append(f"| {' | '.join(cells)} |")

    return "\n".join([*lines, ""])


def _print_cells(figures: dict[str, Any]) -> list[str]:
    """Say what printing a tool takes, and what it earns then; a dash where it was not measured."""
    takes = "–"
    if "hours" in figures:
        pieces = count_words(figures["pieces"], "piece")
        takes = f"{pieces}, {figures['hours']:.1f} h, {figures['grams']:.0f} g"
    elif figures.get("problem", "").startswith("fits the plate"):
        takes = "too large"

    if rejected := figures.get("rejected"):
        return [takes, "breaks" if "would break" in rejected else "bends too far"]

    rewards = figures.get("printed_rewards")
    return [takes, _span({"rewards": rewards}) if rewards else "–"]


def split_page(text: str) -> tuple[str, str, str]:
    """Split the page into what stands before its generated part, that part, and what stands after it."""
    before, _, rest = text.partition(BEGIN)
    middle, _, after = rest.partition(END)
    return before, middle, after


def write_page() -> None:
    """Write the page's generated part anew."""
    figures = json.loads(FIGURES.read_text("utf-8"))
    before, _, after = split_page(PAGE.read_text("utf-8"))
    made = page_part(figures)
    PAGE.write_text(f"{before}{BEGIN}\n{made}\n{END}{after}", encoding="utf-8")


def build(tasks: Sequence[str], designers: Sequence[str]) -> None:
    """Play, draw and write what the gallery shows of some tasks and designers."""
    figures: dict[str, Any] = {}
    if FIGURES.exists():
        figures = json.loads(FIGURES.read_text("utf-8"))

    for task in tasks:
        for entry in entries(task, designers):
            measured = measure(entry)
            figures.setdefault(task, {})[entry.designer] = measured
            text = json.dumps(figures, indent=1, sort_keys=True, ensure_ascii=False)
            FIGURES.write_text(text + "\n", encoding="utf-8")
            draw(entry)
            print(task, entry.designer, measured["rewards"], flush=True)

    if all((PICTURES / f"{task}.webp").exists() for task in STRIP):
        save_strip()
    save_viewer(sorted(figures))
    write_page()
