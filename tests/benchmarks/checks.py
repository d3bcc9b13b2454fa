"""What do the checks cost? ``python -m tests.benchmarks.checks [tasks=NAME,...] [sims=NAME,...] [rounds=N]``.

Each engine plays the tasks' reference solutions ``rounds`` times, after once unmeasured. The table has each check's
share of a candidate's processor time, from the parsed document to the reward.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field

import core.designs.reading
import core.designs.rules
import core.simulation.rollout
import core.solids.contacts
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.plugins import PluginPart, installed
from core.simulation.rollout import Evaluator
from core.support.cli import command
from tests.benchmarks import measuring
from tests.benchmarks.clocked import Clock
from tests.solutions import FILES, representation

CLOCKS = [  # what has the function, its name, the check
    (core.designs.reading, "check_tool", "tool's rules"),
    (core.designs.rules, "check_joints", "springs among them"),
    (core.simulation.rollout, "_self_collision", "self-collision"),
    (core.simulation.rollout, "findings", "penetration"),
    (core.simulation.rollout, "find_contacts", "contacts"),
    (core.solids.contacts, "nearest", "clearance among them"),
    (core.simulation.rollout, "make_trace", "trace"),
    (core.simulation.rollout, "_rewards", "reward, force chains"),
    (core.simulation.rollout, "margins_of", "margins"),
]


@dataclass
class Settings:
    """``rounds``: how often each solution is played."""

    tasks: list[str] = field(default_factory=lambda: ["BringCube", "AroundCorner", "LidAndBall", "SweepCards"])
    sims: list[str] = field(default_factory=lambda: ["mujoco", "pybullet", "sapien"])
    rounds: int = 2


def main(words: list[str]) -> None:
    given = measuring.settings(words, Settings)
    clock = Clock(time.process_time)
    for holder, name, label in CLOCKS:
        clock.around(holder, name, label)
    labels = [label for _, _, label in CLOCKS]
    sys.stdout.write(f"| task | engine | ms | {' | '.join(labels)} |\n{'|---' * (3 + len(labels))}|\n")
    for task in given.tasks:
        for sim in given.sims:
            play(task, sim)
            before = dict(clock.seconds)
            began = time.process_time()
            for _ in range(given.rounds):
                play(task, sim)
            took = time.process_time() - began
            shares = [f"{100 * (clock.seconds[label] - before[label]) / took:.1f}%" for label in labels]
            sys.stdout.write(f"| {task} | {sim} | {1000 * took / given.rounds:.0f} | {' | '.join(shares)} |\n")
            sys.stdout.flush()


def play(task: str, sim: str) -> None:
    """Read the reference solution of a task, and play it."""
    rules = SpawnRules(installed().create("task", task), 0)
    tools = representation(FILES[task])
    candidates = read_designs(load_designs(FILES[task]), tools, rules)
    Evaluator(PluginPart("task", task), PluginPart("sim", sim), 0)(candidates[:1])


if __name__ == "__main__":
    command(main)
