"""What do looks earn? ``python -m tests.benchmarks.looks [tasks=NAME,...] [sims=NAME,...] [layouts=N] [noise=M,...]``.

Each task's reference plan is played once as it is, and once in a loop: after it the tool rises, the plan looks, and
goes through all of it again until the task's first goal is seen to be reached, ``rounds`` times at most. It prints the
mean and the worst reward of both, and the processor time of a rollout.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from core.config.compose import engines
from core.design import Candidate
from core.interfaces import Condition, Perception, RolloutSettings
from core.plugins import TASK, PluginPart
from core.simulation.play import play
from core.support.cli import command
from plugins.actions.anchored import AnchoredPlan
from plugins.actions.blocks import LookStep, Repeat, Sighting, list_waypoints
from tests.benchmarks import measuring
from tests.solutions import anchored

RISE_M = 0.15
FIRST = 1_000_000  # the seed of the first unseen layout


@dataclass
class Settings:
    tasks: list[str] = field(default_factory=lambda: ["BringCube", "CleanTable"])
    sims: list[str] = field(default_factory=lambda: ["mujoco", "sapien"])
    layouts: int = 20
    noise: list[float] = field(default_factory=lambda: [0.01, 0.02])
    rounds: int = 3


def main() -> None:
    given = measuring.settings(sys.argv[1:], Settings)

    for name in given.tasks:
        once = anchored(name)
        looped = replace(once, plan=loop(once.plan, given.rounds))
        for noise in given.noise:
            for sim in given.sims:
                for label, candidate in (("once", once), ("looks", looped)):
                    line = measure(name, sim, noise, given.layouts, candidate)
                    sys.stdout.write(f"{name} {sim} {noise:g} m {label}: {line}\n")
                    sys.stdout.flush()


def loop(plan: object, rounds: int) -> AnchoredPlan:
    """Do a plan again until the first goal is seen to be reached."""
    assert isinstance(plan, AnchoredPlan)
    last = list_waypoints(plan.steps)[-1]
    x, y, z = last.offset
    rise = replace(last, offset=(x, y, z + RISE_M))
    block = (*plan.steps, rise, LookStep())
    return AnchoredPlan((Repeat(block, Sighting(goal=0), rounds),), plan.gripper)


def measure(
    task: str, sim: str, noise: float, layouts: int, candidate: Candidate
) -> str:
    """Play a candidate in unseen layouts, and say what it earns."""
    settings = RolloutSettings(perception=Perception(position=noise))
    part = PluginPart(TASK.name, task, (("variation", "wide"),))
    engine = engines([sim])[sim]
    rewards = []
    begun = time.process_time()

    for seed in range(FIRST, FIRST + layouts):
        where = Condition(part, engine, seed, settings, engine=sim)
        (trial,) = play(where, [candidate])
        rewards.append(trial.reward)

    return describe(rewards, time.process_time() - begun)


def describe(rewards: Sequence[float], seconds: float) -> str:
    each = seconds / len(rewards)
    return f"mean {np.mean(rewards):.3f}, worst {min(rewards):.3f}, {each:.2f} s each"


if __name__ == "__main__":
    command(lambda _: main())
