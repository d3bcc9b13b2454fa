"""Say what a run came to, on the terminal."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from core.errors import UserError
from core.events import INTERRUPTED, Result
from core.store.figures import best_figures, unseen_figures
from core.store.rows import Best, Unseen
from core.support.cli import say


def resume_hint(folder: Path) -> str:
    """Say what to type to resume the run."""
    return f"to go on: python -m core.run resume={shlex.quote(str(folder))}"


def print_outcome(result: Result, folder: Path) -> None:
    """Print the best candidate of a run, and why the run was stopped early, if it was.

    Raises:
        UserError: no candidate could be tried.
        KeyboardInterrupt: the run was interrupted.
    """
    if result.stopped == INTERRUPTED:
        raise KeyboardInterrupt(resume_hint(folder))
    if result.best is None and result.stopped is not None:
        raise UserError(
            f"no candidate could be tried: {result.stopped}; {resume_hint(folder)}"
        )

    why = "no candidate came"
    if result.evaluations:
        why = result.evaluations[0].reason
    print_best(best_figures(result), folder, why, unseen_figures(result))
    if result.stopped is not None:
        say(f"stopped: {result.stopped}", resume_hint(folder), file=sys.stderr)


def print_best(
    best: Best | None,
    folder: Path,
    why: str = "",
    unseen: Unseen | None = None,
) -> None:
    """Print the best candidate and what it earned in unseen layouts.

    Raises:
        UserError: there is none.
    """
    if best is None:
        reason = f"; the first reason: {why}" if why else ""
        raise UserError(f"no candidate could be tried{reason}")

    figures = [f"best reward {best.reward:.3f}"]
    if best.distance_m is not None:  # of joined plans it is not known
        figures.append(f"distance {best.distance_m:.2f} m")
    if unseen is not None:
        mean = f"mean {unseen.mean:.3f}, worst {unseen.worst:.3f}"
        figures.append(f"in {unseen.layouts} unseen layouts {mean}")

    figures.append(f"candidate {best.candidate}")
    say(", ".join(figures), str(folder / "best"))
