"""How good are strategies at equal cost? ``python -m tests.benchmarks.search methods=vlmgineer,refined seeds=10``.

Every method is run on every task with every seed: the same designer, and at most the same number of rollouts. Runs are
kept in ``folder``; what was stopped goes on where it was. , and
``vlmgineer report FOLDER`` shows all else: curves, intervals, task by task.
"""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from core.errors import choices
from core.support.cli import arguments, command
from plugins.results.pages.runs import find_runs
from plugins.results.report.learning_curves import ENOUGH, effort, read_course
from plugins.results.report.results import Results
from plugins.results.report.statistics import interquartile_mean, interval
from tests.benchmarks import measuring

USAGE = (
    "usage: python -m tests.benchmarks.search [methods=NAME,...] [tasks=NAME,...] [seeds=N] [agents=N] [layouts=N] "
    "[also=[WORD,...]] [workers=N] [folder=DIR]"
)
BASE = ["vlm=offline", "sim=mujoco", "budget=quick"]
VARIED = ["action=anchored", "task.variation=wide", "fitness=layouts", "fitness.unseen=0"]
QUIET = ["film=false", "listener=[]", "executor.workers=1"]
METHODS = {  # each tries 80 candidates for every agent
    "vlmgineer": lambda agents: [],
    "sampling": lambda agents: ["evolution=sampling"],
    "map_elites": lambda agents: ["evolution=map_elites", f"evolution.varied={10 * agents}", "budget.n_iteration=2"],
    "islands": lambda agents: ["evolution=islands"],
    "refined": lambda agents: ["budget.n_iteration=0", f"evolution.refine={60 * agents}"],
    "both": lambda agents: ["budget.n_iteration=1", f"evolution.refine={40 * agents}"],
}


@dataclass
class Settings:
    """``tasks``: names, or scene files. ``agents`` of each generation, with 20 candidates each. ``layouts``: of the
    fitness; 0: the nominal one. ``also``: further words of each run's command line.
    """

    methods: list[str] = field(default_factory=lambda: list(METHODS))
    tasks: list[str] = field(default_factory=lambda: ["DislodgeCube", "ElevatePlate", "HighObject"])
    seeds: int = 10
    agents: int = 4
    layouts: int = 3
    also: list[str] = field(default_factory=list)
    workers: int = 2
    folder: str = "search"


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    for method in given.methods:
        if method not in METHODS:
            raise choices("method", method, METHODS, "methods")
    folder, tasks = Path(given.folder), [name for name in given.tasks if name.endswith(".yaml")]
    tasks += measuring.tasks(given.tasks) if not tasks else []
    jobs = [(of, task, seed) for seed in range(given.seeds) for task in tasks for of in given.methods]
    with ThreadPoolExecutor(given.workers) as threads:
        for _ in threads.map(lambda job: run(*job, given), jobs):
            pass
    table = markdown({method: results(folder / method) for method in given.methods})
    sys.stdout.write(table)


def run(method: str, task: str, seed: int, given: Settings) -> None:
    """Run a method, or go on with its run; one that has come to its end is left alone."""
    folder = Path(given.folder) / method / f"{Path(task).stem}_{seed}"
    if (folder / "run.sqlite").exists():
        words = [f"resume={folder}"]
    else:
        own = ["task=file", f"task.file={Path(task).resolve()}"] if task.endswith(".yaml") else [f"task={task}"]
        own += [f"seed={seed}", f"hydra.run.dir={folder}"]
        own += [*VARIED, f"fitness.layouts={given.layouts}"] if given.layouts else []
        own += [f"budget.n_agent={given.agents}", *METHODS[method](given.agents)]
        words = [*BASE, *QUIET, *own, *given.also]
    subprocess.run([sys.executable, "-m", "core.run", *words], check=True, stdout=subprocess.DEVNULL)


def results(folder: Path) -> Results:
    """Read the runs of a method."""
    finished, left_out = find_runs([folder])
    return Results(tuple(finished), tuple(left_out))


def markdown(found: dict[str, Results]) -> str:
    """Format a row for each method: interquartile mean with its interval, that after the first sampling, the effort.

    ``gain`` is the interquartile mean of the differences from the first method, task by task and seed by seed.
    """
    tasks = sorted({run.task for of in found.values() for run in of.runs})
    head = "| method | runs | after the first sampling | at the end | 95 % interval | gain | 95 % interval |"
    rows = [
        f"{head} rollouts | reached {ENOUGH:g} | effort: rollouts | calls |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    rewards = [{(run.task, run.seed): run.best.reward for run in of.runs} for of in found.values()]
    for own, (method, of) in zip(rewards, found.items(), strict=True):
        pairs = own.keys() & rewards[0].keys()
        gains = [[own[pair] - rewards[0][pair] for pair in sorted(pairs) if pair[0] == task] for task in tasks]
        by_task = [[run.best.reward for run in of.runs if run.task == task] for task in tasks]
        courses = [course for run in of.runs if (course := read_course(run.folder)) is not None]
        first = interquartile_mean([run.best_so_far[0] for run in of.runs])
        reached, spent = effort(courses)
        rollouts, calls, _ = ("–" if x is None else f"{x:.0f}" for x in spent)
        gain = "– | –" if own is rewards[0] else with_interval(gains)
        rows.append(
            f"| {method} | {len(of.runs)} | {first:.3f} | {with_interval(by_task)} | {gain} | "
            f"{np.mean([course.rollouts[-1] for course in courses]):.0f} | {reached} | {rollouts} | {calls} |"
        )
    return "\n".join([*rows, ""])


def with_interval(tasks: list[list[float]]) -> str:
    """Format the interquartile mean and its interval as two cells."""
    span = interval(tasks, "interquartile mean")
    between = "–" if span is None else f"{span[0]:.3f} to {span[1]:.3f}"
    return f"{interquartile_mean(np.concatenate(tasks)):.3f} | {between}"


if __name__ == "__main__":
    command(lambda _: main())
