"""The ``progress`` listener: shows how far a generation is, and prints a line for each."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from core.hooks import hookimpl
from core.plugins import installed
from core.support.progress import Step, busy
from core.support.text import number, visible
from core.trial import Evaluation

if TYPE_CHECKING:
    from core.events import Generation, Result, Run


@hookimpl
def listeners() -> Mapping[str, Callable[..., Any]]:
    return {"progress": ProgressListener}


class ProgressListener:
    """Writes to standard error, so that standard output stays free for results."""

    def __init__(self) -> None:
        from rich.console import Console

        self._console = Console(stderr=True)
        self._open = ExitStack()
        self._step: Step | None = None
        self._population = 0
        self._name = ""
        self._count = 0
        self._best = 0.0

    @hookimpl
    def run_started(self, run: Run) -> None:
        self._population = run.budget.population
        parts = [
            f"{kind}={name}"
            for kind, name in run.parts.items()
            if kind not in ("fitness", "material")  # which need a word each
        ]
        self._print(f"{' '.join(parts)} seed={run.seed}", style="bold")
        self._print(f"model: {run.model}")
        self._print(_explain_fitness(run))
        self._print(_explain_material(run))

        generations = run.budget.n_iteration + 1
        size = f"{generations} generations of up to {self._population} candidates"
        refined = run.config.get("evolution", {}).get("refine", 0)
        if refined:
            size += f", then {refined} of refinement"
        self._print(size)
        self._print(f"folder: {run.folder}")

    @hookimpl
    def generation_started(self, index: int) -> None:
        self._count = 0
        self._best = 0.0
        self._step = self._open.enter_context(busy(f"generation {index}"))
        self._name = self._step.what

    @hookimpl
    def candidate_evaluated(self, evaluation: Evaluation) -> None:
        if self._step is not None:
            self._count += 1
            self._best = max(self._best, evaluation.reward)
            counts = f"{self._count}/{self._population}"
            self._step.what = f"{self._name}  {counts}  best {number(self._best, 3)}"

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        self._stop()
        rewards = "nothing could be tried"
        best = generation.best_reward
        mean = generation.mean_reward
        if best is not None and mean is not None:
            rewards = f"best {number(best, 3)}  mean {number(mean, 3)}"
        counts = f"{len(generation.evaluations)} candidates"

        for status in ("rejected", "failed"):
            count = generation.count(status)
            if count:
                counts += f", {count} {status}"

        self._print(f"generation {generation.index}  {rewards}  ({counts})")

    @hookimpl(tryfirst=True)
    def run_finished(self, run: Run, result: Result) -> None:
        self._stop()
        seconds = result.wall_time_s
        speed = f"{result.rollouts / seconds:.1f} per second"
        self._print(f"{result.rollouts} rollouts in {seconds:.0f} s, {speed}")

    @hookimpl
    def run_ended(self) -> None:
        self._stop()

    def _print(self, line: str, style: str | None = None) -> None:
        self._console.print(
            visible(line), style=style, markup=False, highlight=False, soft_wrap=True
        )

    def _stop(self) -> None:
        self._open.close()
        self._step = None


def _explain_fitness(run: Run) -> str:
    """Say what a candidate is judged by: the name of the fitness, and the first line that its plugin says of it."""
    name = run.parts["fitness"]
    said = inspect.getdoc(installed().factory("fitness", name)) or ""
    return f"fitness={name}: {said.partition(chr(10))[0]}"


def _explain_material(run: Run) -> str:
    """Say what tools are made of."""
    material = run.representation.material
    words = "no real one: tools weigh what their designs say, as in the paper"
    if material.density_kg_m3 is not None:
        words = f"{material.density_kg_m3:g} kg/m³, {material.filling}"

    return f"material={material.name}: {words}"
