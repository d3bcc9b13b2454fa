"""How much does a population cost beyond the engine's own steps? ``python -m tests.benchmarks.throughput task=BringCube
sim=pybullet workers=2 tools=20 plans=10``.

Designs of the embedded designer are tried as a run tries them, with a clock in each part, after all workers have
started. Then ``reference`` rollouts are tried the plain way: a process each, inverse kinematics at each step of 1 ms,
as many side by side as there are workers. The result goes to ``output`` as JSON.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

from core.config.compose import load, node, part
from core.design import Candidate, Evaluation
from core.designs.reading import dump_design, parse_reply, read_designs
from core.designs.rules import SpawnRules
from core.errors import UsageError, UserError
from core.interfaces import Executor, RolloutSettings
from core.plugins import event_hub, installed
from core.prompt import compose
from core.search.evolution import Trials
from core.simulation.rollout import Evaluator, PluginPart
from core.store.recorder import RunStore
from core.support.cli import arguments, command
from tests.benchmarks import clocked, measuring
from tests.benchmarks.clocked import Clocked, Roll, Still

USAGE = (
    "usage: python -m tests.benchmarks.throughput [task=NAME] [sim=NAME] [time_step=SECONDS] [workers=N] [tools=N] "
    "[plans=N] [reference=N] [reference_sim=NAME] [ceiling=N] [seed=N] [executor=NAME] [output=FILE.json]"
)

SPARE = 1.25  # tools more than needed, since some may be rejected
AFTER = 200  # rollouts after which memory is to stay as it is


@dataclass
class Settings:
    """``time_step``: the default is the engine's own. ``reference``: the number of plain rollouts; 0: none.
    ``reference_sim``: their engine; the default is ``sim``, or PyBullet if ``sim`` plays whole trajectories by itself.
    ``ceiling``: the number of candidates without simulation that measure the parent process; 0: none.
    """

    task: str = "BringCube"
    sim: str = "pybullet"
    time_step: float | None = None
    workers: int | None = None
    tools: int = 20
    plans: int = 10
    reference: int = 4
    reference_sim: str | None = None
    ceiling: int = 2000
    seed: int = 0
    executor: str = "local"
    output: str = "throughput.json"


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    (task,) = measuring.tasks([given.task])
    workers = measuring.workers(given.workers)
    for name in ("tools", "plans"):
        if getattr(given, name) < 1:
            raise UsageError(f"{name} must be at least 1, got {getattr(given, name)}")
    words = [f"task={task}", f"sim={given.sim}", f"seed={given.seed}"]
    if given.time_step is not None:
        words.append(f"sim.time_step={given.time_step}")
    cfg = load("evaluate", [*words, "designs=none", f"executor={given.executor}", f"executor.workers={workers}"])
    sim = part("sim", cfg.sim)
    clocked.steps_of(sim.name)
    evaluator = Evaluator(PluginPart("task", task), sim, given.seed, node(cfg.rollout, RolloutSettings))
    candidates = designs(task, given.tools, given.plans, given.seed)

    with part("executor", cfg.executor).create() as executor:
        found = population(candidates, evaluator, executor, workers)
    found = {"task": task, "sim": {"name": sim.name, **dict(sim.settings)}, "executor": given.executor} | found
    if given.reference:
        other = given.reference_sim or (sim.name if sim.name in clocked.PLAYED else "pybullet")
        found["reference"] = reference(candidates, task, other, given.seed, given.reference, workers)
        found["times_the_reference"] = found["rollouts_per_s"] / found["reference"]["rollouts_per_s"]
    if given.ceiling:
        found["parent"] = ceiling(candidates, workers, given.ceiling)
    found["machine"] = machine()
    measuring.save(Path(given.output), found)
    sys.stdout.write(summary(found) + f"{given.output}\n")


def designs(task: str, tools: int, plans: int, seed: int) -> list[Candidate]:
    """Return ``plans`` motions for each of ``tools`` tools, from the embedded designer's first answer.

    Raises:
        UserError: too few of them keep the rules.
    """
    n_tool = math.ceil(SPARE * tools)
    words = [f"task={task}", "vlm=offline", "tool=urdf", f"seed={seed}"]
    budget = {"n_agent": 1, "n_tool": n_tool, "n_action": plans, "n_iteration": 0}
    cfg = load("prompt", [*words, *(f"budget.{key}={value}" for key, value in budget.items())])
    request = compose(cfg)
    (reply,) = part("vlm", cfg.vlm).create().complete([request])
    spawn = SpawnRules(installed().create("task", task), seed)
    representation = part("tool", cfg.tool).create()
    read = read_designs(parse_reply(reply.text), representation, spawn, most=(n_tool, plans))
    groups = itertools.groupby((c for c in read if c.problem is None), key=lambda c: c.strategy)
    whole = [group for group in (list(group) for _, group in groups) if len(group) == plans]
    if len(whole) < tools:
        raise UserError(f"{task}: {len(whole)} tools of {n_tool} keep the rules; ask for fewer than tools={tools}")
    return [candidate for group in whole[:tools] for candidate in group]


# --- the population ---------------------------------------------------------------------------------------------


def population(
    candidates: Sequence[Candidate], evaluator: Evaluator, executor: Executor, workers: int
) -> dict[str, Any]:
    """Measure rollouts per second, the time of each part, and memory."""
    clock = Clocked(evaluator)
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        warm = Roll(folder, workers, clock)
        for _, result in executor.map(warm, [[c] for c in candidates[:1] * workers]):
            if isinstance(result, Exception):
                raise result
    started = time.perf_counter() - began

    memory: list[float] = []
    arrived: list[float] = []
    evaluations: list[Evaluation] = []
    began = time.perf_counter()
    tried = Trials(clock, executor)(candidates)
    for evaluation in track(tried, total=len(candidates), console=measuring.console, disable=_quiet()):
        evaluations.append(evaluation)
        arrived.append(time.perf_counter() - began)
        memory.append(clocked.resident_mb())
    wall = arrived[-1]
    chunks = [e.figures for e in evaluations if "chunk" in e.figures]
    total = {label: sum(chunk.get(label, 0.0) for chunk in chunks) for label in {key for c in chunks for key in c}}
    all_time = workers * wall
    parts = {
        "stepping": total["step"],
        "driving": total["playing"] - total["step"],  # commands, states and recordings between steps
        "loading": total["simulator"] - total["playing"],
        "ik": total["ik"],
        "checks": total["checks"],
        "reward": total["reward"],
    }
    parts["rest"] = total["chunk"] - sum(parts.values())
    parts["transport"] = all_time - total["chunk"]  # and waiting for the last
    tries = {e.status: sum(o.status == e.status for o in evaluations) for e in evaluations}
    return {
        "workers": workers,
        "rollouts": len(candidates),
        "tried": tries,
        "started_s": started,
        "first_s": arrived[0],
        "wall_s": wall,
        "rollouts_per_s": len(candidates) / wall,
        "steps": total["steps"],
        "engine_s": total["step"],
        "worker_cpu_s": total["cpu"],
        "overhead": all_time / total["step"],
        "overhead_in_worker": total["chunk"] / total["step"],
        "shares": {name: seconds / all_time for name, seconds in parts.items()},
        "longest_wait_s": float(np.diff(arrived, prepend=0.0).max()),
        "memory": {
            "parent_peak_mb": clocked.peak_mb(),
            "parent_growth_kb_per_rollout": growth(np.arange(len(memory)), memory),
            "workers": _workers_memory(chunks, len(candidates)),
        },
    }


def _workers_memory(chunks: Sequence[dict[str, Any]], rollouts: int) -> list[dict[str, float]]:
    """Return each worker's memory. Rollouts are counted over all workers."""
    at = np.arange(1, len(chunks) + 1) * rollouts / len(chunks)
    found = []
    for pid in sorted({chunk["pid"] for chunk in chunks}):
        own = [i for i, chunk in enumerate(chunks) if chunk["pid"] == pid]
        found.append(
            {
                "peak_mb": max(chunks[i]["peak_mb"] for i in own),
                "growth_kb_per_rollout": growth(at[own], [chunks[i]["mb"] for i in own]),
            }
        )
    return found


