"""Receives the events of a run and records them for Rerun. No failure in here reaches the run."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from pydantic import Field, FiniteFloat

from core.errors import in_line
from core.hooks import hookimpl
from core.support.cli import say
from core.support.progress_display import busy
from core.trial import best_tools

if TYPE_CHECKING:
    from core.events import Generation, Run
    from plugins.listeners.rerun.writer import Writer


class RerunListener:
    """Records a run in ``recording.rrd`` in its folder: of each generation the rollout of its best tool.

    Of several tasks each has a file ``recording_TASK.rrd``. The first failure is reported in one line and ends the
    recording.

    Args:
        hz: frames per simulated second.
    """

    def __init__(self, hz: Annotated[FiniteFloat, Field(gt=0)] = 25.0) -> None:
        self._hz = hz
        self._writers: list[Writer] = []

    @hookimpl
    def run_started(self, run: Run) -> None:
        self._attempt(self._open, run)

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        for writer in list(self._writers):
            self._attempt(self._record, generation, writer)

    @hookimpl
    def run_ended(self) -> None:
        for writer in self._writers:
            writer.close()

    def _open(self, run: Run) -> None:
        # Or Rerun logs to the terminal; what fails is raised as well.
        os.environ.setdefault("RUST_LOG", "off")
        # Rerun takes a third of a second to import, so only now.
        from plugins.listeners.rerun.writer import Writer

        for task in run.task.parts:
            name = "recording" if task is run.task else f"recording_{task.name}"
            of_task = replace(run, task=task)
            writer = Writer(of_task, run.folder / f"{name}.rrd")
            self._writers.append(writer)
            writer.begin()

    def _record(self, generation: Generation, writer: Writer) -> None:
        writer.generation(generation)
        for best in best_tools(generation.ranking)[:1]:
            evaluation = best.in_task(writer.task.name)
            if evaluation.candidate.problem is None:
                writer.rollout(generation.index, evaluation, self._hz)

    def _attempt(self, function: Callable[..., None], *arguments: object) -> None:
        try:
            with busy("writing the recording"):
                function(*arguments)
        except Exception as error:  # from Rerun or the disk
            self.run_ended()
            self._writers = []
            why = in_line(error)
            if isinstance(error, ModuleNotFoundError) and error.name == "rerun":
                why = "Rerun is not installed (pip install rerun-sdk)"

            say(f"rerun: no recording from here on: {why}", file=sys.stderr)
