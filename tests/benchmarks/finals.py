"""How well is a winner chosen? ``python -m tests.benchmarks.finals folder=FOLDER tasks=BringCube seeds=0,1``.

Of each task and seed the embedded designer makes a search. Then each rule chooses a winner, which 20 unseen layouts
judge: the rule before, twelve by the shortest way in eight layouts, and the race with several budgets. Trials stay in
FOLDER, and none is played twice. It prints a table of all in FOLDER, and writes ``finals.svg`` there.
"""

from __future__ import annotations

import json
import pickle
from dataclasses import asdict, dataclass, field, replace
from itertools import islice
from pathlib import Path
from statistics import fmean

from matplotlib.figure import Figure

from core.config.compose import load
from core.interfaces import Evaluation, Trial
from core.plugins import event_hub
from core.search.evolution import evolve
from core.search.finalists import MOST, RACED, FinalRace, pick
from core.search.orchestration import PER_S
from core.search.setup import build_search
from core.search.trials import Trials
from core.support.cli import arguments, command, print_table
from core.trial import Tally, TrialKey
from tests.benchmarks import measuring
from tests.executors import Inline

USAGE = "usage: python -m tests.benchmarks.finals [folder=FOLDER] [tasks=NAME,NAME] [seeds=0,1]"

WORDS = [
    "protocol=varied",
    "sim=mujoco",
    "fitness.unseen_sims=[]",
    "budget.n_agent=1",
    "budget.n_tool=3",
    "budget.n_action=3",
    "budget.n_iteration=1",
    "listener=[]",
    "prompt.picture=false",
]
BUDGETS_S = (5, 20, 60, 240)
GOOD = 0.9
BEFORE_FINALISTS = (
    12  # candidates that were finalists before: those with the shortest way
)
BEFORE_LAYOUTS = 8  # layouts that they were tried in


@dataclass
class Settings:
    """What is measured."""

    folder: str = "finals"
    tasks: list[str] = field(default_factory=list)
    seeds: list[int] = field(default_factory=lambda: [0])


@dataclass
class Choice:
    """What a rule came to.

    Attributes:
        rollouts: that it asks for.
        mean: of the winner's rewards in the unseen layouts.
        worst: of these.
    """

    rollouts: int
    mean: float
    worst: float


class Pool:
    """A search, and the trials of its candidates.

    Args:
        file: of the trials.
        task: the task's name.
        seed: of the search.
    """

    def __init__(self, file: Path, task: str, seed: int) -> None:
        self.file = file
        self.known: dict[TrialKey, Trial] = {}
        if file.exists():
            self.known = pickle.loads(file.read_bytes())
        self.trials = Trials(Inline(), known=self.known)
        words = [*WORDS, f"task={task}", f"seed={seed}"]
        search = build_search(load("config", words), file.parent, {})
        self.fitness = search.fitness
        self.result = evolve(
            search.strategy,
            search.fitness,
            self.trials,
            search.run.budget,
            search.events,
            search.run.task.robot,
        )
        self.keep()
        if self.result.stopped:
            raise KeyboardInterrupt
        self.ranking = self.result.ranking

    def keep(self) -> None:
        """Write the trials, so that the file is whole or absent."""
        new = self.file.with_suffix(".new")
        new.write_bytes(pickle.dumps(self.known))
        new.replace(self.file)

    def choose_before(self) -> Choice:
        """Choose as before: of few within the tie, by the shortest way, in eight layouts."""
        alike = self.earn_alike()[:BEFORE_FINALISTS]
        layouts = islice(self.fitness.finals(), BEFORE_LAYOUTS)
        conditions = [condition for layout in layouts for condition in layout]
        tried = self.trials.try_in(conditions, [e.candidate for e in alike])
        means = {
            candidate.id: fmean(trial.reward for trial in trials)
            for candidate, trials in tried
        }
        least = max(means.values()) - self.result.tie
        winner = next(e for e in alike if means[e.candidate.id] >= least)
        return self.judge(winner, len(conditions) * len(alike))

    def earn_alike(self) -> list[Evaluation]:
        """Return those within the tie of the highest reward, of equal designs one, those with the shorter way first."""
        least = max(e.reward for e in self.ranking) - self.result.tie
        alike: dict[str, Evaluation] = {}
        for evaluation in self.ranking:
            if evaluation.reward >= least:
                alike.setdefault(evaluation.candidate.content, evaluation)
        return list(alike.values())

    def choose(self, seconds: float) -> Choice:
        """Choose by the race, with a budget."""
        ranking = [
            replace(evaluation, finals=Tally()) for evaluation in self.earn_alike()
        ]
        race = FinalRace(self.fitness, self.trials, event_hub(), self.result.tie)
        race.compare(ranking, RACED * seconds * PER_S, MOST)
        self.raced = [e for e in ranking if e.finals.losses]
        rollouts = sum(len(e.finals.in_order()) for e in ranking)
        return self.judge(pick(ranking, self.result.tie), rollouts)

    def judge(self, winner: Evaluation, rollouts: int = 0) -> Choice:
        """Say what a winner earns in the unseen layouts."""
        unseen = self.fitness.unseen()
        ((_, trials),) = self.trials.try_in(unseen, [winner.candidate])
        rewards = [trial.reward for trial in trials]
        return Choice(rollouts, fmean(rewards), min(rewards))


