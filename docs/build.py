"""Makes what the pages show: ``python docs/build.py pictures``, ``diagrams``, ``notebook``, ``table`` (takes hours).

Pictures: of each task a still and a film of its reference solution, and a sheet of all stills. Diagrams: those of
``docs/diagrams.py``. Notebook: runs ``docs/example.ipynb`` and keeps what its cells show. Table: rewards of doing
nothing, of the reference solution, of the embedded designer and of the bare gripper, written into ``docs/tasks.md``.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from core.config.compose import load
from core.design import Candidate, Tool
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.search.orchestration import run
from core.simulation.pictures import save_film, save_picture
from core.simulation.rollout import evaluate_batch
from docs.diagrams import DRAWINGS

DOCS = Path(__file__).parent
IMAGES = DOCS / "images" / "tasks"
SOLUTIONS = DOCS.parent / "tests" / "tasks" / "solutions"
FILM_SIZE = (320, 240)
SHEET_COLUMNS = 3
ENOUGH = 0.99
BEGIN, END = "<!-- table -->", "<!-- end of table -->"


def reference(name: str) -> Candidate:
    """The reference solution of a task."""
    plugins = installed()
    spawn = SpawnRules(plugins.create("task", name), 0)
    document = load_designs(SOLUTIONS / f"{name}.json")
    return read_designs(document, plugins.create("tool", "urdf"), spawn)[0]


def pictures(names: list[str]) -> None:
    """Stills, films and the sheet."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    plugins = installed()
    simulator = plugins.create("sim", "pybullet")
    stills = []
    for name in names:
        task = plugins.create("task", name)
        still = simulator.render(task, tool=Tool())
        save_picture(still, IMAGES / f"{name}.png")
        stills.append(still)
        save_film(task, simulator, reference(name), 0, RolloutSettings(), IMAGES / f"{name}.gif", FILM_SIZE)
        print(name)
    save_picture(sheet(names, stills), IMAGES / "all.png")


def sheet(names: list[str], stills: list[Any]) -> Any:
    """Stills side by side, each with its name."""
    labelled = []
    for name, still in zip(names, stills, strict=True):
        small = Image.fromarray(still).resize(FILM_SIZE, Image.Resampling.LANCZOS)
        ImageDraw.Draw(small).text((8, 6), name, fill=(40, 40, 40), font_size=16)
        labelled.append(np.asarray(small))
    labelled += [np.full_like(labelled[0], 255)] * (-len(labelled) % SHEET_COLUMNS)
    rows = [np.hstack(labelled[i : i + SHEET_COLUMNS]) for i in range(0, len(labelled), SHEET_COLUMNS)]
    return np.vstack(rows)


def notebook(file: Path) -> None:
    """Run a notebook in an empty folder and write it back with its outputs."""
    import nbclient
    import nbformat

    document = nbformat.read(file, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        where = {"metadata": {"path": folder}}
        nbclient.NotebookClient(document, timeout=600, record_timing=False, resources=where).execute()
    for cell in document.cells:
        for output in cell.get("outputs", []):
            output.get("data", {}).pop("image/jpeg", None)  # Pillow offers it beside the PNG
    nbformat.write(document, file)


def best_by_generation(name: str, seed: int, *overrides: str) -> list[float]:
    """The best reward so far after each generation of a run that stops when it reaches `ENOUGH`."""
    words = [f"task={name}", f"seed={seed}", "film=false", "listener=[]", f"budget.stop_reward={ENOUGH}", *overrides]
    with tempfile.TemporaryDirectory() as folder:
        result = run(load("config", words), Path(folder))
    bests = [g.best_reward or 0.0 for g in result.generations]
    return np.maximum.accumulate(bests).tolist()


def row(name: str, seeds: list[int], gripper_seeds: list[int]) -> dict[str, Any]:
    """One task's figures. A run of eight generations begins as the run of four of its seed does: one gives both."""
    plugins = installed()
    task, simulator = plugins.create("task", name), plugins.create("sim", "pybullet")
    still = Candidate(Tool(), np.array([[*task.home.position, *task.home.rpy]]))
    nothing = evaluate_batch(task, simulator, [still], 0, RolloutSettings())[0].reward
    began = time.monotonic()
    solved = evaluate_batch(task, simulator, [reference(name)], 0, RolloutSettings())[0].reward
    took = time.monotonic() - began
    runs = [best_by_generation(name, seed, "budget.n_iteration=7") for seed in seeds]
    gripper = [best_by_generation(name, seed, "tool=none", "budget.n_action=20") for seed in gripper_seeds]
    return {
        "task": name,
        "nothing": nothing,
        "reference": solved,
        "first": [bests[0] for bests in runs],
        "designer": [bests[:4][-1] for bests in runs],
        "twice": [bests[-1] for bests in runs],
        "gripper": [bests[-1] for bests in gripper],
        "seconds": took,
    }


def table(names: list[str], seeds: list[int], gripper_seeds: list[int], output: Path) -> None:
    """Make the rows that ``output``, a JSON file, does not hold yet, and write all into the page."""
    rows = json.loads(output.read_text()) if output.exists() else []
    for name in names:
        if name not in {r["task"] for r in rows}:
            rows.append(row(name, seeds, gripper_seeds))
            print(json.dumps(rows[-1]), flush=True)
            output.write_text(json.dumps(rows, indent=1) + "\n")
    page = DOCS / "tasks.md"
    text = page.read_text()
    before, after = text[: text.index(BEGIN)], text[text.index(END) :]
    page.write_text(f"{before}{BEGIN}\n{markdown(sorted(rows, key=lambda r: r['task']))}{after}")


def markdown(rows: list[dict[str, Any]]) -> str:
    """The rows as a table; several runs as mean (smallest to largest)."""

    def runs(values: list[float]) -> str:
        return (
            f"{np.mean(values):.3f} ({min(values):.3f} to {max(values):.3f})" if len(values) > 1 else f"{values[0]:.3f}"
        )

    lines = [
        "| task | nothing | reference | first sampling | quick | twice | bare gripper | s per rollout |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        means = " | ".join(runs(r[key]) for key in ("first", "designer", "twice", "gripper"))
        lines.append(f"| {r['task']} | {r['nothing']:.3f} | {r['reference']:.3f} | {means} | {r['seconds']:.2f} |")
    means = " | ".join(
        f"{np.mean([np.mean(r[key]) for r in rows]):.3f}" for key in ("first", "designer", "twice", "gripper")
    )
    lines.append(f"| **mean** | | | {means} | |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["pictures", "diagrams", "notebook", "table"])
    parser.add_argument("--tasks", nargs="*", default=installed().names("task"))
    parser.add_argument("--seeds", nargs="*", type=int, default=[0, 1, 2])
    parser.add_argument("--gripper-seeds", nargs="*", type=int, default=[0, 1, 2])
    parser.add_argument("--output", type=Path, default=Path("table.json"))
    given = parser.parse_args()
    if given.what == "pictures":
        pictures(given.tasks)
    elif given.what == "diagrams":
        for name, draw in DRAWINGS.items():
            (DOCS / "images" / f"{name}.svg").write_text(draw(), encoding="utf-8")
    elif given.what == "notebook":
        notebook(DOCS / "example.ipynb")
    else:
        table(given.tasks, given.seeds, given.gripper_seeds, given.output)


if __name__ == "__main__":
    main()
