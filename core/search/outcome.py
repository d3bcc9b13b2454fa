"""Say what a run came to, on the terminal."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from core.errors import UserError
from core.events import INTERRUPTED, Result, Run
from core.hooks import hookimpl
from core.store.rows import Best
from core.store.run_figures import best_figures
from core.support.cli import say
from core.support.templates import fill
from core.support.text import clean

_LONGEST = 300  # letters of why a tool can't be made
DIFFERENT = 0.1  # between the rewards of two engines: the user is told at once


def resume_hint(folder: Path) -> str:
    """Say what to type to resume the run."""
    return f"to go on: python -m core.run resume={shlex.quote(str(folder))}"


class Announcer:
    """A listener that prints the best candidate and its folder, before other listeners say more of it."""

    @hookimpl
    def run_finished(self, run: Run, result: Result) -> None:
        best = best_figures(result)
        if best is not None and result.stopped != INTERRUPTED:
            print_best(best, run.folder)
            sys.stdout.flush()


def print_best(best: Best, folder: Path) -> None:
    """Print the best candidate of the run in a folder, and what speaks against it.

    That is a second engine in which it earns much else, since one of the two may be wrong, and that its tool can't be
    made.
    """
    figures = fill(
        "core.search",
        "best",
        best=best,
        other=best.second_engine,
        different=DIFFERENT,
        making=best.making,
        problem=clean(best.making.problem, _LONGEST) if best.making else "",
    )
    say(figures, str(folder / "best"))


def report_end(result: Result, folder: Path) -> None:
    """Say why a run was stopped early, if it was.

    Raises:
        UserError: no candidate could be tried.
        KeyboardInterrupt: the run was interrupted.
    """
    if result.stopped == INTERRUPTED:
        raise KeyboardInterrupt(resume_hint(folder))

    if result.best is None:
        why = f"{result.stopped}; {resume_hint(folder)}"
        if result.stopped is None:
            reasons = (evaluation.reason for evaluation in result.evaluations)
            why = f"the first reason: {next(reasons, 'no candidate came')}"
        raise UserError(f"no candidate could be tried; {why}")

    if result.stopped is not None:
        say(f"stopped: {result.stopped}", resume_hint(folder), file=sys.stderr)
