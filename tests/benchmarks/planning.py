"""What does planning cost beside the engine? ``python -m tests.benchmarks.planning tasks=BringCube,CleanTable``.

The embedded designer's first answer for each task and scene file is tried in one process, with a clock of processor
time around each stage. The table has seconds of processor for a candidate, and of a rollout's time the share of each
stage. Planning is all that comes before the engine. The designer's time is apart: a run has it once for many trials.
"""

from __future__ import annotations

import importlib
import itertools
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean
from typing import Any

from core.config.compose import load, node, part
from core.design import Candidate
from core.designs.reading import read_designs
from core.designs.replies import parse_reply
from core.errors import UsageError, UserError
from core.interfaces import RolloutSettings
from core.simulation import attempt
from core.simulation.play import play
from core.support.cli import arguments, command
from core.trial import Condition
from plugins.commands.prompt import PromptConfig, compose
from tasks import tasks as twelve
from tasks.hardtoolbench import tasks as hard
from tests.benchmarks import measuring
from tests.benchmarks.throughput import Clock

USAGE = (
    "usage: python -m tests.benchmarks.planning [tasks=NAME,...] [scenes=FILE,...] [sim=NAME] [tools=N] [plans=N] "
    "[seed=N] [protocol=NAME] [output=FILE.json]"
)
SCENES = Path(__file__).parents[1] / "plugins" / "tasks" / "file" / "scenes"

# Each stage's functions, where they are called: a module and a name in it.
STAGES = {
    "start": [(attempt, "_find_start_fault")],
    "path": [(attempt, "prepare")],
    "check": [(attempt, "check_motion")],
    "self-collision": [(attempt, "_self_collision")],
    "engine": [(importlib.import_module("core.simulation.play"), "_run_engine")],
    "judging": [(importlib.import_module("core.simulation.play"), "judge_attempts")],
}
BEFORE_ENGINE = ("start", "path", "check", "self-collision", "rest")


@dataclass
class Settings:
    """Without ``tasks`` and ``scenes``: the twelve tasks, HardToolBench, and ten scene files of the tests.

    The first of the ``tools`` is tried before the clocks run, so that a process's first steps are not counted.
    """

    tasks: list[str] = field(default_factory=list)
    scenes: list[str] = field(default_factory=list)
    sim: str = "mujoco"
    tools: int = 3
    plans: int = 3
    seed: int = 0
    protocol: str = "none"
    output: str = "planning.json"


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    if given.tools < 2 or given.plans < 1:
        raise UsageError("tools must be at least 2, and plans at least 1")

    rows = []
    for name, words in chosen(given).items():
        rows.append(measure(name, words, given))
        measuring.save(Path(given.output), rows)

    sys.stdout.write(tabulate(rows))


def chosen(given: Settings) -> dict[str, list[str]]:
    """Return the words that choose each task on a command line, by the task's name."""
    names = given.tasks
    files = [Path(file) for file in given.scenes]
    if not names and not files:
        names = [*twelve(), *hard()]
        files = sorted(SCENES.glob("*.yaml"))[:10]

    words = {name: [f"task={name}"] for name in measuring.tasks(names) if names}
    for file in files:
        words[file.stem] = ["task=file", f"task.file={file}"]
    return words


def measure(name: str, words: Sequence[str], given: Settings) -> dict[str, Any]:
    """Design for a task and try the designs.

    Returns:
        Seconds of processor for a candidate of the designer, of reading, and of each stage; and how often each status
        came out.

    Raises:
        UserError: no tool but the first keeps the rules.
    """
    words = [*words, f"seed={given.seed}", f"protocol={given.protocol}"]
    made, took = design(words, given)
    groups = [
        tuple(group) for _, group in itertools.groupby(made, key=lambda c: c.design)
    ]
    first, *others = groups
    tried = [group for group in others if group[0].problem is None]
    if not tried:
        raise UserError(
            f"{name}: no tool but the first keeps the rules; ask for more tools"
        )

    cfg = load("evaluate", [*words, f"sim={given.sim}", "designs=none"])
    settings = node(cfg.rollout, RolloutSettings)
    task = part("task", cfg.task)
    condition = Condition(task, part("sim", cfg.sim), given.seed, settings)
    play(condition, first[:1])

    clock = Clock(time.process_time)
    for stage, functions in STAGES.items():
        for holder, function in functions:
            clock.around(holder, function, stage)
    began = time.process_time()
    try:
        trials = [trial for group in tried for trial in play(condition, group)]
    finally:
        clock.remove()

    total = time.process_time() - began
    seconds = clock.seconds
    seconds["rest"] = total - sum(seconds.values())
    statuses = [trial.status for trial in trials]
    return {
        "task": name,
        "sim": given.sim,
        "rollouts": len(trials),
        "tried": {status: statuses.count(status) for status in sorted(set(statuses))},
        **{stage: spent / len(made) for stage, spent in took.items()},
        "rollout": total / len(trials),
        "stages": {stage: spent / len(trials) for stage, spent in seconds.items()},
        "planning": sum(seconds[stage] for stage in BEFORE_ENGINE) / total,
    }


def design(
    words: Sequence[str], given: Settings
) -> tuple[list[Candidate], dict[str, float]]:
    """Return the embedded designer's candidates, and the seconds of processor of designer and reading."""
    budget = {"n_agent": 1, "n_iteration": 0}
    budget |= {"n_tool": given.tools, "n_action": given.plans}
    words = [*words, "vlm=offline"]
    words += [f"budget.{key}={value}" for key, value in budget.items()]
    cfg = load("prompt", words, PromptConfig)
    request = compose(cfg)
    model = part("vlm", cfg.vlm).create()
    representation = part("tool", cfg.tool).create()
    task = part("task", cfg.task).create()

    began = time.process_time()
    (reply,) = model.complete([request])
    if reply.error:
        raise UserError(f"{task.name}: {reply.error}")
    designed = time.process_time()
    read = read_designs(parse_reply(reply.text), representation, task)
    done = time.process_time()

    return read, {"designer": designed - began, "reading": done - designed}


def tabulate(rows: Sequence[dict[str, Any]]) -> str:
    """Make the table, with the mean over all tasks as its last row."""
    stages = [*STAGES, "rest"]
    heads = ["task", "designer s", "reading s", "rollout s", *stages, "planning"]
    lines = [_join(heads), _join(["---"] * len(heads))]

    for row in rows:
        lines.append(_write_row(row["task"], [row]))

    lines.append(_write_row("mean", rows))
    return "\n".join(lines) + "\n"


def _write_row(name: str, rows: Sequence[dict[str, Any]]) -> str:
    """Write a line of the table: the means over rows."""
    cells = [name]
    for key in ("designer", "reading", "rollout"):
        seconds = mean(row[key] for row in rows)
        cells.append(f"{seconds:.3f}")

    for stage in rows[0]["stages"]:
        share = mean(row["stages"][stage] / row["rollout"] for row in rows)
        cells.append(f"{share:.1%}")

    planning = mean(row["planning"] for row in rows)
    return _join([*cells, f"{planning:.1%}"])


def _join(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    command(lambda _: main())
