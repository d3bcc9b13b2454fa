"""Say what a run came to, on the terminal."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

from core.errors import UserError
from core.events import INTERRUPTED, Result, Run
from core.hooks import hookimpl
from core.store.rows import Best
from core.store.run_figures import best_figures
from core.support.cli import say
from core.support.text import clean, number

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
    """Print the best candidate of the run in a folder."""
    figures = [f"best reward {number(best.reward, 3)}"]
    if best.reason:
        figures[0] += f" ({best.reason})"
    figures += _warn_of_engine(best)
    figures += _warn_of_making(best)
    if best.distance_m is not None:  # of joined plans it is not known
        figures.append(f"distance {best.distance_m:.2f} m")

    figures.append(f"candidate {best.candidate}")
    say(", ".join(figures), str(folder / "best"))


def _warn_of_engine(best: Best) -> Iterator[str]:
    """Say what the best candidate earned in a second engine, where that differs much: one of the two may be wrong."""
    other = best.second_engine
    if other is None or abs(other.reward - other.here) <= DIFFERENT:
        return

    there = number(other.reward, 3)
    here = (
        "" if other.here == best.reward else f" where it earned {number(other.here, 3)}"
    )
    yield f"but {there} in {other.engine}{here}"


def _warn_of_making(best: Best) -> Iterator[str]:
    """Say why the tool of the best candidate can't be made, if so, and which candidate's can."""
    making = best.making
    if making is None or making.possible is not False:
        return

    problem = clean(making.problem, _LONGEST)
    other = f"; {best.makeable} can" if best.makeable else ""
    yield f"but it can't be built and run ({problem}{other})"


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
