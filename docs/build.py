"""Make the contents of the pages: ``python docs/build.py pictures``, ``scene``, ``diagrams``, ``notebook``, ``strips``,
``tempo``, ``ladder``, ``gallery``.

Pictures: a still and a film of the reference solution for each task, and a sheet of all stills. Scene: the pictures of
``docs/writing_a_scene.md``, from the task in its code. Diagrams: those of ``docs/diagrams.py``. Notebook: runs
``docs/example.ipynb`` and keeps the outputs of its cells. Strips: a picture for each task of HardToolBench and
SoftToolBench, six instants of the reference solution. Tempo: peak speeds in a strike and a throw, for
``docs/plans.md``. Ladder: a scene of each family. Gallery: figures and pictures of ``docs/gallery.md``.
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import tempfile
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from core.design import Candidate, Tool
from core.designs.planning import resolve
from core.designs.reading import load_designs, read_designs
from core.interfaces import Perception, RolloutSettings
from core.plugins import installed
from core.robot.kinematics import arm_of
from core.robot.trajectory import plan_task_motion
from core.scene import Body, Box, Camera, Geom, Mesh, Pose, Scene
from core.simulation.pictures import filmed, save_film
from docs import gallery
from docs.diagrams import DRAWINGS
from plugins.fitness.layouts import UNSEEN
from plugins.vlms.context.strip import SIZE, draw_strip
from tasks.ladder.task import FAMILIES
from tests.plugins.actions.test_strike import Strike, swing
from tests.plugins.actions.test_throw import Throw, throw
from tests.support import solutions
from tests.support.panda import on_panda

DOCS = Path(__file__).parent
IMAGES = DOCS / "images" / "tasks"
SOLUTIONS = DOCS.parent / "tests" / "tasks" / "solutions"
FILM_SIZE = (320, 240)
SHEET_COLUMNS = 3
AWAY = (5.0, 5.0)  # x and y, far from the arm, where a body is drawn alone


def reference(name: str) -> Candidate:
    """Read the reference solution of a task."""
    plugins = installed()
    document = load_designs(SOLUTIONS / f"{name}.json")
    return read_designs(
        document, plugins.create("tool", "urdf"), plugins.create("task", name)
    )[0]


def pictures(names: list[str]) -> None:
    """Draw the stills, the films and the sheet."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    plugins = installed()
    simulator = plugins.create("sim", "pybullet")
    stills = []
    for name in names:
        task = plugins.create("task", name)
        still = simulator.render(task, tool=Tool())
        Image.fromarray(still).save(IMAGES / f"{name}.png")
        stills.append(still)
        film = filmed(task, simulator, reference(name), 0, RolloutSettings(), FILM_SIZE)
        save_film(film, IMAGES / f"{name}.gif")
        print(name)
    Image.fromarray(sheet(names, stills)).save(IMAGES / "all.png")


def sheet(names: list[str], stills: list[Any], columns: int = SHEET_COLUMNS) -> Any:
    """Place the stills side by side, each with its name."""
    labelled = []
    for name, still in zip(names, stills, strict=True):
        small = Image.fromarray(still).resize(FILM_SIZE, Image.Resampling.LANCZOS)
        ImageDraw.Draw(small).text((8, 6), name, fill=(40, 40, 40), font_size=16)
        labelled.append(np.asarray(small))
    labelled += [np.full_like(labelled[0], 255)] * (-len(labelled) % columns)
    rows = [
        np.hstack(labelled[i : i + columns]) for i in range(0, len(labelled), columns)
    ]
    return np.vstack(rows)


def ladder(file: Path) -> None:
    """Draw level 5 of each family of the ladder."""
    simulator = installed().create("sim", "pybullet")
    stills = []
    for family in FAMILIES:
        settings = {"family": family, "level": 5, "seed": 3}
        task = installed().create("task", "ladder", settings)
        stills.append(simulator.render(task, tool=Tool()))
    drawn = Image.fromarray(sheet([*FAMILIES], stills, columns=4))
    drawn.quantize(256).save(file, optimize=True)


