"""What do looks earn? ``python -m tests.benchmarks.looks [tasks=NAME,...] [sims=NAME,...] [layouts=N] [noise=M,...]``.

For a task, or a scene file that lies in the folder ``looking``, that folder's designs file has the best plan written by
hand without looks, called ``once``, and the best with them, ``looks``. It prints the mean and the worst reward of both
in unseen layouts, and the processor time of a rollout. ``camera=hand`` puts the camera into the hand, and ``yaw=0.01``
makes it err in turns, too, radians, as with ``protocol=varied``.

For a task without such a file the reference plan is played once as it is, and once in a loop: after it the tool rises,
the plan looks, and goes through all of it again until the task's first goal is seen to be reached, three times at most.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from core.config.compose import engines
from core.design import Candidate
from core.designs.reading import load_designs, read_designs
from core.interfaces import Condition, Perception, RolloutSettings, Task
from core.plugins import TASK, PluginPart
from core.simulation.play import play
from core.support.cli import command
from plugins.actions.anchored import AnchoredPlan
from plugins.actions.blocks import LookStep, Repeat, Sighting, list_waypoints
from tests.benchmarks import measuring
from tests.support.solutions import anchored, representation

LOOKING = Path(__file__).parent / "looking"
RISE_M = 0.15
ROUNDS = 3
FIRST = 1_000_000  # the seed of the first unseen layout


@dataclass
class Settings:
    tasks: list[str] = field(default_factory=lambda: ["BringCube"])
    sims: list[str] = field(default_factory=lambda: ["mujoco", "sapien"])
    layouts: int = 20
    noise: list[float] = field(default_factory=lambda: [0.01, 0.02])
    yaw: float = 0.0
    camera: str = "fixed"
    first: int = FIRST


def main() -> None:
    given = measuring.settings(sys.argv[1:], Settings)

    for name in given.tasks:
        part = find_task(name)
        candidates = [*list_candidates(name, part.create())]
        for noise in given.noise:
            perception = Perception(noise, given.yaw, camera=given.camera)
            for sim in given.sims:
                for label, candidate in candidates:
                    line = measure(part, sim, perception, given, candidate)
                    sys.stdout.write(f"{name} {sim} {noise:g} m {label}: {line}\n")
                    sys.stdout.flush()


def find_task(name: str) -> PluginPart[Task]:
    """Return a task by its name, or that of the scene file of this name."""
    scene = LOOKING / f"{name}.yaml"
    wide = ("variation", "wide")
    if scene.is_file():
        return PluginPart(TASK.name, "file", (("file", str(scene)), wide))
    return PluginPart(TASK.name, name, (wide,))


def list_candidates(name: str, task: Task) -> Iterator[tuple[str, Candidate]]:
    """Yield the plans to compare, and what they are called."""
    file = LOOKING / f"{name}.json"
    if file.is_file():
        for candidate in read_designs(load_designs(file), representation(file), task):
            assert candidate.problem is None, candidate.problem
            yield candidate.design_name, candidate
        return

    once = anchored(name)
    yield "once", once
    yield "looks", replace(once, plan=loop(once.plan))


def loop(plan: object) -> AnchoredPlan:
    """Do a plan again until the first goal is seen to be reached."""
    assert isinstance(plan, AnchoredPlan)
    last = list_waypoints(plan.steps)[-1]
    x, y, z = last.offset
    rise = replace(last, offset=(x, y, z + RISE_M))
    block = (*plan.steps, rise, LookStep(True))
    return AnchoredPlan((Repeat(block, Sighting(goal=0), ROUNDS),), plan.gripper)


def measure(
    part: PluginPart[Task],
    sim: str,
    perception: Perception,
    given: Settings,
    candidate: Candidate,
) -> str:
    """Play a candidate in unseen layouts, and say what it earns."""
    settings = RolloutSettings(perception=perception)
    engine = engines([sim])[sim]
    rewards = []
    begun = time.process_time()

    for seed in range(given.first, given.first + given.layouts):
        where = Condition(part, engine, seed, settings, engine=sim)
        (trial,) = play(where, [candidate])
        rewards.append(trial.reward)

    each = (time.process_time() - begun) / len(rewards)
    shown = " ".join(f"{reward:.2f}" for reward in rewards)
    return f"mean {np.mean(rewards):.3f}, worst {min(rewards):.3f}, {each:.2f} s each ({shown})"


if __name__ == "__main__":
    command(lambda _: main())
