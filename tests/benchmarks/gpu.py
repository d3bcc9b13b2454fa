"""Thousands of worlds at once: ``python -m tests.benchmarks.gpu``, where there is a graphics card.

For each task the same designs of the embedded designer fill more and more worlds. Reported are rollouts per second, the
time to make a batch before its first step, memory, and whether `sim=mujoco` gives the same rewards. The result goes
to ``output`` as JSON. ``device=cpu`` tries it out where there is no card.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from core.design import Candidate
from core.errors import UsageError, UserError
from core.interfaces import RolloutSettings, Simulator
from core.plugins import installed
from core.simulation.rollout import evaluate_batch, prepare
from core.support.cli import arguments, command
from tests.benchmarks import clocked, measuring, throughput

USAGE = (
    "usage: python -m tests.benchmarks.gpu [tasks=NAME,...] [worlds=N,N,...] [device=cuda] [tools=N] [plans=N] "
    "[agreement=N] [penetration=NAME] [seed=N] [output=FILE.json]"
)

CLOSE = 0.05  # two engines' rewards, no further apart


@dataclass
class Settings:
    """``tools`` times ``plans`` different designs are repeated to fill the worlds. ``agreement``: how many of them are
    tried in `sim=mujoco` too; 0: none. ``penetration``: with ``ignore`` nothing is recorded.
    """

    tasks: list[str] = field(default_factory=lambda: ["BringCube", "GatherSpheres", "OneBook"])
    worlds: list[int] = field(default_factory=lambda: [64, 256, 1024, 2048, 4096, 8192])
    device: str = "cuda"
    tools: int = 32
    plans: int = 8
    agreement: int = 64
    penetration: str = "forbid"
    seed: int = 0
    output: str = "gpu.json"


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    names = measuring.tasks(given.tasks)
    if min(given.worlds, default=0) < 1:
        raise UsageError(f"worlds must be at least 1, got {given.worlds}")
    settings = RolloutSettings(penetration=given.penetration)
    rows = []
    agreements = []
    for name in names:
        candidates = throughput.designs(name, given.tools, given.plans, given.seed)
        simulator: Simulator | None = None
        for worlds in sorted(given.worlds):
            simulator = installed().create("sim", "mujoco_warp", {"device": given.device, "worlds": worlds})
            rows.append({"task": name, **measured(simulator, name, candidates, worlds, given.seed, settings)})
        if given.agreement and simulator is not None:
            found = agreement(simulator, name, candidates[: given.agreement], given.seed)
            agreements.append({"task": name, **found})
    device = described(given.device)
    found = {"device": device, "penetration": given.penetration, "rows": rows, "agreement": agreements}
    measuring.save(Path(given.output), {**found, "machine": throughput.machine()})
    table = markdown(device, rows, agreements)
    sys.stdout.write(f"{table}{given.output}\n")


def measured(
    simulator: Simulator,
    task_name: str,
    candidates: Sequence[Candidate],
    worlds: int,
    seed: int,
    settings: RolloutSettings,
) -> dict[str, Any]:
    """Measure a batch: seconds to prepare plans and tools (``planning_s``), to make kernels and graph (``making_s``)
    and to run the batch once it is made (``wall_s``); and memory.

    Raises:
        UserError: every rollout broke, for lack of memory or room.
    """
    task = installed().create("task", task_name)
    began = time.perf_counter()
    different = [
        prepare(task, candidate, seed, settings, 0.0 if settings.penetration == "ignore" else 25.0)[1]
        for candidate in candidates[:worlds]
    ]
    jobs = list(itertools.islice(itertools.cycle(different), worlds))
    planned = time.perf_counter() - began
    free = memory_mb(simulator)
    simulator.rollout(task, jobs)
    first = time.perf_counter() - began - planned
    used = memory_mb(simulator) - free
    began = time.perf_counter()
    outcomes = simulator.rollout(task, jobs)
    wall = time.perf_counter() - began
    broken = [outcome.error for outcome in outcomes if outcome.error is not None]
    if len(broken) == len(outcomes):
        raise UserError(f"{task_name}: no rollout was completed: {broken[0]}")
    return {
        "worlds": worlds,
        "rollouts_per_s": worlds / wall,
        "wall_s": wall,
        "planning_s": planned,
        "making_s": first - wall,
        "memory_mb": used,
        "broken": len(broken),
        "seconds_of_motion": float(np.mean([job.trajectory.duration for job in jobs])),
    }


def memory_mb(simulator: Simulator) -> float:
    """Return the card's memory in use; without a card, the most that this process ever used."""
    device = simulator._device  # type: ignore[attr-defined]
    return (device.total_memory - device.free_memory) / 2**20 if device.is_cuda else clocked.peak_mb()


def agreement(simulator: Simulator, task_name: str, candidates: Sequence[Candidate], seed: int) -> dict[str, Any]:
    """Compare the rewards with those in `sim=mujoco`."""
    task = installed().create("task", task_name)
    settings = RolloutSettings()
    ours, theirs = (
        [e.reward for e in evaluate_batch(task, engine, candidates, seed, settings)]
        for engine in (simulator, installed().create("sim", "mujoco"))
    )
    apart = np.abs(np.subtract(ours, theirs))
    alike = np.ptp(ours) == 0 or np.ptp(theirs) == 0
    return {
        "designs": len(ours),
        "close": float((apart <= CLOSE).mean()),
        "rank_correlation": None if alike else float(spearmanr(ours, theirs).statistic),
        "mean_difference": float(apart.mean()),
        "means": [float(np.mean(ours)), float(np.mean(theirs))],
    }


def described(device: str) -> str:
    """Return the device's common name."""
    made = installed().create("sim", "mujoco_warp", {"device": device})
    return str(made._device.name) if made._device.is_cuda else "the processor"


def markdown(device: str, rows: Sequence[dict[str, Any]], agreements: Sequence[dict[str, Any]]) -> str:
    """Both tables."""
    lines = [
        f"On {device}:",
        "",
        "| task | worlds | rollouts/s | seconds a batch | seconds to make it | memory, MB |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row['task']} | {row['worlds']:,} | {row['rollouts_per_s']:.3g} | {row['wall_s']:.2f} | "
            f"{row['making_s']:.1f} | {row['memory_mb']:.0f} |"
        )
    if agreements:
        lines += ["", "| task | designs | rewards within 0.05 of MuJoCo's | rank correlation | mean difference |"]
        lines += ["|---|---|---|---|---|"]
    for row in agreements:
        correlation = "–" if row["rank_correlation"] is None else f"{row['rank_correlation']:.2f}"
        lines.append(
            f"| {row['task']} | {row['designs']} | {row['close']:.0%} | {correlation} | {row['mean_difference']:.3f} |"
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    command(lambda _: main())
