"""Run what a study lacks: each run in a process of its own, some side by side, with a line for each."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path

from core.config.gate import choose_again
from core.support.cli import say
from core.support.files import read_text
from core.support.interrupts import check_interrupt
from core.support.progress_display import busy
from core.support.text import clean, hydra_word, number
from plugins.results.pages.runs import AnyRun, FinishedRun, is_held
from plugins.results.study.study_files import (
    StudyRun,
    is_done,
    list_repeated,
    read_state,
)

LOOK_S = 0.5  # between two looks at a run of another process
MOST_LOG = 1_000_000_000  # bytes
MOST_FAILURES = 3  # one after the other, until no further run starts


@dataclass(eq=False)
class Runner:
    """Runs what is missing. A killed study leaves runs that go on alone: the next one waits for them.

    Args:
        runs: that are missing.
        jobs: how many run at a time.
        launch: words before the command of each run, such as those of ``srun``.
    """

    runs: Sequence[StudyRun]
    jobs: int = 1
    launch: Sequence[str] = ()
    _processes: set[subprocess.Popen[bytes]] = field(default_factory=set)
    _stopping: threading.Event = field(default_factory=threading.Event)

    def run_all(self) -> list[str]:
        """Run all, and return which failed, and why.

        Raises:
            KeyboardInterrupt: it was interrupted; the runs under way have stopped, and can go on.
        """
        failures: list[str] = []
        in_a_row = 0
        with busy("runs") as step, ThreadPoolExecutor(self.jobs) as pool:
            futures = {pool.submit(self.finish, run): run for run in self.runs}
            try:
                for count, future in enumerate(as_completed(futures), 1):
                    check_interrupt()
                    run = futures[future]
                    reason = future.result()
                    if reason is None:
                        continue

                    in_a_row = in_a_row + 1 if reason else 0
                    if reason:
                        failures.append(f"{run}: {reason}")
                    if in_a_row >= MOST_FAILURES:
                        self._stopping.set()

                    step.what = f"{count}/{len(futures)} runs"
                    came_to = clean(reason or _describe(run), 1000)
                    say(f"{step.what}  {run}: {came_to}", file=sys.stderr)
            except KeyboardInterrupt:
                self.interrupt()
                raise

        return failures

    def finish(self, run: StudyRun) -> str | None:
        """Bring a run to its end; return why it failed, empty: it did not. None: it was not begun."""
        while not self._stopping.is_set():
            state = read_state(run)
            if is_done(state):
                return ""
            if is_held(run.folder):  # by what an ended study left, or by another one
                time.sleep(LOOK_S)
                continue

            status = self._start(run, state)
            state = read_state(run)
            if is_done(state):
                return ""
            if not is_held(run.folder):
                return _explain(run, state, status)

        return None

    def _start(self, run: StudyRun, state: AnyRun | None) -> int:
        """Start a run or go on with it, and wait for its end; return the exit status."""
        words = [*run.words, f"hydra.run.dir={hydra_word(str(run.folder))}"]
        if state is not None:
            repeated = list_repeated(run.words)
            repeated += choose_again(
                state.config, [w for w in run.words if w not in repeated]
            )
            words = [f"resume={run.folder}", *repeated]

        run.folder.parent.mkdir(parents=True, exist_ok=True)

        with _log(run).open("ab") as log:
            process = subprocess.Popen(  # noqa: S603
                [*self.launch, sys.executable, "-m", "core.run", *words],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,  # an interrupt reaches it once, from here
            )
            self._processes.add(process)
            try:
                return process.wait()
            finally:
                self._processes.discard(process)

    def interrupt(self) -> None:
        """Let no run begin, and stop those under way."""
        self._stopping.set()
        for process in list(self._processes):
            process.send_signal(signal.SIGINT)


def _describe(run: StudyRun) -> str:
    """Say what a run came to."""
    state = read_state(run)
    if not isinstance(state, FinishedRun):
        return "no candidate could be tried"

    return f"{number(state.best.reward, 3)}  ({state.figures.wall_time_s:.0f} s)"


def _log(run: StudyRun) -> Path:
    return run.folder.with_suffix(".log")


def _explain(run: StudyRun, state: AnyRun | None, status: int) -> str:
    """Say why a run ended before its end, by the last line that it printed."""
    lines = read_text(_log(run), most=MOST_LOG).split("\n")
    printed = [line for line in lines if line.strip()]
    last = printed[-1] if printed else f"it ended with status {status}"
    reason = str(getattr(state, "reason", "")) if status == 0 else last
    return f"{reason or last}; all that it printed is in {_log(run)}"