def measure(pool: Pool) -> dict[str, Choice]:
    """Choose by each rule; ``any`` is the best of all candidates that any rule tried, by the unseen layouts."""
    try:
        found = {"before": pool.choose_before()}
        for seconds in BUDGETS_S:
            found[f"{seconds} s"] = pool.choose(seconds)
        judged = [pool.judge(tried) for tried in (*pool.earn_alike(), *pool.raced)]
        found["any"] = max(judged, key=lambda choice: (choice.worst, choice.mean))
    finally:
        pool.keep()
    return found


def summarise(folder: Path) -> None:
    """Print the table of all that was measured in a folder, and draw the figure."""
    stored = [json.loads(file.read_text()) for file in sorted(folder.glob("*.json"))]
    rules = ["before", *(f"{seconds} s" for seconds in BUDGETS_S), "any"]
    rows = []
    curves: dict[str, list[float]] = {"mean": [], "worst": []}
    for rule in rules:
        choices = [Choice(**record[rule]) for record in stored]
        means = [choice.mean for choice in choices]
        worst = [choice.worst for choice in choices]
        good = sum(reward >= GOOD for reward in worst)
        rollouts = fmean(choice.rollouts for choice in choices)
        figures = [fmean(means), fmean(worst)]
        row = (rule, f"{rollouts:.0f}", *(f"{figure:.3f}" for figure in figures))
        rows.append((*row, f"{good} of {len(choices)}"))
        if rule.endswith(" s"):
            curves["mean"].append(figures[0])
            curves["worst"].append(figures[1])

    head = ("rule", "rollouts", "mean", "worst", f"worst from {GOOD:g} on")
    print_table(head, rows, head[1:])

    figure = Figure((5, 3), layout="constrained")
    axes = figure.add_subplot(xscale="log", xticks=BUDGETS_S, xticklabels=BUDGETS_S)
    axes.set(xlabel="budget.final_s", ylabel="reward in 20 unseen layouts", ylim=(0, 1))
    for name, values in curves.items():
        axes.plot(BUDGETS_S, values, marker="o", label=name)
        before = float(rows[0][2 if name == "mean" else 3])
        axes.axhline(before, linestyle=":", color="grey")
    axes.minorticks_off()
    axes.legend()
    figure.savefig(folder / "finals.svg", metadata={"Date": None})


def main(words: list[str]) -> None:
    given = measuring.settings(arguments(USAGE, words), Settings)
    folder = Path(given.folder)
    folder.mkdir(parents=True, exist_ok=True)
    for seed in given.seeds:
        for task in measuring.tasks(given.tasks) if given.tasks else ():
            file = folder / f"{task}-{seed}.json"
            if not file.exists():
                choices = measure(Pool(file.with_suffix(".trials"), task, seed))
                found = {rule: asdict(choice) for rule, choice in choices.items()}
                measuring.save(file, found)

    summarise(folder)


if __name__ == "__main__":
    command(main)
