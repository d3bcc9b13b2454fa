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
from core.robot.tempo import plan_task_motion
from core.robot.trajectory import Motion
from core.simulation.pictures import report_missing, save_film

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

    whole = run.folder / "best"
    archive = run.folder / "archive"
    for old in (whole, archive):
        if old.is_symlink():
            old.unlink()
        shutil.rmtree(
            old, ignore_errors=True
        )  # a resumed run has those of an earlier end
    strategy.write_archive(result.ranking, run.representation, archive)

    several = len(run.task.parts) > 1
    if several:
        save_design(best.candidate, run.representation, whole)
    for task in run.task.parts:
        folder = whole / task.name if several else whole
        _save_motion(
            best.candidate.of(task.name),
            task,
            run,
            folder,
            film=film and result.stopped != INTERRUPTED,
        )


def _save_motion(
    candidate: Candidate, task: Task, run: Run, folder: Path, *, film: bool
) -> None:
    """Write a design with its plan for one task."""
    if candidate.problem is not None:
        report_missing(f"motion for {task.name}", UserError(candidate.problem))
        return

    plan = resolve(candidate.plan, task, run.seed, run.settings)
    motion = plan_task_motion(plan, task, run.settings)
    save_design(candidate, run.representation, folder)
    for export in installed().factories("export").values():
        export(candidate, task.robot, motion, folder)
    if film and run.simulator is not None:
        try:
            save_film(
                task,
                run.simulator,
                candidate,
                run.seed,
                run.settings,
                folder / "rollout.gif",
            )
        except RAISED as error:  # a film that fails costs the film, never the run
            report_missing("film", error)
