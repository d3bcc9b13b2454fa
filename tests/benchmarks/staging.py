"""What does staged evaluation save, and does the same design win? ``python -m tests.benchmarks.staging [seeds=30]``.

For each seed the embedded designer makes a small population for one of ``tasks``. Every second tool with its plans is
made for a layout far from those in which all are tried, so that it misses. They are tried in layouts, once in full and
once in stages. Printed are, for each task, the winners that agree and the processor time of both.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import partial

from core.config.compose import load, node, part, task_part
from core.config.schemas import PromptConfig
from core.config.settings import Sampling
from core.design import Candidate, Evaluation, best_first
from core.designs.composer import PromptComposer
from core.interfaces import Budget, Fitness, RolloutSettings
from core.plugins import event_hub
from core.search.designer import make_designer
from core.simulation.rollout import Evaluator
from tests.benchmarks import measuring


@dataclass
class Settings:
    """``plans`` for each of ``tools``; the last four are settings of ``fitness=layouts``."""

    seeds: int = 30
    tasks: list[str] = field(default_factory=lambda: ["BringCube", "DislodgeCube", "HighObject"])
    sim: str = "mujoco"
    tools: int = 4
    plans: int = 2
    layouts: int = 3
    clearance: float | None = 0.05
    stop_below: float | None = None
    stop_first: float | None = 0.0


ELSEWHERE = 1000  # from a seed to that of the layout, drawn widely, for which every second tool is made


@dataclass(frozen=True)
class Measured:
    """Two searches of one population: processor seconds, trials that earned nothing, and whether their results agree.

    ``same`` is true if the same candidate wins with the same reward; ``rewards`` is how many differ.
    """

    task: str
    full_s: float
    staged_s: float
    missed: int
    trials: int
    saved: int
    same: bool
    rewards: int


def main() -> None:
    given = measuring.settings(sys.argv[1:], Settings)
    names = measuring.tasks(given.tasks)
    found = []
    for seed in range(given.seeds):
        found.append(measure(names[seed % len(names)], seed, given))
        sys.stderr.write(f"{found[-1]}\n")
    sys.stdout.write(table(found))


def table(found: Sequence[Measured]) -> str:
    """Write a row for each task, and one for all."""
    lines = [
        "| task | runs | same winner | rewards differ | trials that earn 0 | saved | full (s) | staged (s) | times |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in [*dict.fromkeys(one.task for one in found), "all"]:
        own = [one for one in found if name in (one.task, "all")]
        trials, full, staged = (sum(getattr(one, of) for one in own) for of in ("trials", "full_s", "staged_s"))
        missed, saved, rewards = (sum(getattr(one, of) for one in own) for of in ("missed", "saved", "rewards"))
        lines.append(
            f"| {name} | {len(own)} | {sum(one.same for one in own)} | {rewards} | {missed} of {trials} | {saved} | "
            f"{full:.1f} | {staged:.1f} | {full / staged:.2f} |"
        )
    return "\n".join(lines) + "\n"


def measure(task: str, seed: int, given: Settings) -> Measured:
    """Try one population in full and in stages; what the engine needs once is made before."""
    stages = {"clearance": given.clearance, "stop_below": given.stop_below, "stop_first": given.stop_first}
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
    make = partial(part("fitness", here.fitness).create, evaluator=evaluator)
    make().prepare()
    evaluator(candidates[:1])
    full, full_s = timed(make(), candidates)
    for name, value in stages.items():
        here.fitness[name] = value
    staged, staged_s = timed(part("fitness", here.fitness).create(evaluator=evaluator), candidates)
    trials = [reward for e in full for of in e.details.get("engines", {}).values() for reward in of["rewards"]]
    best, other = (next(iter(best_first(of)), None) for of in (full, staged))
    same = best is other or (best is not None and other is not None and best.candidate.id == other.candidate.id)
    differ = sum(abs(a.reward - b.reward) > 1e-9 for a, b in zip(full, staged, strict=True) if not b.stopped)
    saved = sum(e.details.get("saved", {}).get("rollouts", 0) for e in staged)
    return Measured(task, full_s, staged_s, trials.count(0.0), len(trials), saved, same, differ)


def timed(fitness: Fitness, candidates: Sequence[Candidate]) -> tuple[list[Evaluation], float]:
    """Evaluate candidates, and measure the processor time."""
    began = time.process_time()
    return fitness(candidates), time.process_time() - began


def population(cfg, evaluator: Evaluator) -> list[Candidate]:  # type: ignore[no-untyped-def]
    """Ask the embedded designer for a first generation."""
    task, representation = task_part(cfg).create(), part("tool", cfg.tool).create()
    representation.robot = task.robot
    designer = make_designer(
        task,
        evaluator.sim.create(),
        part("vlm", cfg.vlm).create(),
        representation,
        part("action", cfg.action).create(),
        PromptComposer(node(cfg.prompt, PromptConfig), evaluator.settings, cfg.sim.name),
        Budget(**{of.name: cfg.budget[of.name] for of in fields(Budget)}),
        seed=cfg.seed,
        sampling=node(cfg.sampling, Sampling),
        tool_kinds=("rigid",),
        events=event_hub(),
    )
    return [candidate for candidate in designer.design(0) if candidate.problem is None]


if __name__ == "__main__":
    main()