def growth(rollouts: Any, megabytes: Sequence[float]) -> float | None:
    """Fit a line to memory after the first `AFTER` rollouts; return kilobytes per rollout, None if there are few."""
    late = np.asarray(rollouts) >= AFTER
    if late.sum() < 10:
        return None
    return float(np.polyfit(np.asarray(rollouts)[late], 1024 * np.asarray(megabytes)[late], 1)[0])


# --- the reference and the parent -------------------------------------------------------------------------------


def reference(
    candidates: Sequence[Candidate], task: str, sim: str, seed: int, count: int, workers: int
) -> dict[str, Any]:
    """Measure rollouts per second with a process per rollout (`clocked.reference`), for ``count`` of the candidates."""
    chosen = measuring.evenly(list(candidates), count)
    representation = installed().create("tool", "urdf")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "designs.json"
        file.write_text(json.dumps({"strategies": [dump_design(c, representation) for c in chosen]}))

        def one(number: int) -> None:
            arguments = {"task_name": task, "sim": sim, "designs": str(file), "number": number, "seed": seed}
            words = [sys.executable, "-m", "tests.benchmarks.clocked", json.dumps(arguments)]
            done = subprocess.run(words, capture_output=True, text=True)
            if done.returncode != 0:
                raise UserError(f"the reference broke: {done.stderr.strip().splitlines()[-1]}")

        began = time.perf_counter()
        with ThreadPoolExecutor(workers) as threads:
            list(threads.map(one, range(len(chosen))))
        wall = time.perf_counter() - began
    return {"sim": sim, "time_step": 0.001, "rollouts": len(chosen), "rollouts_per_s": len(chosen) / wall}


