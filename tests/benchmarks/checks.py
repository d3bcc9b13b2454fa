"""What do the checks of a rollout cost? ``python -m tests.benchmarks.checks tasks=BringCube repeats=5``.

Each task's reference solution, and designs of the embedded designer, are tried with the search for penetrations and for
self-collision and without, in turns. All times are processor time of one thread, the smallest of ``repeats``, so that
other work on the machine matters little.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import core.simulation.rollout
from core.design import Candidate
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.interfaces import RolloutSettings, Simulator, Task
from core.plugins import installed
from core.support.cli import arguments, command
from tests.benchmarks import measuring, throughput
from tests.benchmarks.clocked import Clock

USAGE = "usage: python -m tests.benchmarks.checks [tasks=NAME,...] [sim=NAME] [tools=N] [plans=N] [repeats=N] [seed=N] "

PENETRATION = ("findings", "sample_hz", "thinnest")  # and the sampling that it needs
SELF_COLLISION = "find_self_collision"


@dataclass
class Settings:
    """``tools``, ``plans``: designs of the embedded designer, besides the reference solution."""

    tasks: list[str] = field(default_factory=list)
    sim: str = "mujoco"
    tools: int = 3
    plans: int = 4
    repeats: int = 5
    seed: int = 0


@dataclass(frozen=True)
class Cost:
    """Seconds a rollout: with the checks and without, and of each check."""

    checked: float
    plain: float
    penetration: float
    self_collision: float

    @property
    def shares(self) -> tuple[float, float, float]:
        """The shares of a checked rollout: penetration, self-collision, and all that goes if nothing is checked."""
        return (
            self.penetration / self.checked,
            self.self_collision / self.checked,
            1 - self.plain / self.checked,
        )


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    names, rows = measuring.tasks(given.tasks), list[tuple[str, Cost]]()
    clock = Clock(time.thread_time)
    for name in (*PENETRATION, SELF_COLLISION):
        clock.around(core.simulation.rollout, name, name)
    for name in names:
        task, simulator = installed().create("task", name), installed().create("sim", given.sim)
        rows.append((name, cost(task, simulator, chunks(name, given), clock, given)))
        measuring.console.print(line(*rows[-1]), highlight=False)
    table = markdown(rows)
    sys.stdout.write(table)


def chunks(name: str, given: Settings) -> list[list[Candidate]]:
    """Return the reference solution, if there is one, and the plans of each tool."""
    designs = throughput.designs(name, given.tools, given.plans, given.seed)
    found = [list(group) for _, group in itertools.groupby(designs, key=lambda c: c.strategy)]
    if (solution := measuring.SOLUTIONS / f"{name}.json").exists():
        spawn = SpawnRules(installed().create("task", name), given.seed)
        found.insert(0, read_designs(load_designs(solution), installed().create("tool", "urdf"), spawn)[:1])
    return found


def cost(
    task: Task, simulator: Simulator, chunks: Sequence[Sequence[Candidate]], clock: Clock, given: Settings
) -> Cost:
    """Try chunks of one tool's plans, all with the checks and without, and return the mean over the rollouts."""
    settings = {checked: RolloutSettings(penetration="warn" if checked else "ignore") for checked in (True, False)}
    sums = [0.0, 0.0, 0.0, 0.0]
    for chunk in chunks:
        least = [float("inf")] * 4
        for checked in (True, False) * (given.repeats + 1):  # the first time loads what is kept
            clock.seconds.update(dict.fromkeys(clock.seconds, 0.0))
            began = time.thread_time()
            core.simulation.rollout.evaluate_batch(task, simulator, chunk, given.seed, settings[checked])
            took = time.thread_time() - began
            inside = sum(clock.seconds[name] for name in PENETRATION), clock.seconds[SELF_COLLISION]
            times = (took, float("inf"), *inside) if checked else (float("inf"), took, float("inf"), float("inf"))
            least = [min(pair) for pair in zip(least, times, strict=True)]
        sums = [total + seconds for total, seconds in zip(sums, least, strict=True)]
    count = sum(len(chunk) for chunk in chunks)
    return Cost(*(total / count for total in sums))


def markdown(rows: Sequence[tuple[str, Cost]]) -> str:
    """Format a row per task, the mean of the shares, and the shares of all time."""
    shares = [cost.shares for _, cost in rows]
    mean = [sum(column) / len(column) for column in zip(*shares, strict=True)]
    columns = zip(*((c.checked, c.plain, c.penetration, c.self_collision) for _, c in rows), strict=True)
    together = Cost(*(sum(column) for column in columns))
    return "\n".join(
        [
            "| task | ms a rollout | penetration | self-collision | without any check |",
            "|---|---|---|---|---|",
            *(line(name, cost) for name, cost in rows),
            f"| **mean of the shares** | | {' | '.join(f'{share:.1%}' for share in mean[:2])} | {-mean[2]:+.1%} |",
            line("**share of all time**", together),
            "",
        ]
    )


def line(name: str, cost: Cost) -> str:
    """Format a row of the table."""
    penetration, self_collision, both = cost.shares
    return f"| {name} | {1000 * cost.checked:.0f} | {penetration:.1%} | {self_collision:.1%} | {-both:+.1%} |"


if __name__ == "__main__":
    command(lambda _: main())