def page_module(folder: Path) -> Any:
    """Import the first four blocks of code on the page about scenes as a module."""
    blocks = re.findall(
        r"```python\n(.*?)```", (DOCS / "writing_a_scene.md").read_text(), re.DOTALL
    )
    file = folder / "pull_tray.py"
    method = textwrap.indent(blocks[3], "    ")
    file.write_text("\n\n".join(blocks[:3]) + "\n" + method)
    spec = importlib.util.spec_from_file_location("pull_tray", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def scene(output: Path) -> None:
    """Draw the pictures of the page about scenes: the whole, a body's shapes, and three layouts."""
    output.mkdir(parents=True, exist_ok=True)
    simulator = installed().create("sim", "pybullet")
    with tempfile.TemporaryDirectory() as folder:
        module = page_module(Path(folder))
        task = module.PullTray()
        task.robot = installed().default_robot
        Image.fromarray(simulator.render(task, tool=Tool())).save(output / "scene.png")
        layouts = [simulator.render(task, seed=seed, tool=Tool()) for seed in (0, 2, 4)]
        Image.fromarray(sheet(["seed 0", "seed 2", "seed 4"], layouts)).save(
            output / "layouts.png"
        )
        tray = module.tray(*AWAY)
        camera = Camera(
            (AWAY[0] - 0.34, AWAY[1] - 0.26, 0.3), (AWAY[0] - 0.01, AWAY[1], 0.02), 48.0
        )
        views = []
        for body in (
            replace(tray, visuals=(*tray.visuals, *axes())),
            replace(tray, visuals=collision_shapes(tray)),
        ):
            own = {
                "scene": lambda self, seed, body=body: Scene((ground(), body)),
                "robot": task.robot,
            }
            alone = type("Alone", (module.PullTray,), own)
            views.append(simulator.render(alone(), tool=Tool(), camera=camera))
        Image.fromarray(sheet(["visuals", "collisions"], views, columns=2)).save(
            output / "shapes.png"
        )


def ground() -> Body:
    return Body.of(
        "ground",
        Box((2.0, 2.0, 0.02)),
        (*AWAY, -0.0101),
        mass=0.0,
        color=(0.86, 0.87, 0.88, 1.0),
    )


def axes(
    lengths: tuple[float, ...] = (0.26, 0.26, 0.15), width: float = 0.005
) -> list[Geom]:
    """Make the axes of a body's frame: x red, y green, z blue."""
    ways = np.diag(lengths)
    return [
        Geom(Box(tuple(way + width)), Pose(way / 2), (*np.sign(way), 1.0))
        for way in ways
    ]


def collision_shapes(body: Body) -> tuple[Geom, ...]:
    """Make the collision shapes of a body, each in its own colour."""
    colors = [
        (0.9, 0.6, 0.2),
        (0.3, 0.6, 0.85),
        (0.35, 0.7, 0.4),
        (0.85, 0.45, 0.5),
        (0.6, 0.5, 0.8),
        (0.5, 0.5, 0.5),
    ]
    return tuple(
        replace(
            geom,
            shape=Mesh.from_trimesh(geom.shape.to_trimesh().convex_hull)
            if isinstance(geom.shape, Mesh)
            else geom.shape,
            color=(*color, 1.0),
        )
        for geom, color in zip(body.collisions, colors, strict=True)
    )


def notebook(file: Path) -> None:
    """Run a notebook in an empty folder and write it back with its outputs."""
    import nbclient
    import nbformat

    document = nbformat.read(file, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        where = {"metadata": {"path": folder}}
        nbclient.NotebookClient(
            document, timeout=600, record_timing=False, resources=where
        ).execute()
    for cell in document.cells:
        for output in cell.get("outputs", []):
            # Pillow offers it beside the PNG.
            output.get("data", {}).pop("image/jpeg", None)
    nbformat.write(document, file)


def tempo(file: Path) -> None:
    """Draw the greatest speed of each joint in the swing of a strike and of a throw, with tempo and without."""
    import matplotlib.pyplot as plt

    plays = {
        "a strike": (on_panda(Strike()), swing),
        "a throw": (on_panda(Throw()), throw),
    }
    figure, panels = plt.subplots(
        1, 2, figsize=(8, 2.6), sharey=True, layout="constrained"
    )
    for axes, (what, (task, plan)) in zip(panels, plays.items(), strict=True):
        for fast, label, shift in (
            (True, "with tempo", -0.2),
            (False, "at rest at each waypoint", 0.2),
        ):
            waypoints = resolve(plan(tempo=fast), task, 0, RolloutSettings())
            motion = plan_task_motion(waypoints, task, RolloutSettings())
            times, arm = motion.trajectory.times, motion.trajectory.arm
            swing_only = times[1:] > motion.arrivals[-8]  # the last seven ways
            peaks = np.abs(np.diff(arm, axis=0) / np.diff(times)[:, None])[
                swing_only
            ].max(axis=0)
            axes.bar(
                np.arange(len(peaks)) + 1 + shift,
                peaks / arm_of(task.robot).velocity_limits,
                0.4,
                label=label,
            )
        axes.axhline(1.0, color="black", linewidth=0.8)
        axes.set(title=what, xlabel="joint")
    panels[0].set_ylabel("peak speed / limit")
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=2,
        frameon=False,
    )
    figure.savefig(file)


def tasks_of(plugin: str) -> list[str]:
    """List the tasks that a plugin offers."""
    return [
        name
        for (kind, name), of in installed().offers.items()
        if kind == "task" and of.entry_point == plugin
    ]


def strips(names: list[str]) -> None:
    """Draw the reference solutions of HardToolBench and SoftToolBench in a layout of the test."""
    simulator, settings = (
        installed().create("sim", "mujoco"),
        RolloutSettings(perception=Perception(0.002, 0.01)),
    )
    for name in names:
        task = installed().create("task", name, variation="wide")
        candidate = solutions.anchored(name, "pla")
        film = filmed(task, simulator, candidate, UNSEEN, settings, SIZE)
        Image.fromarray(draw_strip(film.recording, film.draw)).quantize(128).save(
            IMAGES / f"{name}.png", optimize=True
        )
        print(name, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "what",
        choices=[
            "pictures",
            "scene",
            "diagrams",
            "notebook",
            "strips",
            "tempo",
            "ladder",
            "gallery",
        ],
    )
    parser.add_argument("--tasks", nargs="*")
    parser.add_argument("--designers", nargs="*", help="of the gallery")
    given = parser.parse_args()
    if given.what == "pictures":
        pictures(given.tasks or tasks_of("robotoolbench"))
    elif given.what == "strips":
        strips(given.tasks or [*tasks_of("hardtoolbench"), *tasks_of("softtoolbench")])
    elif given.what == "scene":
        scene(DOCS / "images" / "scene")
    elif given.what == "diagrams":
        for name, draw in DRAWINGS.items():
            (DOCS / "images" / f"{name}.svg").write_text(draw(), encoding="utf-8")
    elif given.what == "gallery":
        tasks = given.tasks or tasks_of("robotoolbench")
        gallery.build(tasks, given.designers or [*gallery.DESIGNERS])
    elif given.what == "ladder":
        ladder(DOCS / "images" / "ladder.png")
    elif given.what == "tempo":
        tempo(DOCS / "images" / "tempo.png")
    else:
        notebook(DOCS / "example.ipynb")


if __name__ == "__main__":
    main()
