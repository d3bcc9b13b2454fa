"""Say on standard error what takes long: the one progress display of all commands.

A command turns it on with `show_progress`; else nothing is said. What is being done is said once nothing was said for a
while, and again ever more rarely. Where it has not changed since, the time that it has taken stands behind it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

FIRST_S = 3.0  # so long nothing is said
PAUSE_S = 1.0  # steps that follow each other sooner are one piece of work
LOOK_S = 0.2


@dataclass(eq=False)
class Step:
    """Something that takes a while: ``what`` is being done, such as ``reading cup.obj``; it may change meanwhile."""

    what: str
    first_s: float = 0.0  # 0: as long as for others


_steps = list[Step]()
_notes = dict[str, str]()


@contextmanager
def busy(what: str, first_s: float = 0.0) -> Iterator[Step]:
    """Say what is being done, if it lasts; ``first_s``: how long, if not as for other steps."""
    step = Step(what, first_s)
    _steps.append(step)
    try:
        yield step
    finally:
        _steps.remove(step)


def note(name: str, text: str) -> None:
    """Say beside what is being done what else goes on, such as an answer that arrives.

    Args:
        name: of what says it; its last note counts.
        text: a few words; empty: nothing goes on any more.
    """
    if text:
        _notes[name] = text
    else:
        _notes.pop(name, None)


def find_step() -> str:
    """Return what is being done, the last that began, for another thread to say; empty: nothing that takes long."""
    return next((step.what for step in reversed(_steps.copy())), "")


def show_progress(say: Callable[[str], None]) -> None:
    """Say from now on what takes long; ``say`` prints a line on standard error."""
    threading.Thread(target=_watch, args=(say,), daemon=True).start()


def _watch(say: Callable[[str], None]) -> None:
    """Look now and then at what is being done last, and say it when it is due."""
    wait_s = FIRST_S
    began = 0.0
    worked = 0.0
    due = 0.0
    last = ""
    while True:
        time.sleep(LOOK_S)
        now = time.monotonic()
        for step in _steps[-1:]:
            if now > worked + PAUSE_S:
                wait_s = step.first_s or FIRST_S
                due = now + wait_s
                began = now
                last = ""
            worked = now
            if now >= due:
                said = "  ".join([step.what, *_notes.copy().values()])
                so_far = f" {now - began:.0f} s" if said == last else ""
                say(f"{said} ...{so_far}")
                last = said
                wait_s *= 2
                due = now + wait_s
