"""Write the best design of a run to its folder: tool, motion, film."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from core.design import Candidate
from core.designs.planning import resolve
from core.designs.reading import save_design
from core.errors import RAISED, UserError
from core.events import INTERRUPTED, Result, Run
from core.interfaces import EvolutionStrategy, Robot, Task
from core.plugins import installed
from core.robot.trajectory import Motion, plan_task_motion
from core.simulation.pictures import filmed, report_missing, save_film
from core.support.progress import busy

Export = Callable[[Candidate, Robot, Motion, Path], None]
"""Writes files of a candidate to a folder that is there: of its tool, the arm, and the planned motion."""


def save_best(
    result: Result, run: Run, strategy: EvolutionStrategy, *, film: bool
) -> None:
    """Write the best design to ``best/``, with a film of its rollout unless the run was interrupted.

    What else a strategy hands over lies beside it (`core.interfaces.EvolutionStrategy.write_archive`).
    """
    best = result.best
    if best is None or run.simulator is None:
        return

    folder = run.folder / "best"
    archive = run.folder / "archive"
    _remove(folder)
    _remove(archive)
    strategy.write_archive(result.ranking, run.representation, archive)

    film = film and result.stopped != INTERRUPTED
    tasks = run.task.parts
    if len(tasks) == 1:
        _save_motion(best.candidate, tasks[0], run, folder, film=film)
        return

    save_design(best.candidate, run.representation, folder)
    for task in tasks:
        _save_motion(best.candidate, task, run, folder / task.name, film=film)


def _remove(folder: Path) -> None:
    """Remove what a resumed run left at an earlier end."""
    if folder.is_symlink():
        folder.unlink()
    shutil.rmtree(folder, ignore_errors=True)


def _save_motion(
    candidate: Candidate, task: Task, run: Run, folder: Path, *, film: bool
) -> None:
    """Write a design with its plan for a task."""
    candidate = candidate.of(task.name)
    if candidate.problem is not None:
        report_missing(f"motion for {task.name}", UserError(candidate.problem))
        return

    settings = run.settings
    plan = resolve(candidate.plan, task, run.seed, settings)
    motion = plan_task_motion(plan, task, settings)
    save_design(candidate, run.representation, folder)
    for export in installed().factories("export").values():
        export(candidate, task.robot, motion, folder)
    simulator = run.simulator
    if not film or simulator is None:
        return
    file = folder / "rollout.gif"

    try:
        with busy("drawing the film of the best design"):
            save_film(filmed(task, simulator, candidate, run.seed, settings), file)
    except RAISED as error:  # a film that fails costs the film, never the run
        report_missing("film", error)
