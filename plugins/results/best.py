"""Write the best design of a run to its folder: tool, motion, film."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

from core.design import Candidate
from core.designs.planning import resolve
from core.errors import UserError
from core.events import INTERRUPTED, Result, Run
from core.interfaces import EvolutionStrategy, Felt, Looked, Task
from core.robot.trajectory import plan_task_motion
from core.simulation.pictures import report_missing, write_film
from plugins.results.artifacts import save_design, save_files
from plugins.results.pages.runs import EVENTS


def save_best(result: Result, run: Run, strategy: EvolutionStrategy) -> None:
    """Write the best design to ``best/``, and what the strategy hands over beside it to ``archive/``.

    With the setting ``film`` there is a film of its rollout, unless the run was interrupted.
    """
    best = result.best
    if best is None or run.simulator is None:
        return

    folder = run.folder / "best"
    archive = run.folder / "archive"
    _remove(folder)
    _remove(archive)
    strategy.write_archive(result.ranking, run.representation, archive)

    tasks = run.task.parts
    several = len(tasks) > 1
    if several:
        save_design(best.candidate, run.representation, folder)

    filming = run.config.get("film", True) and result.stopped != INTERRUPTED
    for task in tasks:
        candidate = best.candidate.of(task.name)
        if candidate.problem is not None:
            report_missing(f"motion for {task.name}", UserError(candidate.problem))
            continue

        place = folder / task.name if several else folder
        _save_motion(candidate, task, run, place)
        if filming:
            file = place / "rollout.gif"
            film = write_film(
                task, run.simulator, candidate, run.seed, run.settings, file
            )
            save_events(film.happened if film else (), place)


def _remove(folder: Path) -> None:
    """Remove what a resumed run left at an earlier end."""
    if folder.is_symlink():
        folder.unlink()
    shutil.rmtree(folder, ignore_errors=True)


def _save_motion(candidate: Candidate, task: Task, run: Run, folder: Path) -> None:
    """Write a design with its plan for a task."""
    plan = resolve(candidate.plan, task, run.seed, run.settings)
    motion = plan_task_motion(plan, task, run.settings)
    save_design(candidate, run.representation, folder)
    assert candidate.tool is not None
    save_files(candidate.tool, task.robot, motion, folder)


def save_events(happened: Iterable[Felt | Looked], folder: Path) -> None:
    """Write what a film says on its way, a line for each look and guard; no file where there was none."""
    lines = [f"{event}\n" for event in happened]
    if lines:
        (folder / EVENTS).write_text("".join(lines), encoding="utf-8")
