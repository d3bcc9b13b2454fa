"""What does staged evaluation save, and does the same design win? ``python -m tests.benchmarks.staging [seeds=30]``.

For each seed the embedded designer makes a small population for one of ``tasks``. Every second tool with its plans is
made for a layout far from those in which all are tried, so that it misses. They are tried in layouts, once in full and
once in stages. Printed are, for each task, the winners that agree, how many of the five best of all were tried to the
end, and the processor time of both.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

from core.config.compose import load, node, part, task_part
from core.config.schemas import PromptConfig
from core.config.settings import Sampling
from core.design import Candidate, Evaluation, best_first
from core.designs.composer import PromptComposer
from core.interfaces import Budget, Fitness, RolloutSettings
from core.plugins import event_hub
from core.search.designer import Assignment, make_designer
from core.search.evolution import evaluate_all
from core.simulation.rollout import Evaluator
from tests.benchmarks import measuring
from tests.example_plugin.toybench.here import Here


@dataclass
class Settings:
    """``plans`` for each of ``tools``; ``first`` of the ``seeds``; the others are settings of ``fitness=layouts``."""

    seeds: int = 30
    tasks: list[str] = field(default_factory=lambda: ["BringCube", "DislodgeCube", "HighObject"])
    sim: str = "mujoco"
    tools: int = 4
    plans: int = 2
    layouts: int = 3
    stop_below: float | None = None
    stop_behind: float | None = 1.5
    first: int = 0


TOP = 5  # as many as `Budget.k_top` by default
ELSEWHERE = 1000  # from a seed to that of the layout, drawn widely, for which every second tool is made


@dataclass(frozen=True)
class Measured:
    """Two searches of one population: processor seconds, trials that earned nothing, and whether their results agree.

    ``same`` is true if the same candidate wins with the same reward; ``top`` is how many of the five best were tried to
    the end; ``rewards`` is how many differ.
    """

    task: str
    full_s: float
    staged_s: float
    missed: int
    trials: int
    saved: int
    same: bool
    top: int
    rewards: int


def main() -> None:
    given = measuring.settings(sys.argv[1:], Settings)
    names = measuring.tasks(given.tasks)
    found = []
    for seed in range(given.first, given.first + given.seeds):
        found.append(measure(names[seed % len(names)], seed, given))
        sys.stderr.write(f"{found[-1]}\n")
    sys.stdout.write(table(found))


def table(found: Sequence[Measured]) -> str:
    """Write a row for each task, and one for all."""
    lines = [
        f"| task | runs | same winner | of the {TOP} best | rewards differ | trials that earn 0 | saved "
        "| full (s) | staged (s) | times |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name in [*dict.fromkeys(one.task for one in found), "all"]:
        own = [one for one in found if name in (one.task, "all")]

        def total(of: str, own: Sequence[Measured] = own) -> Any:
            return sum(getattr(one, of) for one in own)

        full, staged = total("full_s"), total("staged_s")
        lines.append(
            f"| {name} | {len(own)} | {total('same')} | {total('top')} of {TOP * len(own)} | {total('rewards')} "
            f"| {total('missed')} of {total('trials')} | {total('saved')} "
            f"| {full:.1f} | {staged:.1f} | {full / staged:.2f} |"
        )
    return "\n".join(lines) + "\n"


def measure(task: str, seed: int, given: Settings) -> Measured:
    """Try one population in full and in stages; what the engine needs once is made before."""
    stages = {"stop_below": given.stop_below, "stop_behind": given.stop_behind}
    words = [
        f"task={task}",
        f"sim={given.sim}",
        "fitness=layouts",
        f"fitness.layouts={given.layouts}",
        "prompt.views=[]",
    ]
    words += [f"budget.{name}={n}" for name, n in (("n_agent", 1), ("n_tool", given.tools), ("n_action", given.plans))]
    here, elsewhere = (
        load("config", [*words, f"task.variation={variation}", f"seed={of}"])
        for variation, of in (("near", seed), ("wide", seed + ELSEWHERE))
    )
    evaluator = Evaluator(task_part(here), part("sim", here.sim), seed, node(here.rollout, RolloutSettings))
    candidates = [of for of in population(here, evaluator) if of.strategy % 2 == 0]
    candidates += [of for of in population(elsewhere, evaluator) if of.strategy % 2]
    in_full = part("fitness", here.fitness).create(evaluator=evaluator)
    here.fitness.update(stages)
    in_stages = part("fitness", here.fitness).create(evaluator=evaluator)
    for fitness in (in_full, in_stages):
        fitness(candidates[:1])
    full, full_s = timed(in_full, candidates)
    staged, staged_s = timed(in_stages, candidates)
    trials = [trial.reward for e in full for trial in e.trials]
    best, other = (next(iter(best_first(of)), None) for of in (full, staged))
    same = best is other or (best is not None and other is not None and best.candidate.id == other.candidate.id)
    ended = {e.candidate.id for e in staged if not e.stopped}
    top = sum(e.candidate.id in ended for e in sorted(full, key=lambda e: -e.reward)[:TOP])
    differ = sum(abs(a.reward - b.reward) > 1e-9 for a, b in zip(full, staged, strict=True) if not b.stopped)
    saved = sum(e.unneeded for e in staged)
    return Measured(task, full_s, staged_s, trials.count(0.0), len(trials), saved, same, top, differ)


def timed(fitness: Fitness, candidates: Sequence[Candidate]) -> tuple[list[Evaluation], float]:
    """Evaluate candidates as a run does, in this process, and measure the processor time."""
    began = time.process_time()
    found = list(evaluate_all(candidates, fitness, Here()))
    return sorted(found, key=lambda e: e.candidate.key), time.process_time() - began


def population(cfg, evaluator: Evaluator) -> list[Candidate]:  # type: ignore[no-untyped-def]
    """Ask the embedded designer for a first generation."""
    task, representation = task_part(cfg).create(), part("tool", cfg.tool).create()
    representation.robot = task.robot
    budget = Budget(**{field.name: cfg.budget[field.name] for field in fields(Budget)})
    prompts = PromptComposer(node(cfg.prompt, PromptConfig), evaluator.settings, cfg.sim.name)
    designer = make_designer(
        Assignment(task, representation, part("action", cfg.action).create(), budget, cfg.seed),
        evaluator.sim.create(),
        part("vlm", cfg.vlm).create(),
        prompts,
        node(cfg.sampling, Sampling),
        event_hub(),
    )
    return [candidate for candidate in designer.design(0) if candidate.problem is None]


if __name__ == "__main__":
    main()