def ceiling(candidates: Sequence[Candidate], workers: int, count: int) -> dict[str, float]:
    """Measure how many candidates per second the parent dispatches, receives and stores, without simulation."""
    many = [
        Candidate(c.tool, c.plan.poses + 1e-9 * n, 0, n, c.strategy, c.action)  # none is the same as another
        for n, c in itertools.islice(((n, c) for n in itertools.count() for c in candidates), count)
    ]
    events = event_hub()
    with tempfile.TemporaryDirectory() as folder, measuring.executor(workers) as executor:
        list(executor.map(Still(), [[many[0]]] * (2 * workers)))
        began = time.perf_counter()
        for _ in Trials(Still(), executor)(many):
            pass
        dispatched = time.perf_counter() - began
        store = RunStore.create(Path(folder) / "run", {"tool": {"name": "urdf"}})
        events.register(store, "store")
        try:
            began = time.perf_counter()
            cpu = time.process_time()
            for evaluation in Trials(Still(), executor)(many):
                events.hook.candidate_evaluated(evaluation=evaluation)
            stored = time.perf_counter() - began
            used = time.process_time() - cpu
        finally:
            store.run_ended()
    return {
        "candidates": len(many),
        "dispatched_per_s": len(many) / dispatched,
        "stored_per_s": len(many) / stored,
        "stored_per_cpu_s": len(many) / used,
    }


# --- the report -------------------------------------------------------------------------------------------------


def machine() -> dict[str, Any]:
    """Describe the machine and its load."""
    return {
        "system": platform.platform(),
        "python": platform.python_version(),
        "cores": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
    }


def summary(found: dict[str, Any]) -> str:
    """Return what is printed."""
    shares = ", ".join(f"{name} {share:.1%}" for name, share in found["shares"].items())
    lines = [
        f"{found['task']} in {found['sim']['name']}: {found['rollouts']} rollouts with {found['workers']} workers, "
        f"{found['rollouts_per_s']:.2f} a second",
        f"workers x wall / seconds in the engine's steps: {found['overhead']:.2f}",
        f"shares: {shares}",
    ]
    if "reference" in found:
        lines.append(
            f"a process per rollout in {found['reference']['sim']}: 1/{found['times_the_reference']:.1f} of it"
        )
    if "parent" in found:
        lines.append(f"the parent alone: {found['parent']['stored_per_s']:.0f} candidates a second")
    return "".join(f"{line}\n" for line in lines)


def _quiet() -> bool:
    return not measuring.console.is_terminal


if __name__ == "__main__":
    command(lambda _: main())
