"""Make entries of designs that no search found: ``python -m tests.benchmarks.given anchored|literal|bare|nothing``.

anchored: the reference solution of each task of HardToolBench; literal: the same tool with the waypoints that its plan
comes to in the nominal layout; bare: the bare hand, swept through what is to be moved, in the direction that
`tests.benchmarks.floor` found best; nothing: the bare hand, left where it is. Each is written as a reply of a mailbox,
and a run of one candidate tries it by the protocol. ``vlmgineer report FOLDER`` makes the results files.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from core.config.compose import load, task_part
from core.designs.reading import load_designs
from core.errors import UsageError
from core.interfaces import RolloutSettings, Waypoints
from core.plugins import installed
from core.support.cli import command
from plugins.fitness.layouts import UNSEEN
from tests.benchmarks import layouts, measuring
from tests.benchmarks.floor import DIRECTIONS, anchored, sweeps
from tests.benchmarks.layouts import HARD

USAGE = (
    "usage: python -m tests.benchmarks.given anchored|literal|bare|nothing [tasks=NAME,...] [folder=DIR] [floor=DIR]"
)
SMALLEST = [
    f"budget.{key}={value}" for key, value in {"n_agent": 1, "n_tool": 1, "n_action": 1, "n_iteration": 0}.items()
]
TEMPO = ("seconds", "speed", "through", "wait")


@dataclass
class Settings:
    """``floor``: the folder of `tests.benchmarks.floor`."""

    tasks: list[str] = field(default_factory=lambda: HARD)
    folder: str = "entries"
    floor: str = "floor"


def main() -> None:
    match sys.argv[1:]:
        case ["--help" | "-h"]:
            sys.stdout.write(f"{USAGE}\n")
        case [what, *words] if what in KINDS:
            given = measuring.settings(words, Settings)
            folder, answer = Path(given.folder) / what, KINDS[what]
            for name in measuring.tasks(given.tasks):
                box = (folder / "mailbox" / name / "g0-a0").resolve()
                box.mkdir(parents=True, exist_ok=True)
                (box / "reply.json").write_text(json.dumps({"strategies": [answer(name, Path(given.floor))]}))
                run = [f"task={name}", f"vlm.folder={box.parent}", f"hydra.run.dir={folder / name}", "film=false"]
                tool = "tool=boxes" if what in ("anchored", "literal") else "tool=none"
                words = ["protocol=varied", "sim=mujoco", "vlm=mailbox", "evolution=sampling", tool, *SMALLEST, *run]
                subprocess.run([sys.executable, "-m", "core.run", *words], check=False)  # one that fails scores 0
        case _:
            raise UsageError(USAGE)


def _reference(name: str, _: Path) -> dict[str, Any]:
    return dict(load_designs(layouts.SOLUTIONS[name])["strategies"][0])  # type: ignore[index]


def _literal(name: str, floor: Path) -> dict[str, Any]:
    written = _reference(name, floor)
    plan = layouts.designs(name, RolloutSettings(), "pla")["literal"].plan
    assert isinstance(plan, Waypoints)
    steps = zip(_dumped(plan), written["action_sets"][0], strict=True)
    return written | {"action_sets": [[step | {key: of[key] for key in TEMPO if key in of} for step, of in steps]]}


def _bare(name: str, floor: Path) -> dict[str, Any]:
    rewards = json.loads((floor / f"{name}.json").read_text())
    earned = [np.mean([of for key, of in rewards.items() if key.startswith(f"sweep {n} ")]) for n in range(DIRECTIONS)]
    task = task_part(load("evaluate", ["protocol=varied", f"task={name}"])).create()
    swept = sweeps(task, UNSEEN)[int(np.argmax(earned))]
    return {"action_sets": [anchored(swept, task, UNSEEN).plan.dump()]}


def _nothing(name: str, _: Path) -> dict[str, Any]:
    task = installed().create("task", name)
    row = [*task.home.position, *task.home.rpy, *([1.0] * (task.robot.gripper is not None))]
    return {"action_sets": [_dumped(Waypoints(np.array([row])))]}


def _dumped(plan: Waypoints) -> list[Any]:
    return installed().create("action", "anchored").dump(plan)


KINDS: dict[str, Callable[[str, Path], dict[str, Any]]] = {
    "anchored": _reference,
    "literal": _literal,
    "bare": _bare,
    "nothing": _nothing,
}


if __name__ == "__main__":
    command(lambda _: main())
